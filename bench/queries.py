"""Queries in process: a point query, the thesis's anchoring query, and what holds at a time."""

from __future__ import annotations

import itertools
import random
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

import pyoxigraph as ox
import rdflib

from bench.measuring import Report, compare
from bench.workload import ANCHORING_QUERY, fluents, ntriples, vocabulary
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent
from fluentboard.board.intervals import FluentFilter
from fluentboard.board.projections import Projections
from fluentboard_ontology import ONTOLOGIES, PREFIXES, read

FLUENTS = 100_000
AS_OF_FLUENTS = 1_000_000


def run() -> list[Report]:
    """All three measurements."""
    folder = Path(tempfile.mkdtemp(prefix="fluentboard-bench-"))
    board = Blackboard.open(folder / "board", durability="process")
    try:
        _fill(board, FLUENTS)
        reports = [_point(board), _anchoring(board), _holding(board)]
    finally:
        board.close()
        shutil.rmtree(folder, ignore_errors=True)
    return [*reports, _as_of()]


def _fill(board: Blackboard, count: int) -> None:
    made = fluents(count)
    while batch := [AssertFluent(f) for f in itertools.islice(made, 5_000)]:
        board.execute(batch, "bench")


def _rows(results: object) -> int:
    assert isinstance(results, ox.QuerySolutions)
    return sum(1 for _ in results)


def _rdflib_graph(count: int, store: str = "default") -> rdflib.Graph:
    graph = rdflib.Graph(store=store)
    graph.parse(data=ntriples(fluents(count), vocabulary()), format="nt")
    for name in ONTOLOGIES:
        graph.parse(data=read(name), format="turtle")
    return graph


def _point(board: Blackboard) -> Report:
    rng = random.Random(5)
    graph, oxrdflib = _rdflib_graph(20_000), _rdflib_graph(20_000, "Oxigraph")

    def query() -> str:
        return f"SELECT ?p ?o {{ fluent:o{rng.randrange(5_000)}_pose ?p ?o }}"

    def ours() -> None:
        for _ in range(100):
            assert _rows(board.query(query())) == 9

    def in_rdflib() -> None:
        for _ in range(100):
            assert len(list(graph.query(query(), initNs=dict(PREFIXES)))) == 9

    def in_oxrdflib() -> None:
        for _ in range(100):
            assert len(list(oxrdflib.query(query(), initNs=dict(PREFIXES)))) == 9

    return compare(
        "Point query, in process",
        {
            "fluentboard, 100,000 fluents": ours,
            "rdflib, 20,000 fluents": in_rdflib,
            "oxrdflib, 20,000 fluents": in_oxrdflib,
        },
        rounds=7,
        operations=100,
        unit="us",
    )


def _anchoring(board: Blackboard) -> Report:
    projections: Projections = board._projections  # the literal evaluation is not public
    expected = _rows(board.query(ANCHORING_QUERY))

    def ours() -> None:
        assert _rows(board.query(ANCHORING_QUERY)) == expected

    def literal() -> None:
        assert _rows(projections.store.query(ANCHORING_QUERY)) == expected

    report = compare(
        "The anchoring query of Section 4.2.4 at 100,000 fluents",
        {"fluentboard": ours, "Oxigraph, literal evaluation of the class paths": literal},
        rounds=5,
        unit="ms",
        target="under 0.5 s, and at least 100 times the literal evaluation",
        notes=[f"{expected:,} rows.", MISSED],
    )
    graph = _rdflib_graph(4_000)

    def in_rdflib() -> None:
        graph.query(ANCHORING_QUERY, initNs=dict(PREFIXES)).bindings  # noqa: B018

    oxrdflib = _rdflib_graph(4_000, "Oxigraph")

    def in_oxrdflib() -> None:
        list(oxrdflib.query(ANCHORING_QUERY, initNs=dict(PREFIXES)))

    slow = compare("", {"rdflib": in_rdflib, "oxrdflib": in_oxrdflib}, rounds=1, unit="ms")
    report.notes.append(
        f"At 4,000 fluents rdflib needs {slow.medians['rdflib']:,.0f} ms and oxrdflib "
        f"{slow.medians['oxrdflib']:,.0f} ms."
    )
    return report


MISSED = (
    "The hundredfold is missed against today's engine: its own plan for the literal paths takes "
    "about 21 us per bounding box, not the 1.2 ms (30 s in all) that were measured when the target "
    "was set. What is left is the engine's cost of finding and handing out rows, 8 us each; to "
    "scan the bounding boxes alone takes 40 % of it. Other orders of the patterns, one class path "
    "at a time, and EXISTS filters were tried, and are no faster."
)

HOLDING_QUERY = """\
SELECT ?f WHERE {
  ?f upper:hasStartEarliest ?s ; upper:hasFinishLatest ?e .
  FILTER(?s <= 2000.0e0 && ?e > 2000.0e0)
} LIMIT 100
"""


def _holding(board: Blackboard) -> Report:
    """The first hundred fluents that may hold at a time; the peers filter the end points."""
    graph, oxrdflib = _rdflib_graph(20_000), _rdflib_graph(20_000, "Oxigraph")
    projections: Projections = board._projections

    def ours() -> None:
        assert len(board.list(FluentFilter(at_s=2000.0), limit=100).fluents) == 100

    def engine() -> None:
        assert _rows(projections.store.query(HOLDING_QUERY)) == 100

    def peer(peer_graph: rdflib.Graph) -> Callable[[], None]:
        return lambda: assert_rows(list(peer_graph.query(HOLDING_QUERY, initNs=dict(PREFIXES))))

    def assert_rows(rows: list[object]) -> None:
        assert len(rows) == 100

    return compare(
        "What holds at a time, the first 100",
        {
            "fluentboard, 100,000 fluents": ours,
            "Oxigraph, filter on the end points, 100,000 fluents": engine,
            "rdflib, filter on the end points, 20,000 fluents": peer(graph),
            "oxrdflib, filter on the end points, 20,000 fluents": peer(oxrdflib),
        },
        rounds=5,
        unit="ms",
    )


def _as_of() -> Report:
    board = Blackboard.open(None, durability="process")
    index = board._projections.index  # filled directly: a million commits would take minutes
    rng = random.Random(3)
    for number in range(AS_OF_FLUENTS):
        seen = 1000.0 + number * 0.01
        lasts = float("inf") if number % 10 == 0 else seen + rng.uniform(0.1, 20.0)
        index.put_outline(f"f{number}", "Pose", (seen, seen, lasts, lasts), number + 1)
    at = 1000.0 + AS_OF_FLUENTS * 0.005

    def ours() -> None:
        rows = index.rows(FluentFilter(at_s=at), lambda _name: True)
        [index.name(row) for row in rows[:100].tolist()]

    report = compare(
        "What holds at a time, among 1,000,000 fluents (first 100 of them)",
        {"fluentboard": ours},
        rounds=9,
        unit="ms",
        target="at most 50 ms",
    )
    board.close()
    return report
