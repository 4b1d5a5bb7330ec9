"""A hundred kills during writes: no acknowledged write is lost, none is torn."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

from bench.measuring import Report

ROUNDS, KILLS = 5, 20
TEST = "tests/e2e/test_service_crashes.py::test_no_acknowledged_write_is_lost_or_torn_by_a_kill"


def run() -> list[Report]:
    """Runs the end-to-end test until a hundred services have been killed, on five boards."""
    begin = time.perf_counter()
    for _ in range(ROUNDS):
        subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "--timeout=1200", TEST],
            cwd=Path(__file__).resolve().parent.parent,
            env={**os.environ, "FLUENTBOARD_TEST_KILLS": str(KILLS)},
            check=True,
        )
    return [
        Report(
            f"`kill -9` during writes, {ROUNDS * KILLS} times",
            "s",
            {"fluentboard": (time.perf_counter() - begin) / (ROUNDS * KILLS)},
            {},
            "no acknowledged write lost, none torn",
            [
                "Four clients write batches over HTTP while the service is killed and started "
                "again: every acknowledged batch was there, whole, in the journal and in the RDF "
                "store. A kill ends the process, not the machine: that a write is on disk rests "
                "on fsync."
            ],
        )
    ]
