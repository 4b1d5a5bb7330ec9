"""A board of a million fluents on disk: what held at a time, as believed at a commit.

To build the board takes some minutes. `FLUENTBOARD_BENCH_BOARD=DIR` keeps it for the next time.
"""

from __future__ import annotations

import itertools
import os
import random
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from bench.measuring import Report, compare
from bench.workload import fluents
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent, EndFluent
from fluentboard.board.intervals import FluentFilter
from fluentboard.model.interval import Interval
from fluentboard.model.relations import Relation, window

FLUENTS = 1_000_000
ENDED = 20_000
LISTINGS = 20
BEGIN_S, END_S = 1000.0, 1000.0 + FLUENTS / 4


def run() -> list[Report]:
    """Listings of the first hundred fluents, each at another time and commit, in process."""
    kept = os.environ.get("FLUENTBOARD_BENCH_BOARD")
    with tempfile.TemporaryDirectory(prefix="fluentboard-bench-") as folder:
        data = Path(kept or folder) / "board"
        filling_s = None if data.exists() else _fill(data)
        begin = time.perf_counter()
        board = Blackboard.open(data, durability="process")
        opening_s = time.perf_counter() - begin
        notes = [f"100 fluents, read from the journal; opening the board took {opening_s:.1f} s."]
        if filling_s is not None:
            notes.append(f"Filling it took {filling_s:.0f} s.")
        try:
            return [_listings(board, notes)]
        finally:
            board.close()


def _fill(data: Path) -> float:
    begin = time.perf_counter()
    with Blackboard.open(data, durability="process") as board:
        made = fluents(FLUENTS)
        while batch := [AssertFluent(f) for f in itertools.islice(made, 5_000)]:
            board.execute(batch, "bench")
        # Every second object is open; some of them end later than they were seen to.
        for first in range(0, 2 * ENDED, 10_000):
            ends = Interval(BEGIN_S + FLUENTS, BEGIN_S + FLUENTS + 1.0)
            batch = [EndFluent(f"o{number}", ends) for number in range(first, first + 10_000, 2)]
            board.execute(batch, "bench")
    return time.perf_counter() - begin


def _listings(board: Blackboard, notes: list[str]) -> Report:
    rng = random.Random(3)

    def listing(wanted: Callable[[float], FluentFilter]) -> Callable[[], float]:
        """The mean time of some listings."""

        def once() -> float:
            begin = time.perf_counter()
            for _ in range(LISTINGS):
                board.list(wanted(rng.uniform(BEGIN_S, END_S)), limit=100)
            return time.perf_counter() - begin

        return once

    def commit() -> int:
        return rng.randrange(2, board.commit)

    return compare(
        "What held at a time, as believed at a commit, on a board of 1,000,000 fluents on disk",
        {
            "at a time, as of a commit": listing(lambda t: FluentFilter(at_s=t, as_of=commit())),
            "at a time, as believed now": listing(lambda t: FluentFilter(at_s=t)),
            "mugs at a time, as of a commit": listing(
                lambda t: FluentFilter(at_s=t, as_of=commit(), class_name="Mug")
            ),
            "during ten minutes, as of a commit": listing(
                lambda t: FluentFilter(
                    relation=(Relation.DURING, window(t, t + 600.0)), as_of=commit()
                )
            ),
        },
        rounds=7,
        operations=LISTINGS,
        unit="ms",
        target="at most 50 ms",
        notes=notes,
    )
