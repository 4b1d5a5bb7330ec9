"""Writes docs/reference/cli.md from what the commands say themselves.

    .venv/bin/python docs/write_cli_reference.py

A test compares the file with the commands, so it cannot grow stale.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

REFERENCE = Path(__file__).parent / "reference" / "cli.md"

_INTRODUCTION = """\
# Command line

What `fluentboard COMMAND --help` says, written by `docs/write_cli_reference.py`.

| exit code | means |
| --- | --- |
| 0 | done; a worker that was asked to stop has written what it knew |
| 1 | an error, told in one line `code: what happened and what to do` on standard error |
| 2 | the command was used in a way it does not understand |
"""


def help_texts() -> dict[str, str]:
    """What every command says about itself, 88 characters wide and without colours.

    Keys are the words after `fluentboard`, in the order in which the commands list themselves. They
    are asked in one process of their own, whose environment and width are always the same.
    """
    environment = {
        **{key: value for key, value in os.environ.items() if not key.startswith("FLUENTBOARD_")},
        "TERMINAL_WIDTH": "88",
        "COLUMNS": "88",
        "NO_COLOR": "1",
        "TERM": "dumb",
    }
    shown = subprocess.run(
        [sys.executable, __file__, "--as-json"],
        capture_output=True,
        text=True,
        env=environment,
        check=True,
    )
    texts: dict[str, str] = json.loads(shown.stdout)
    return texts


def page(texts: dict[str, str]) -> str:
    """The whole page."""
    sections = [
        f"## `{' '.join(['fluentboard', *command.split()])}`\n\n```text\n{text}\n```\n"
        for command, text in texts.items()
    ]
    return "\n".join([_INTRODUCTION, *sections])


def _asked_here() -> dict[str, str]:
    import typer.main
    from click.testing import CliRunner

    from fluentboard.cli import create_app

    root = typer.main.get_command(create_app())
    texts: dict[str, str] = {}
    waiting = [("", root)]
    while waiting:
        words, command = waiting.pop(0)
        said = CliRunner().invoke(root, [*words.split(), "--help"], prog_name="fluentboard")
        lines = [line.rstrip() for line in said.stdout.splitlines()]
        texts[words] = "\n".join(lines).strip("\n")
        inner = getattr(command, "commands", {})
        waiting[:0] = [(f"{words} {name}".strip(), inner[name]) for name in inner]
    return texts


if __name__ == "__main__":
    if "--as-json" in sys.argv:
        print(json.dumps(_asked_here()))
    else:
        REFERENCE.write_text(page(help_texts()), encoding="utf-8")
