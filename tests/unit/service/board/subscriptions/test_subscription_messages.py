"""The JSON of each message."""

from __future__ import annotations

import pyoxigraph as ox

from fluentboard.board.events import FluentAdded
from fluentboard.board.subscriptions.messages import (
    Answer,
    Change,
    Delta,
    Failed,
    Gap,
    Lagged,
    Resumed,
    Snapshot,
)
from fluentboard.board.subscriptions.results import NO_DIFFERENCE, Difference
from fluentboard.errors import InvalidQuery
from fluentboard.model.fluent import Fluent
from fluentboard.model.json_format import fluent_to_json

A = ox.Literal("a")
BINDING = {"x": {"type": "literal", "value": "a"}}
MUG = Fluent("mug1", "Mug")


def test_snapshot_holds_sparql_results() -> None:
    message = Snapshot(0, 7, Answer("select", ("x", "y"), {(A, None): 2}))
    assert message.to_json("m") == {
        "type": "snapshot",
        "id": "m",
        "sequence": 0,
        "commit": 7,
        "result": {
            "head": {"vars": ["x", "y"]},
            "results": {"bindings": [BINDING, BINDING]},
        },
    }


def test_snapshot_of_ask_is_a_boolean() -> None:
    result = Snapshot(0, 7, Answer("ask", (), {(): 1})).to_json("m")["result"]
    assert result == {"head": {}, "boolean": True}


def test_delta_holds_what_its_mode_asks_for() -> None:
    change = Change(
        "select", ("x",), 7, 8, Difference({(A,): 1}, {}), ((8, FluentAdded(MUG)),), None
    )
    head = {"type": "delta", "id": "m", "sequence": 3, "commit": 8, "since": 7}
    bindings = {"added": [BINDING], "removed": []}
    events = {"events": [{"event": "added", "commit": 8, "fluent": fluent_to_json(MUG)}]}
    assert Delta(3, change, "bindings").to_json("m") == {**head, **bindings}
    assert Delta(3, change, "fluents").to_json("m") == {**head, **events}
    assert Delta(3, change, "both").to_json("m") == {**head, **bindings, **events}


def test_delta_of_ask_is_the_new_boolean() -> None:
    change = Change("ask", (), 7, 8, Difference({(): 1}, {}), (), True)
    message = Delta(1, change, "bindings").to_json("m")
    assert (message["boolean"], message["added"], message["removed"]) == (True, [], [])


def test_other_messages_say_their_type_and_commit() -> None:
    assert Resumed(4).to_json("m") == {"type": "resumed", "id": "m", "commit": 4}
    assert Gap(2, 9).to_json("m") == {"type": "gap", "id": "m", "since": 2, "commit": 9}
    assert Lagged().to_json("m") == {"type": "lagged", "id": "m"}
    assert Failed(InvalidQuery("no")).to_json("m") == {
        "type": "error",
        "id": "m",
        "problem": {"code": "invalid-query", "message": "no"},
    }


def test_size_counts_solutions_and_events() -> None:
    change = Change("ask", (), 7, 8, NO_DIFFERENCE, ((8, FluentAdded(MUG)),), None)
    assert len(change) == 1


def test_a_failure_takes_no_traceback_along() -> None:
    try:
        try:
            raise ValueError("inner")
        except ValueError:
            raise InvalidQuery("outer") from None
    except InvalidQuery as problem:
        failed = Failed(problem)
    assert failed.problem.__traceback__ is None
    assert failed.problem.__context__ is not None
    assert failed.problem.__context__.__traceback__ is None
