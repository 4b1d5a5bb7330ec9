"""An import is stored as a whole or not at all, whatever is wrong with whichever part of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import orjson
import pytest

from fluentboard.api.app import BoardApp, create_app
from fluentboard.api.spool import Spool
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent
from fluentboard.config import load_settings
from fluentboard.errors import ShapeViolation
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Interval
from fluentboard.model.json_format import fluent_to_json
from fluentboard.model.yaml_format import fluent_to_yaml
from fluentboard_ontology import FLUENT, PREFIXES

SHAPES = """
@prefix sh: <http://www.w3.org/ns/shacl#> .
@prefix race: <https://w3id.org/fluentboard/race#> .
@prefix upper: <https://w3id.org/fluentboard/upper#> .
[] a sh:NodeShape ; sh:targetClass race:Mug ;
   sh:property [ sh:path upper:hasPose ; sh:minCount 1 ; sh:class upper:Pose ] .
"""
BATCH = 3


def mug(number: int, *, has_pose: bool = True) -> Fluent:
    poses = (Property("hasPose", "Pose", f"pose{number}"),) if has_pose else ()
    return Fluent(f"mug{number}", "Mug", Interval(1.0, 2.0), properties=poses)


def import_of(*, violates: bool) -> list[Fluent]:
    """Ten mugs and then their poses: what the first batch refers to stands in the last."""
    mugs = [mug(number, has_pose=not (violates and number == 9)) for number in range(10)]
    return mugs + [Fluent(f"pose{number}", "Pose", Interval(1.0, 2.0)) for number in range(10)]


def yaml_text(fluents: list[Fluent]) -> str:
    return "---\n".join(fluent_to_yaml(fluent) for fluent in fluents)


def json_lines(fluents: list[Fluent]) -> str:
    return "".join(orjson.dumps(fluent_to_json(f)).decode() + "\n" for f in fluents)


def turtle(fluents: list[Fluent]) -> str:
    prefixes = "".join(f"@prefix {name}: <{iri}> .\n" for name, iri in PREFIXES.items())
    lines = "".join(
        f"<{FLUENT}{f.name}> a {'race' if f.class_name == 'Mug' else 'upper'}:{f.class_name} .\n"
        + "".join(f"<{FLUENT}{f.name}> upper:hasPose <{FLUENT}{p.value}> .\n" for p in f.properties)
        for f in fluents
    )
    return prefixes + lines


FORMATS: dict[str, Callable[[list[Fluent]], str]] = {
    "application/yaml": yaml_text,
    "application/x-ndjson": json_lines,
    "text/turtle": turtle,
}


@pytest.fixture
def board(tmp_path: Path) -> Iterator[Blackboard]:
    (tmp_path / "shapes.ttl").write_text(SHAPES)
    with Blackboard.open(None, shapes=[tmp_path / "shapes.ttl"]) as opened:
        yield opened


@pytest.fixture
def api(board: Blackboard, client_of: Callable[[BoardApp], httpx.Client]) -> httpx.Client:
    return client_of(create_app(board, load_settings(flags={"limits.import_batch": BATCH})))


def send(api: httpx.Client, text: str, media_type: str, target: str = "/import") -> httpx.Response:
    return api.post(target, content=text, headers={"Content-Type": media_type})


@pytest.mark.parametrize("media_type", FORMATS)
def test_a_violation_in_a_late_batch_leaves_nothing_behind(
    api: httpx.Client, board: Blackboard, media_type: str
) -> None:
    before = board.commit
    reply = send(api, FORMATS[media_type](import_of(violates=True)), media_type)
    assert (reply.status_code, reply.json()["code"]) == (422, "shape-violation")
    assert reply.json()["violations"][0]["fluent"] == "mug9"
    assert (board.commit, len(board)) == (before, 0)


@pytest.mark.parametrize("media_type", FORMATS)
def test_what_a_batch_refers_to_may_come_in_a_later_one(
    api: httpx.Client, board: Blackboard, media_type: str
) -> None:
    reply = send(api, FORMATS[media_type](import_of(violates=False)), media_type)
    assert reply.status_code == 200
    assert (reply.json()["commits"], len(board)) == (7, 20)


def test_what_stands_in_a_graph_goes_with_the_fluents(api: httpx.Client, board: Blackboard) -> None:
    text = turtle(import_of(violates=True)) + "<urn:a> <urn:b> <urn:c> .\n"
    assert send(api, text, "text/turtle", "/import?graph=urn:g").status_code == 422
    assert board.named_graphs() == []


@pytest.mark.parametrize(
    ("end", "media_type", "code"),
    [
        ("---\n!Fluent\nClass_Instance: [Mug, m\n", "application/yaml", "invalid-yaml"),
        ('{"name": "m", "class": ', "application/x-ndjson", "invalid-input"),
        (
            '{"name": "m", "class": "Mug", "properties": [["hasStartEarliest", "xsd:double", 1]]}',
            "application/x-ndjson",
            "invalid-name",
        ),
        ("<urn:a> <urn:b> ", "text/turtle", "invalid-rdf"),
    ],
)
def test_a_wrong_end_leaves_nothing_behind(
    api: httpx.Client, board: Blackboard, end: str, media_type: str, code: str
) -> None:
    before = board.commit
    reply = send(api, FORMATS[media_type](import_of(violates=False)) + end, media_type)
    assert reply.json()["code"] == code
    assert (board.commit, len(board)) == (before, 0)


def test_a_batch_is_looked_at_again_after_somebody_else_has_written(board: Blackboard) -> None:
    with Spool(board) as spool:
        for number in range(2):
            spool.add(Fluent(f"pose{number}", "Pose"))
            spool.add(mug(number))
        whole = spool.check_shapes(BATCH)
        assert whole is not None
        commands = [AssertFluent(Fluent("mug7", "Mug"), merge=True)]
        # As long as nobody has written, the whole is known to meet the shapes.
        board.submit(commands, "import", whole=whole).result()
        commands = [AssertFluent(Fluent("mug8", "Mug"), merge=True)]
        refused = board.submit(commands, "import", whole=whole)
        with pytest.raises(ShapeViolation):
            refused.result()
        # What is still to come counts then, too.
        board.submit([AssertFluent(mug(0), merge=True)], "import", whole=whole).result()
    assert "mug0" in board
    assert "pose0" not in board
