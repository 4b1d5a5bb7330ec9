"""What a subscriber makes of the board's messages, and what it says when it comes back."""

from __future__ import annotations

import json
from typing import Any

import pytest

from fluentboard.errors import InvalidInput, InvalidQuery
from fluentboard.model.fluent import Fluent
from fluentboard.model.json_format import fluent_to_json
from fluentboard_client import Delta, Gap, Iri, Lagged, Snapshot
from fluentboard_client.conversation import Conversation, LiveQuery, Mode, live_address

TABLE = {"t": {"type": "uri", "value": "https://example.org/fluent/table1"}}
SNAPSHOT = {
    "type": "snapshot",
    "id": "1",
    "sequence": 0,
    "commit": 17,
    "result": {"head": {"vars": ["t", "h"]}, "results": {"bindings": [TABLE]}},
}


def talk(since: int | None = None, mode: Mode = "bindings") -> Conversation:
    return Conversation(LiveQuery("SELECT ?t {}", mode, since), "http://board")


def hear(conversation: Conversation, message: dict[str, Any]) -> Any:
    return conversation.hear(json.dumps(message))


def test_first_connection_asks_for_everything() -> None:
    assert json.loads(talk().opening()) == {
        "subscribe": {"id": "1", "query": "SELECT ?t {}", "mode": "bindings"}
    }


def test_next_connection_resumes_after_the_last_commit_heard_of() -> None:
    conversation = talk()
    hear(conversation, SNAPSHOT)
    hear(conversation, {"type": "delta", "commit": 21, "since": 17, "added": [], "removed": []})
    assert json.loads(conversation.opening())["subscribe"]["since"] == 21


def test_snapshot_has_every_variable_in_every_row() -> None:
    snapshot = hear(talk(), SNAPSHOT)
    assert snapshot == Snapshot(17, ({"t": Iri(TABLE["t"]["value"]), "h": None},))
    assert str(snapshot) == "commit 17: = t=table1 h=-"


def test_empty_snapshot_says_so() -> None:
    assert str(Snapshot(4)) == "commit 4: no rows"


def test_delta_reads_as_what_came_and_went() -> None:
    message = {"type": "delta", "commit": 18, "since": 17, "added": [TABLE, TABLE], "removed": []}
    delta = hear(talk(), message)
    assert isinstance(delta, Delta)
    assert len(delta.added) == 2
    assert str(delta) == "commit 18: + t=table1\ncommit 18: + t=table1"


def test_answer_of_an_ask_is_its_truth() -> None:
    result: dict[str, Any] = {"head": {}, "boolean": False}
    assert hear(talk(), {**SNAPSHOT, "result": result}) == Snapshot(17, (), False)
    message = {"type": "delta", "commit": 18, "since": 17, "boolean": True}
    delta = hear(talk(), {**message, "added": [], "removed": []})
    assert str(delta) == "commit 18: true"


def test_delta_may_carry_whole_fluents() -> None:
    ended = {"event": "ended", "commit": 19, "fluent": fluent_to_json(Fluent("mug1", "Mug"))}
    message = {"type": "delta", "commit": 19, "since": 18, "events": [ended]}
    delta = hear(talk(mode="fluents"), message)
    assert delta.fluents[0].fluent == Fluent("mug1", "Mug")
    assert str(delta) == "commit 19: ended mug1 (Mug)"


def test_gap_and_lag_are_told() -> None:
    assert hear(talk(17), {"type": "gap", "id": "1", "since": 17, "commit": 30}) == Gap(17, 30)
    assert hear(talk(), {"type": "lagged", "id": "1"}) == Lagged()


def test_resumption_and_unknown_messages_are_no_events() -> None:
    assert hear(talk(17), {"type": "resumed", "id": "1", "commit": 30}) is None
    assert hear(talk(), {"type": "weather", "id": "1"}) is None


def test_refusal_raises_the_error_it_names() -> None:
    problem = {"code": "invalid-query", "message": "no brace", "status": 400}
    with pytest.raises(InvalidQuery, match="no brace"):
        hear(talk(), {"type": "error", "id": "1", "problem": problem})


def test_unknown_mode_is_refused() -> None:
    with pytest.raises(InvalidInput, match="mode is 'all'"):
        talk(mode="all")  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    ("board", "live"),
    [
        ("http://127.0.0.1:8080", "ws://127.0.0.1:8080/subscriptions"),
        ("https://robot.example/memory", "wss://robot.example/memory/subscriptions"),
    ],
)
def test_live_address_follows_the_board_address(board: str, live: str) -> None:
    assert live_address(board) == live


def test_subscription_at_now_resumes_with_commit_and_time() -> None:
    talk = Conversation(LiveQuery("SELECT ?t {}", "bindings", None, {"at": "now"}), "http://board")
    assert json.loads(talk.opening())["subscribe"]["at"] == "now"
    result: dict[str, Any] = {"head": {"vars": []}, "results": {"bindings": []}}
    message = {"type": "snapshot", "id": "1", "sequence": 0, "commit": 4, "at": 9.5}
    event = talk.hear(json.dumps({**message, "result": result}))
    assert isinstance(event, Snapshot)
    assert event.at_s == 9.5
    assert str(event) == "commit 4, at 9.500 s: no rows"
    again = json.loads(talk.opening())["subscribe"]
    assert (again["since"], again["since_at"]) == (4, 9.5)


def test_replay_that_broke_off_goes_on_live() -> None:
    options = {"replay": {"commit": 1, "speed": 2.0}}
    talk = Conversation(LiveQuery("SELECT ?t {}", "bindings", None, options), "http://board")
    assert json.loads(talk.opening())["subscribe"]["replay"] == options["replay"]
    talk.commit = 7
    assert "replay" not in json.loads(talk.opening())["subscribe"]


def test_durable_subscription_is_asked_for_by_name() -> None:
    talk = Conversation(LiveQuery("", "bindings", None, {"durable": "mugs"}), "http://board")
    assert json.loads(talk.opening()) == {"subscribe": {"id": "1", "durable": "mugs"}}
