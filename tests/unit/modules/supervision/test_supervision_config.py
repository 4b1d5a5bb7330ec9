"""What `fluentboard up` reads: defaults, command lines, and every mistake named."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from fluentboard.errors import InvalidConfiguration
from fluentboard_modules.supervision.config import (
    UpConfig,
    load_config,
    service_command,
    source_of,
    worker_command,
)

OURS = [sys.executable, "-m", "fluentboard"]


@pytest.fixture
def loaded(tmp_path: Path) -> Any:
    def load(text: str) -> UpConfig:
        (tmp_path / "up.yaml").write_text(text)
        return load_config(tmp_path / "up.yaml")

    return load


def test_board_alone_needs_no_setting(loaded: Any) -> None:
    config = loaded("workers: {}")
    assert service_command(config.service) == [
        *OURS,
        *("serve", "--host", "127.0.0.1", "--port", "8080", "--data", "fluentboard-data"),
    ]


def test_service_settings_become_flags(loaded: Any) -> None:
    config = loaded(
        "service: {host: 0.0.0.0, port: 0, in_memory: true, config: board.yaml, "
        "ontologies: [tools.ttl, rooms.ttl]}"
    )
    assert service_command(config.service, port=4711)[3:] == [
        *("serve", "--host", "0.0.0.0", "--port", "4711", "--in-memory"),
        *("--config", "board.yaml", "--ontology", "tools.ttl", "--ontology", "rooms.ttl"),
    ]


def test_module_becomes_a_command_line(loaded: Any) -> None:
    config = loaded(
        """
        workers:
          tables:
            module: mapping
            frames: "{board}/frames/head"
            options: {plot: out, frame_out: T.json, verbose: true, quiet: false, seed: 7}
        """
    )
    worker = config.workers["tables"]
    assert source_of(worker, "http://b:1") == "http://b:1/frames/head"
    assert worker_command(worker, "http://b:1") == [
        *OURS,
        *("work", "mapping", "--board", "http://b:1", "--frames", "http://b:1/frames/head"),
        *("--plot", "out", "--frame-out", "T.json", "--verbose", "--seed", "7"),
    ]


def test_option_with_several_values_is_repeated(loaded: Any) -> None:
    config = loaded(
        "workers: {a: {module: search, frames: sim:room, options: {target: [Mug, Jug]}}}"
    )
    command = worker_command(config.workers["a"], "http://b")
    assert command[-4:] == ["--target", "Mug", "--target", "Jug"]


def test_any_program_may_be_a_worker(loaded: Any) -> None:
    config = loaded('workers: {a: {command: [./drive.py, "--to={board}"]}}')
    assert worker_command(config.workers["a"], "http://b") == ["./drive.py", "--to=http://b"]


def test_fluentboard_among_programs_is_this_installation(loaded: Any) -> None:
    config = loaded("workers: {a: {command: [fluentboard, watch, ASK]}}")
    assert worker_command(config.workers["a"], "http://b") == [*OURS, "watch", "ASK"]


def test_board_that_runs_already_is_not_started(loaded: Any) -> None:
    assert loaded("board: http://robot:8080").service is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("wrokers: {}", "wrokers is not a key; did you mean 'workers'?"),
        ("service: {prot: 8080}", "service.prot is not a key; did you mean 'port'?"),
        (
            "workers: {a: {module: mapping, frames: x, colour: red}}",
            "workers.a.colour is not a key; keys are module, frames, options",
        ),
        ("restart: {first_wait_s: 0}", "restart.first_wait_s is 0: input should be greater than 0"),
        ("workers: {a: {module: mapping}}", "workers.a: a module needs frames"),
        ("workers: {a: {frames: x}}", "workers.a: give either module or command"),
        ("workers: {a: {module: m, command: [x]}}", "workers.a: give either module or command"),
        ("workers: {a: {command: []}}", "workers.a: the command is empty"),
        ("workers: {a: {command: [x], frames: y}}", "write them into command"),
        ("workers: {a: {command: [x], restart: sometimes}}", "workers.a.restart is 'sometimes'"),
        ("workers: {1a: {command: [x]}}", "worker name '1a': begin with a letter"),
        ("{board: 'http://b', service: {}}", "give either board or service"),
        ("[]", "holds no mapping"),
        ("{", "is not YAML"),
    ],
)
def test_mistake_is_named_with_what_to_do(text: str, message: str, loaded: Any) -> None:
    with pytest.raises(InvalidConfiguration) as caught:
        loaded(text)
    assert message in caught.value.message
    assert "up.yaml" in caught.value.message


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidConfiguration, match=r"none\.yaml: cannot be read \(No such file"):
        load_config(tmp_path / "none.yaml")


def test_example_of_the_reference_is_valid(tmp_path: Path) -> None:
    page = Path(__file__).parents[4] / "docs" / "reference" / "supervision.md"
    example = page.read_text().split("```yaml\n")[1].split("```")[0]
    (tmp_path / "up.yaml").write_text(example)
    config = load_config(tmp_path / "up.yaml")
    # It shows every key there is, with its default where it has one.
    shown = yaml.safe_load(example)
    assert shown["restart"] == config.restart.model_dump()
    assert shown["state"] == UpConfig().state.model_dump()
    for section in (config, config.service):
        assert section is not None
        names = set(type(section).model_fields) - {"board"}
        assert names <= set(shown) | set(shown["service"])
