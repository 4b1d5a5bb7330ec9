"""What a thousand subscriptions cost a writer, when one of them matches."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable

from bench.measuring import Report, compare
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent
from fluentboard.board.subscriptions.registry import SubscriptionRegistry
from fluentboard.model.fluent import Fluent, Property

WRITES = 500


def run() -> list[Report]:
    """The write cost until the subscriber's message is queued, by number of subscriptions."""
    numbers = itertools.count()
    boards: list[Blackboard] = []

    def candidate(count: int) -> Callable[[], float]:
        board = Blackboard.open(None)
        boards.append(board)
        registry = SubscriptionRegistry(board)
        for number in range(count):
            registry.open(
                f"SELECT ?on {{ ?on a race:On ; upper:hasPhysicalEntity fluent:mug{number} }}"
            )
        registry.wait_until(board.commit, 600.0)

        def once() -> float:
            batch = [next(numbers) for _ in range(WRITES)]
            begin = time.perf_counter()
            for number in batch:
                mug = Property("hasPhysicalEntity", "Mug", "mug7")
                board.execute([AssertFluent(Fluent(f"on{number}", "On", properties=(mug,)))], "b")
            registry.wait_until(board.commit, 600.0)
            return time.perf_counter() - begin

        return once

    try:
        return [
            compare(
                "One write with many subscriptions, one of which matches",
                {
                    "1,000 subscriptions": candidate(1_000),
                    "none": candidate(0),
                    "10,000 subscriptions": candidate(10_000),
                },
                rounds=7,
                operations=WRITES,
                unit="us",
                target="within twice the cost of none, and at least 1,000 writes/s sustained",
                notes=["In process and in memory; until the message waits for its subscriber."],
            )
        ]
    finally:
        for board in boards:
            board.close()
