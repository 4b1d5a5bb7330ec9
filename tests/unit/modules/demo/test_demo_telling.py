"""How the demo words what a subscriber hears."""

from __future__ import annotations

from fluentboard_client import Delta, Iri, Row
from fluentboard_modules.demo.telling import delta_lines


def a_row(name: str, x: float, y: float) -> Row:
    iri = Iri(f"https://example.org/fluent/{name}")
    return {"thing": iri, "class": Iri("https://example.org#Chair"), "x": x, "y": y}


def told(delta: Delta) -> list[str]:
    return [" ".join(line.plain.split()) for line in delta_lines(delta)]


def test_new_thing_is_told_with_class_and_place() -> None:
    delta = Delta(7, 6, added=(a_row("chair1", 1.0, 2.5),))
    assert told(delta) == ["commit 7 + chair1 a Chair at (1.00, 2.50)"]


def test_moved_thing_is_told_once() -> None:
    delta = Delta(7, 6, (a_row("chair1", 3.0, 2.5),), (a_row("chair1", 1.0, 2.5),))
    assert told(delta) == ["commit 7 ~ chair1 (1.00, 2.50) → (3.00, 2.50)"]


def test_revised_box_is_told_where_the_place_is_the_same() -> None:
    delta = Delta(7, 6, (a_row("chair1", 1.001, 2.5),), (a_row("chair1", 1.0, 2.5),))
    assert told(delta) == ["commit 7 ~ chair1 (1.00, 2.50), box revised"]


def test_thing_that_went_is_told() -> None:
    assert told(Delta(7, 6, removed=(a_row("chair1", 1.0, 2.5),))) == ["commit 7 - chair1"]
