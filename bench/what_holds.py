"""Time: listings at a commit, and queries on what holds now."""

from __future__ import annotations

import itertools
import random
from typing import Literal

import pyoxigraph as ox

from bench.measuring import Report, compare
from bench.workload import fluents
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent
from fluentboard.board.intervals import FluentFilter, IntervalIndex
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Interval
from fluentboard.model.relations import Relation, window

LISTED = 1_000_000
VIEWED = 20_000
WRITES = 50


def run() -> list[Report]:
    """All measurements."""
    return [_listing(), *_views()]


def _listing() -> Report:
    """Every fluent was open, and was ended later: the worst case for an earlier belief."""
    index, rng = IntervalIndex(), random.Random(3)
    infinite = float("inf")
    for number in range(LISTED):
        seen = 1000.0 + number * 0.01
        index.put_outline(f"f{number}", "Pose", (seen, seen, infinite, infinite), number + 1)
    for number in range(LISTED):
        seen = 1000.0 + number * 0.01
        ends = seen + rng.uniform(0.1, 20.0)
        bounds = (seen, seen, ends, ends + 1.0)
        index.put_outline(f"f{number}", "Pose", bounds, LISTED + number + 1)
    at = 1000.0 + LISTED * 0.005

    def first_page(wanted: FluentFilter) -> list[str]:
        rows = index.rows(wanted, lambda _name: True)
        return [index.name(row) for row in rows[:100].tolist()]

    during = (Relation.DURING, window(at, at + 100.0))
    return compare(
        "What held at a time, as believed at a commit, among 1,000,000 fluents (first 100)",
        {
            "before all of them were ended": lambda: _nothing(
                first_page(FluentFilter(at_s=at, as_of=LISTED))
            ),
            "before half of them were ended": lambda: _nothing(
                first_page(FluentFilter(at_s=at, as_of=LISTED + LISTED // 2))
            ),
            "as believed now": lambda: _nothing(first_page(FluentFilter(at_s=at))),
            "during a window, as believed now": lambda: _nothing(
                first_page(FluentFilter(relation=during))
            ),
        },
        rounds=9,
        unit="ms",
        target="at most 50 ms",
    )


def _views() -> list[Report]:
    asked_for_now, never_asked = _filled_board(), _filled_board()
    try:
        build = compare(
            f"The first query on what holds now ({VIEWED:,} fluents)",
            {"fluentboard": lambda: _nothing(asked_for_now.query("ASK {}", at="now"))},
            rounds=1,
            operations=VIEWED,
            unit="us",
            notes=["Per fluent. From then on only what has changed counts."],
        )
        asked = compare(
            "A write and a query after it",
            {
                "at=now": lambda: _write(asked_for_now, is_asked=True, at="now"),
                "all of history": lambda: _write(asked_for_now, is_asked=True),
            },
            rounds=15,
            operations=WRITES,
            unit="us",
        )
        watched = compare(
            "Writes while `now` is in use",
            {
                "somebody has asked for now": lambda: _write(asked_for_now),
                "nobody has": lambda: _write(never_asked),
            },
            rounds=15,
            operations=WRITES,
            unit="us",
            target="no dearer",
        )
    finally:
        asked_for_now.close()
        never_asked.close()
    return [build, asked, watched]


def _filled_board() -> Blackboard:
    board = Blackboard.open(None, durability="process")
    made = fluents(VIEWED)
    while batch := [AssertFluent(fluent) for fluent in itertools.islice(made, 5_000)]:
        board.execute(batch, "bench")
    _nothing(board.query("ASK {}"))
    return board


def _write(board: Blackboard, *, is_asked: bool = False, at: Literal["now"] | None = None) -> None:
    """Writes, and asks after each write or once at the end."""
    for number in range(WRITES):
        pose = (Property("hasX", "xsd:float", 1.0),)
        seen = Interval.at(board.clock.now_s())
        board.execute([AssertFluent(Fluent(f"s{len(board)}", "Pose", seen, Interval(), pose))], "b")
        if is_asked or number == WRITES - 1:
            results = board.query("SELECT ?x { fluent:s0 upper:hasX ?x }", at=at)
            assert isinstance(results, ox.QuerySolutions)
            _nothing(list(results))


def _nothing(_: object) -> None:
    """Drops a result, so that only the time counts."""
