"""What it costs to evaluate a query in a process that can be killed, rather than in the service."""

from __future__ import annotations

import asyncio
import itertools
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from bench.measuring import Report, compare
from bench.workload import ANCHORING_QUERY, fluents
from fluentboard.api.answering import Question
from fluentboard.api.evaluation import Evaluator
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent
from fluentboard.config import LimitSettings
from fluentboard.model.fluent import Fluent

FLUENTS = 20_000
QUERIES = 50
SHORT = "SELECT ?mug { ?mug a race:Mug } LIMIT 10"


def run() -> list[Report]:
    """A short query, a long one, and a write with a query after it."""
    # Every query is evaluated: nothing is remembered.
    limits = LimitSettings(result_cache_bytes=0)
    with (
        tempfile.TemporaryDirectory(prefix="fluentboard-bench-") as folder,
        Blackboard.open(Path(folder) / "board", durability="process") as board,
    ):
        made = fluents(FLUENTS)
        while batch := [AssertFluent(f) for f in itertools.islice(made, 5_000)]:
            board.execute(batch, "bench")
        in_reader = Evaluator(board, limits, (), Path(folder) / "readers")
        in_thread = Evaluator(board, limits, (), None)
        try:
            asyncio.run(in_reader.evaluate(Question(SHORT)))  # starts it
            return [
                _compared("A short query", board, in_reader, in_thread, SHORT, "us"),
                _compared(
                    "The anchoring query", board, in_reader, in_thread, ANCHORING_QUERY, "ms"
                ),
                _compared(
                    "A write and a query", board, in_reader, in_thread, SHORT, "us", writes=True
                ),
            ]
        finally:
            in_reader.close()
            in_thread.close()


def _compared(
    what: str,
    board: Blackboard,
    in_reader: Evaluator,
    in_thread: Evaluator,
    query: str,
    unit: str,
    *,
    writes: bool = False,
) -> Report:
    numbers = itertools.count()
    count = QUERIES if unit == "us" else 5

    def asked(evaluator: Evaluator) -> Callable[[], float]:
        async def some() -> float:
            begin = time.perf_counter()
            for _ in range(count):
                if writes:
                    fluent = Fluent(f"{what[:1]}{id(evaluator)}_{next(numbers)}", "Fork")
                    board.execute([AssertFluent(fluent)], "bench")
                result = await evaluator.evaluate(Question(query))
                assert result.size_bytes > 0
                if result.file is not None:
                    result.file.close()
            return time.perf_counter() - begin

        return lambda: asyncio.run(some())

    return compare(
        f"{what}, in a process that can be killed",
        {"in a reader": asked(in_reader), "in a thread of the service": asked(in_thread)},
        rounds=9,
        operations=count,
        unit=unit,
        notes=[f"{FLUENTS:,} fluents on disk; without HTTP, and nothing is remembered."],
    )
