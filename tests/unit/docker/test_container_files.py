"""The container files name things that exist."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
import typer.main
import yaml

from fluentboard.cli import create_app

CHECKOUT = Path(__file__).resolve().parents[3]
DOCKERFILE = (CHECKOUT / "docker" / "Dockerfile").read_text(encoding="utf-8")


def compose() -> dict[str, Any]:
    return yaml.safe_load((CHECKOUT / "docker" / "compose.yaml").read_text(encoding="utf-8"))


def instructions(name: str) -> list[str]:
    joined = DOCKERFILE.replace("\\\n", " ")
    return re.findall(rf"^{name}\s+(.+)$", joined, re.MULTILINE)


def options_of(command: list[str]) -> tuple[Any, list[str]]:
    """The command object that the words name, and the options among them."""
    found: Any = typer.main.get_command(create_app())
    for word in command:
        if word.startswith("-") or not hasattr(found, "commands"):
            break
        assert word in found.commands, f"fluentboard has no command {word!r}"
        found = found.commands[word]
    return found, [word for word in command if word.startswith("--")]


def commands() -> list[list[str]]:
    (served,) = instructions("CMD")[-1:]
    found = [json.loads(served)]
    found += [s["command"] for s in compose()["services"].values() if "command" in s]
    return found


def test_everything_copied_into_the_image_exists() -> None:
    for line in instructions("COPY"):
        *sources, _ = line.split()
        for source in sources:
            assert (CHECKOUT / source).exists(), source


def test_image_starts_the_command_line_of_the_distribution() -> None:
    (entry,) = instructions("ENTRYPOINT")
    assert json.loads(entry) == ["fluentboard"]


@pytest.mark.parametrize("command", commands(), ids=lambda command: command[0])
def test_commands_and_their_options_exist(command: list[str]) -> None:
    found, options = options_of(command)
    known = {name for parameter in found.params for name in parameter.opts}
    assert set(options) <= known


def test_services_build_from_the_dockerfile_and_share_a_token() -> None:
    for service in compose()["services"].values():
        folder = CHECKOUT / "docker" / service["build"]["context"]
        assert (folder / service["build"]["dockerfile"]).is_file()
        assert "FLUENTBOARD_TOKEN" in service["environment"]


def test_system_packages_are_one_name_per_line() -> None:
    lines = (CHECKOUT / "docker" / "system-packages.txt").read_text(encoding="utf-8").splitlines()
    assert lines == sorted(lines)
    assert all(re.fullmatch(r"[a-z0-9][a-z0-9.+-]+", line) for line in lines)
