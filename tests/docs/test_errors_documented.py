"""Every error code has its section in docs/errors.md, and its status; nothing else has."""

from __future__ import annotations

import importlib
import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path

import fluentboard
from fluentboard.errors import FluentboardError

# Errors that are defined beside their only user are known once that is imported.
for found in pkgutil.walk_packages(fluentboard.__path__, "fluentboard."):
    if not found.name.endswith("__main__"):
        importlib.import_module(found.name)

PAGE = Path(__file__).parents[2] / "docs" / "errors.md"


def all_errors(parent: type[FluentboardError]) -> Iterator[type[FluentboardError]]:
    yield parent
    for child in parent.__subclasses__():
        if child.__module__.startswith("fluentboard."):
            yield from all_errors(child)


def test_every_code_has_a_section_and_every_section_a_code() -> None:
    sections = re.findall(r"^### (\S+)$", PAGE.read_text(), re.MULTILINE)
    assert sorted(sections) == sorted({error.code for error in all_errors(FluentboardError)})


def test_the_table_tells_the_status_of_every_code() -> None:
    told = {
        code: int(status)
        for status, codes in re.findall(r"^\| (\d{3}) \| (.*) \|$", PAGE.read_text(), re.MULTILINE)
        for code in re.findall(r"\[([\w-]+)\]", codes)
    }
    assert told == {error.code: error.http_status for error in all_errors(FluentboardError)}
