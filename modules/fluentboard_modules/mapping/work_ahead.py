"""Independent pieces of work in several threads; the results are those of one thread."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def worked_ahead(
    work: Callable[[Item], Result], items: Iterable[Item], threads: int
) -> Iterator[tuple[Item, Result]]:
    """Each item with its result, while the next items are worked on already.

    Items are drawn as late as possible: whoever makes them one by one knows all results but those
    of the last few. What comes out is the same for any number of threads, if the work only depends
    on its item.

    Args:
        work: pure; it should spend its time in compiled code that lets other threads run.
        items: what is worked on.
        threads: that work at the same time; with 1 nothing is done ahead.
    """
    if threads <= 1:
        for item in items:
            yield item, work(item)
        return
    with ThreadPoolExecutor(threads, thread_name_prefix="mapping") as pool:
        waiting: deque[tuple[Item, Future[Result]]] = deque()
        try:
            for item in items:
                waiting.append((item, pool.submit(work, item)))
                if len(waiting) > threads:
                    first, result = waiting.popleft()
                    yield first, result.result()
            while waiting:
                first, result = waiting.popleft()
                yield first, result.result()
        finally:
            for _, result in waiting:
                result.cancel()


def worked_in_parts(work: Callable[[int, int], object], n_rows: int, threads: int = 2) -> None:
    """Works on rows in as many equal parts as there are threads.

    Args:
        work: compiled; fills in the rows from the first to the one before the last, given so.
        n_rows: of all.
        threads: that work at the same time.
    """
    bounds = [n_rows * part // threads for part in range(threads + 1)]
    with ThreadPoolExecutor(threads, thread_name_prefix="mapping") as pool:
        for part in [pool.submit(work, a, b) for a, b in itertools.pairwise(bounds)]:
            part.result()
