"""Insert fluents: durable and batched, and one by one, against rdflib, oxrdflib and pyoxigraph."""

from __future__ import annotations

import itertools
import shutil
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pyoxigraph as ox
import rdflib

from bench.measuring import Report, compare
from bench.workload import fluents, ntriples, vocabulary
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent

COST = (
    "The engine's load of the text takes two thirds of the CPU time; text, checks, journal and "
    "index the rest. The load goes on beside the next batches, all but that of the last group, so "
    "the ratio depends on how free the second core is: runs on other days gave 0.59 to 0.81."
)
BATCH = 100
BATCHED = 2_000
SINGLE = 50


def run() -> list[Report]:
    """Both measurements."""
    return [
        _measure(
            "Insert fluents, durable, 100 per batch",
            BATCH,
            BATCHED,
            "at least 7 times rdflib and 0.7 times raw pyoxigraph on disk",
        ),
        _measure("Insert fluents, durable, one at a time", 1, SINGLE, ""),
    ]


def _measure(title: str, batch: int, count: int, target: str) -> Report:
    words = vocabulary()
    numbers = itertools.count()
    folder = Path(tempfile.mkdtemp(prefix="fluentboard-bench-"))
    board = Blackboard.open(folder / "board")
    raw = ox.Store(str(folder / "raw"))
    memory = rdflib.Graph()
    oxrdflib = rdflib.Graph(store="Oxigraph")
    oxrdflib.open(str(folder / "oxrdflib"))

    def batches() -> list[list[AssertFluent]]:
        made = [AssertFluent(f) for f in fluents(count, f"r{next(numbers)}_")]
        return [made[i : i + batch] for i in range(0, count, batch)]

    def texts() -> list[str]:
        return [ntriples((c.fluent for c in commands), words) for commands in batches()]

    def timed(work: list[Callable[[], object]]) -> float:
        begin = time.perf_counter()
        for step in work:
            step()
        return time.perf_counter() - begin

    def ours() -> float:
        writes = [partial(board.execute, commands, "bench") for commands in batches()]
        # A query waits until the RDF store has everything written before.
        return timed([*writes, partial(board.query, "ASK {}")])

    def load() -> float:
        return timed([partial(raw.load, text, format=ox.RdfFormat.N_TRIPLES) for text in texts()])

    def extend() -> float:
        ready = [list(ox.parse(text, format=ox.RdfFormat.N_TRIPLES)) for text in texts()]
        return timed([partial(raw.extend, quads) for quads in ready])

    def update() -> float:
        # A tenth of the work, scaled up: rdflib parses an update about as slowly as it sounds.
        part = texts()[: max(1, count // batch // 10)]
        spent = timed([partial(memory.update, f"INSERT DATA {{ {text} }}") for text in part])
        return spent * count / (len(part) * batch)

    def parse() -> float:
        return timed([partial(memory.parse, data=text, format="nt") for text in texts()])

    def parse_oxrdflib() -> float:
        return timed([partial(oxrdflib.parse, data=text, format="nt") for text in texts()])

    try:
        return compare(
            title,
            {
                "fluentboard (fsync)": ours,
                "pyoxigraph on disk, load of N-Triples (no fsync)": load,
                "pyoxigraph on disk, extend with ready quads (no fsync)": extend,
                "rdflib in memory, INSERT DATA": update,
                "rdflib in memory, parse of N-Triples": parse,
                "oxrdflib on disk, parse of N-Triples (no fsync)": parse_oxrdflib,
            },
            rounds=5,
            operations=count,
            unit="us",
            target=target,
            notes=[
                "fluentboard starts from fluents and also checks them, keeps their history and "
                "notifies; the peers start from the N-Triples text of the same fluents (about 9 "
                "triples each).",
                *([COST] if batch > 1 else []),
            ],
        )
    finally:
        board.close()
        oxrdflib.close()
        shutil.rmtree(folder, ignore_errors=True)
