"""Query threads: a pool whose threads do not keep the process alive.

A query cannot be interrupted while Oxigraph evaluates it. The threads of the standard library's
pool are waited for when the process ends, so a single runaway query would keep a stopped service
from ending.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

_Result = TypeVar("_Result")


class QueryThreads:
    """Runs jobs in a fixed number of daemon threads, started when they are first needed.

    Args:
        count: how many jobs run side by side.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self._jobs: queue.SimpleQueue[tuple[Future[Any], Callable[[], Any]] | None] = (
            queue.SimpleQueue()
        )
        self._threads: list[threading.Thread] = []

    def submit(self, job: Callable[[], _Result]) -> Future[_Result]:
        """Has a job done as soon as a thread is free; its future can be cancelled until then."""
        future: Future[_Result] = Future()
        self._jobs.put((future, job))
        if len(self._threads) < self._count:
            thread = threading.Thread(
                target=self._run, name=f"query-{len(self._threads) + 1}", daemon=True
            )
            self._threads.append(thread)
            thread.start()
        return future

    def close(self) -> None:
        """Lets the threads end after the jobs they have; nobody waits for them."""
        for _ in self._threads:
            self._jobs.put(None)

    def _run(self) -> None:
        while (entry := self._jobs.get()) is not None:
            future, job = entry
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(job())
            except BaseException as failure:
                future.set_exception(failure)
            # A waiting thread must not keep the last result alive.
            del entry, future, job
