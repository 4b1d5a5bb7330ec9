"""Writes docs/reference/cli.md from what the commands say themselves.

    .venv/bin/python docs/write_cli_reference.py

A test compares the file with the commands, so it cannot grow stale.
"""

from __future__ import annotations

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

REFERENCE = Path(__file__).parent / "reference" / "cli.md"

COMMANDS = (
    "",
    "serve",
    "import",
    "export",
    "query",
    "watch",
    "work",
    "work mapping",
    "evaluate",
    "evaluate mapping",
    "frames",
    "frames info",
    "frames view",
    "frames record",
    "frames publish",
    "up",
    "demo",
)
"""All commands, in the order of the page; the empty one is `fluentboard` itself."""

_INTRODUCTION = """\
# Command line

What `fluentboard COMMAND --help` says, written by `docs/write_cli_reference.py`.

| exit code | means |
| --- | --- |
| 0 | done; a worker that was asked to stop has written what it knew |
| 1 | an error, told in one line `code: what happened and what to do` on standard error |
| 2 | the command was used in a way it does not understand |
"""


def help_text(command: str) -> str:
    """What a command says about itself, 88 characters wide and without colours."""
    environment = {
        **{key: value for key, value in os.environ.items() if not key.startswith("FLUENTBOARD_")},
        "TERMINAL_WIDTH": "88",
        "COLUMNS": "88",
        "NO_COLOR": "1",
        "TERM": "dumb",
    }
    shown = subprocess.run(
        [sys.executable, "-m", "fluentboard", *command.split(), "--help"],
        capture_output=True,
        text=True,
        env=environment,
        check=True,
    )
    lines = [line.rstrip() for line in shown.stdout.splitlines()]
    return "\n".join(lines).strip("\n")


def page() -> str:
    """The whole page."""
    with ThreadPoolExecutor(2) as threads:
        texts = list(threads.map(help_text, COMMANDS))
    sections = [
        f"## `{' '.join(['fluentboard', *command.split()])}`\n\n```text\n{text}\n```\n"
        for command, text in zip(COMMANDS, texts, strict=True)
    ]
    return "\n".join([_INTRODUCTION, *sections])


if __name__ == "__main__":
    REFERENCE.write_text(page(), encoding="utf-8")
