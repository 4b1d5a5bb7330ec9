"""Work in several threads gives what one thread would give."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from fluentboard_modules.mapping.work_ahead import worked_ahead, worked_in_parts


def square(number: int) -> int:
    return number * number


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_results_come_in_the_order_of_the_items(threads: int) -> None:
    found = list(worked_ahead(square, range(20), threads))

    assert found == [(number, number * number) for number in range(20)]


def test_two_threads_work_at_the_same_time() -> None:
    both = threading.Barrier(2)

    found = list(worked_ahead(lambda _: both.wait(timeout=20.0), range(2), 2))

    assert sorted(place for _, place in found) == [0, 1]


@pytest.mark.parametrize(("threads", "most"), [(1, 0), (2, 2)])
def test_items_are_drawn_as_late_as_possible(threads: int, most: int) -> None:
    drawn: list[int] = []

    def items() -> Iterator[int]:
        for number in range(10):
            drawn.append(number)
            yield number

    for number, _ in worked_ahead(square, items(), threads):
        assert len(drawn) - 1 - number <= most


def test_what_goes_wrong_in_a_thread_is_raised() -> None:
    with pytest.raises(ZeroDivisionError):
        list(worked_ahead(lambda number: 1 // number, [1, 0, 2, 3], 2))


@pytest.mark.parametrize(("n_rows", "threads"), [(0, 2), (1, 2), (7, 2), (8, 3)])
def test_every_row_is_worked_on_once(n_rows: int, threads: int) -> None:
    rows: list[int] = []

    worked_in_parts(lambda first, last: rows.extend(range(first, last)), n_rows, threads)

    assert sorted(rows) == list(range(n_rows))
