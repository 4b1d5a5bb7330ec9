"""What `fluentboard up` runs: the YAML file as checked values, and as command lines."""

from __future__ import annotations

import difflib
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self, cast

import yaml
from pydantic import Field, ValidationError, model_validator

from fluentboard.errors import InvalidConfiguration
from fluentboard_modules.settings import Settings

_Seconds = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,40}")
Scalar = str | bool | int | float


class ServiceConfig(Settings):
    """The board, as flags of `fluentboard serve`."""

    host: str = Field(default="127.0.0.1", description="Address to listen on.")
    port: int = Field(default=8080, ge=0, le=65535, description="TCP port; 0 takes any free one.")
    data: Path = Field(default=Path("fluentboard-data"), description="Folder of the board.")
    in_memory: bool = Field(default=False, description="Keep nothing on disk.")
    config: Path | None = Field(default=None, description="Settings file of the board.")
    ontologies: tuple[Path, ...] = Field(default=(), description="Ontologies to load besides ours.")


class WorkerConfig(Settings):
    """One worker: a perception module, or any other program."""

    module: str | None = Field(
        default=None, description="Module to run: mapping, anchoring or search."
    )
    frames: str | None = Field(
        default=None, description="Where the module's frames come from; `{board}` is the board."
    )
    options: dict[str, Scalar | tuple[Scalar, ...]] = Field(
        default_factory=dict[str, Scalar | tuple[Scalar, ...]],
        description="Further flags of `fluentboard work`, without the dashes.",
    )
    command: tuple[str, ...] | None = Field(
        default=None, description="Another program, instead of a module; `{board}` is the board."
    )
    environment: dict[str, str] = Field(
        default_factory=dict[str, str], description="Environment variables besides our own."
    )
    restart: Literal["on-failure", "always", "never"] = Field(
        default="on-failure", description="When to start it again after it ended."
    )

    @model_validator(mode="after")
    def _is_one_thing(self) -> Self:
        if (self.module is None) == (self.command is None):
            raise ValueError("give either module or command")
        if self.module is not None and self.frames is None:
            raise ValueError("a module needs frames")
        if self.command is not None and (self.frames is not None or self.options):
            raise ValueError("frames and options are for modules; write them into command")
        if self.command == ():
            raise ValueError("the command is empty")
        return self


class RestartConfig(Settings):
    """How long a crashed process rests before it is started again."""

    first_wait_s: _Seconds = Field(default=1.0, description="After the first crash.")
    longest_wait_s: _Seconds = Field(
        default=60.0, description="The wait doubles with every crash, up to this."
    )
    healthy_after_s: _Seconds = Field(
        default=30.0, description="A process that ran so long starts from the first wait again."
    )
    at_most: int | None = Field(
        default=None, ge=0, description="Restarts in a row before it is given up; null for ever."
    )


class StateConfig(Settings):
    """What the board is told about the workers."""

    fluents: bool = Field(
        default=True, description="Write WorkerActivity and WorkerStatus fluents."
    )
    heartbeat_s: _Seconds = Field(default=10.0, description="How often a heartbeat is written.")
    status_s: _Seconds = Field(
        default=30.0, description="How often, at most, frames, lag and drops are written."
    )


class UpConfig(Settings):
    """All of it."""

    board: str | None = Field(
        default=None, description="Address of a board that runs already, instead of service."
    )
    service: ServiceConfig | None = Field(default=None, description="The board to run.")
    workers: dict[str, WorkerConfig] = Field(
        default_factory=dict[str, WorkerConfig], description="Workers by name."
    )
    restart: RestartConfig = RestartConfig()
    state: StateConfig = StateConfig()
    stop_timeout_s: _Seconds = Field(
        default=20.0, description="How long processes may take to stop before they are killed."
    )
    stop_when_done: bool = Field(
        default=False, description="Stop when every worker has come to the end of its recording."
    )

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        if self.board is not None and self.service is not None:
            raise ValueError("give either board or service")
        for name in self.workers:
            if not _NAME.fullmatch(name):
                raise ValueError(
                    f"worker name {name!r}: begin with a letter, then letters, digits, _ and -"
                )
        return self


def load_config(path: Path) -> UpConfig:
    """The configuration in a file.

    Raises:
        InvalidConfiguration: the file cannot be read, a key is unknown or a value not allowed; the
            message names them.
    """
    try:
        document: Any = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as problem:
        raise InvalidConfiguration(f"{path}: cannot be read ({problem.strerror})") from problem
    except (yaml.YAMLError, UnicodeDecodeError) as problem:
        raise InvalidConfiguration(f"{path}: is not YAML: {problem}") from problem
    if not isinstance(document, dict):
        raise InvalidConfiguration(f"{path}: holds no mapping; give at least `workers:`")
    try:
        config = UpConfig.model_validate(document)
    except ValidationError as problem:
        raise InvalidConfiguration(f"{path}: {_explained(problem)}") from None
    if config.board is None and config.service is None:
        return config.model_copy(update={"service": ServiceConfig()})
    return config


def service_command(service: ServiceConfig, port: int | None = None) -> list[str]:
    """The command line of the board.

    Args:
        service: its settings.
        port: instead of the one of the settings; a restarted board keeps the address it had.
    """
    port = service.port if port is None else port
    command = [*_FLUENTBOARD, "serve", "--host", service.host, "--port", str(port)]
    command += ["--in-memory"] if service.in_memory else ["--data", str(service.data)]
    if service.config is not None:
        command += ["--config", str(service.config)]
    for file in service.ontologies:
        command += ["--ontology", str(file)]
    return command


def worker_command(worker: WorkerConfig, board: str) -> list[str]:
    """The command line of a worker.

    Args:
        worker: its settings.
        board: address of the board.
    """
    if worker.command is not None:
        words = [word.replace("{board}", board) for word in worker.command]
        return [*_FLUENTBOARD, *words[1:]] if words[0] == "fluentboard" else words
    assert worker.module is not None
    command = [*_FLUENTBOARD, "work", worker.module, "--board", board]
    command += ["--frames", source_of(worker, board)]
    for name, value in worker.options.items():
        flag = f"--{name.replace('_', '-')}"
        for entry in value if isinstance(value, tuple) else (value,):
            if entry is True:
                command.append(flag)
            elif entry is not False:
                command += [flag, str(entry).replace("{board}", board)]
    return command


def source_of(worker: WorkerConfig, board: str) -> str:
    """Where a worker's frames come from; empty for other programs."""
    return (worker.frames or "").replace("{board}", board)


# The same interpreter, so that the same installation is found whatever is on the path.
_FLUENTBOARD = (sys.executable, "-m", "fluentboard")


def _explained(problem: ValidationError) -> str:
    parts: list[str] = []
    for error in problem.errors(include_url=False):
        where = ".".join(str(part) for part in error["loc"]) or "the file"
        if error["type"] == "extra_forbidden":
            known = _keys_at(error["loc"][:-1])
            close = difflib.get_close_matches(str(error["loc"][-1]), known, n=1, cutoff=0.6)
            hint = f"did you mean {close[0]!r}?" if close else f"keys are {', '.join(known)}"
            parts.append(f"{where} is not a key; {hint}")
            continue
        message = error["msg"].removeprefix("Value error, ")
        shown = "" if isinstance(error["input"], Mapping) else f" is {error['input']!r}"
        parts.append(f"{where}{shown}: {message[0].lower()}{message[1:]}")
    return "; ".join(parts)


def _keys_at(place: tuple[int | str, ...]) -> list[str]:
    """The keys that may stand at a place of the file."""
    models: Mapping[str, type[Settings]] = {
        "service": ServiceConfig,
        "workers": WorkerConfig,
        "restart": RestartConfig,
        "state": StateConfig,
    }
    model = models[str(place[0])] if place else UpConfig
    return list(cast("Mapping[str, Any]", model.model_fields))
