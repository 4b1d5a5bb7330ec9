"""While others write, every answer about a time is exact at the commit that it names."""

from __future__ import annotations

import random
import threading

import pyoxigraph as ox
import pytest

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent, Command, EndFluent
from fluentboard.clock import ReplayClock
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Interval

COMMITS = 150
ALIVE = 10
COUNT = "SELECT (COUNT(?m) AS ?n) { ?m a race:Mug }"
COUNT_BY_FUNCTION = "SELECT (COUNT(?m) AS ?n) { ?m a race:Mug FILTER(fb:holdsAt(?m, fb:now())) }"


def batch(number: int) -> list[Command]:
    """Two new mugs, and the end of the two that have been there for longest."""
    old = number - ALIVE
    ended = [EndFluent(f"m{old}_{i}", Interval.at(5.0)) for i in (0, 1)] if old >= 0 else []
    return [*(AssertFluent(Fluent(f"m{number}_{i}", "Mug")) for i in (0, 1)), *ended]


def number_in(results: object) -> int:
    assert isinstance(results, ox.QuerySolutions)
    (row,) = results
    assert isinstance(row[0], ox.Literal)
    return int(row[0].value)


@pytest.mark.parametrize("seed", [1, 2])
def test_answers_are_exact_at_the_commit_they_name(seed: int) -> None:
    with Blackboard.open(None, clock=ReplayClock(10.0)) as board:
        first = board.commit
        problems: list[str] = []
        done = threading.Event()

        def expected(commit: int) -> int:
            return 2 * min(commit - first, ALIVE)

        def read(seed: int) -> None:
            rng = random.Random(seed)
            # At least once, however quickly the writer is done.
            while not problems:
                was_done = done.is_set()
                as_of = rng.choice([None, None, rng.randint(first, board.commit)])
                found = board.timed_query(COUNT, at="now", as_of=as_of)
                held = number_in(found.results)
                if held != expected(found.commit) or as_of not in (None, found.commit):
                    problems.append(f"{held} at commit {found.commit}, asked as of {as_of}")
                found = board.timed_query(COUNT_BY_FUNCTION)
                held = number_in(found.results)
                if found.is_exact and held != expected(found.commit):
                    problems.append(f"{held} by function at commit {found.commit}")
                if was_done:
                    return

        readers = [threading.Thread(target=read, args=(10 * seed + i,)) for i in range(2)]
        for reader in readers:
            reader.start()
        for number in range(COMMITS):
            board.execute(batch(number), "test")
        done.set()
        for reader in readers:
            reader.join()
        assert problems == []
        assert board.commit == first + COMMITS
