"""docs/reference/time.md says what the code does: functions, relations, and examples that run."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path
from typing import Any

import pytest

from fluentboard.board.time_functions import FUNCTIONS
from fluentboard.model.relations import ALLEN, Relation

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "time.md"


@pytest.fixture(scope="module")
def page() -> str:
    return PAGE.read_text(encoding="utf-8")


def test_the_examples_print_what_the_page_says(page: str) -> None:
    blocks = re.findall(r"^```(python|text)\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    names: dict[str, Any] = {}
    printed = ""
    for language, text in blocks:
        if language == "python":
            assert printed == "", f"the page does not show what was printed: {printed}"
            out = io.StringIO()
            with contextlib.redirect_stdout(out):
                exec(compile(text, str(PAGE), "exec"), names)
            printed = out.getvalue()
        elif printed:
            assert printed == text
            printed = ""
    assert printed == ""
    # The functions of the page refer to its names and so to themselves; a result among the names
    # must not be left to the garbage collector, which may run in a thread that did not make it.
    names.clear()


def test_every_function_is_in_the_table(page: str) -> None:
    rows = [line for line in page.splitlines() if line.startswith("| `fb:")]
    listed = [name for row in rows for name in re.findall(r"fb:(\w+)", row.split("|")[1])]
    assert sorted(listed) == sorted(FUNCTIONS)


def test_every_relation_is_explained_and_drawn(page: str) -> None:
    rows = re.findall(r"^\| `([\w-]+)` \| .* \| `([\w-]+)` \|(.*)\|$", page, re.MULTILINE)
    explained = {Relation(name): (Relation(inverse), owl) for name, inverse, owl in rows}
    assert {*explained, *(inverse for inverse, _ in explained.values())} == set(Relation)
    for relation, (inverse, owl_time) in explained.items():
        assert relation.inverse is inverse
        assert owl_time.strip("` ") == (relation.owl_time or "")
    for relation in ALLEN:
        assert re.search(rf"^   .*\b{relation.value}  +.*A", page, re.MULTILINE)
