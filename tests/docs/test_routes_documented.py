"""Every route, parameter, metric and message has its place in the reference; nothing else has."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import orjson
import pytest

from fluentboard.api.app import BoardApp, create_app
from fluentboard.api.operations import Operation
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.subscriptions import messages
from fluentboard.config import Settings

REFERENCE = Path(__file__).parents[2] / "docs" / "reference"
HTTP = (REFERENCE / "http.md").read_text() + (REFERENCE / "graphs.md").read_text()
LIVE = (REFERENCE / "live.md").read_text()


@pytest.fixture(scope="module")
def app() -> Iterator[BoardApp]:
    with Blackboard.open(None, builtin_ontologies=False) as board:
        yield create_app(board, Settings())


def sections() -> dict[str, str]:
    """Text of the section of every route."""
    parts = re.split(r"^#{2,3} `?(.*?)`?$", HTTP, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def parameters(operation: Operation) -> set[str]:
    return {p.name for p in operation.parameters if p.place == "query"}


def test_every_route_has_a_section_and_every_section_a_route(app: BoardApp) -> None:
    routes = {f"{operation.method} {operation.path}" for operation in app.operations}
    assert {title for title in sections() if title.split()[0].isupper()} - {"SPARQL"} == routes


def test_every_parameter_is_in_the_section_of_its_route(app: BoardApp) -> None:
    for operation in app.operations:
        text = sections()[f"{operation.method} {operation.path}"]
        in_table = set(re.findall(r"^\| `([\w-]+)` \|", text, re.MULTILINE))
        named = set(re.findall(r"`([\w-]+)`", text))
        assert parameters(operation) <= named, operation.path
        assert in_table <= parameters(operation) or operation.path == "/metrics", operation.path


def test_every_route_says_which_role_it_needs(app: BoardApp) -> None:
    for operation in app.operations:
        text = sections()[f"{operation.method} {operation.path}"]
        expected = "Needs no token" if operation.role is None else f"Role: {operation.role}"
        assert expected in text, operation.path


def test_every_media_type_is_named(app: BoardApp) -> None:
    for operation in app.operations:
        contents = [*operation.body, *(t for a in operation.answers.values() for t in a.content)]
        missing = [t for t in contents if t not in HTTP and not t.startswith("text/")]
        assert not missing, operation.path


def test_every_metric_is_named(app: BoardApp) -> None:
    documented = set(re.findall(r"^\| `(fluentboard_\w+)", HTTP, re.MULTILINE))
    served = {
        family.name + ("_total" if family.type == "counter" else "")
        for family in app.metrics.collect()
    }
    assert {name.removesuffix("_info") for name in documented} == {
        name.removesuffix("_info") for name in served
    }


@pytest.mark.parametrize("page", [HTTP, LIVE], ids=["http.md", "live.md"])
def test_every_json_example_is_json(page: str) -> None:
    examples = re.findall(r"```json\n(.*?)```", page, re.DOTALL)
    assert examples
    for example in examples:
        orjson.loads(example)


def test_every_message_of_a_live_query_has_a_section() -> None:
    told = set(re.findall(r"^### (\w+)$", LIVE, re.MULTILINE))
    kinds = {
        kind.__name__.lower()
        for kind in (
            messages.Snapshot,
            messages.Delta,
            messages.Resumed,
            messages.Gap,
            messages.Lagged,
            messages.Live,
        )
    }
    assert told == {*kinds, "acknowledged", "unsubscribed", "error"}
