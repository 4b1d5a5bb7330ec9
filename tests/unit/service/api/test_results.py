from __future__ import annotations

import asyncio
import threading
from pathlib import Path
from typing import IO, Any, cast

import pyoxigraph as ox
import pytest

from fluentboard.api.answering import written
from fluentboard.api.results import ResultSink, RowCounter, Stopped
from fluentboard.config import LimitSettings
from fluentboard.errors import TooLarge

TRICKY = ['}},{"', "<result>", "a\nb", 'say "hi"\r\n', "\t", "plain", '"\n"', "}},{"]


def solutions(values: list[str]) -> ox.QuerySolutions:
    rows = " ".join(str(ox.Literal(value)) for value in values)
    results = ox.Store().query(f"SELECT ?v ?w WHERE {{ VALUES ?v {{ {rows} }} BIND(?v AS ?w) }}")
    assert isinstance(results, ox.QuerySolutions)
    return results


def sink(form: Any = ox.QueryResultsFormat.JSON, **limits: int) -> ResultSink:
    return ResultSink(form, LimitSettings(**cast("dict[str, Any]", limits)), threading.Event())


def write(results: Any, into: ResultSink, form: Any = ox.QueryResultsFormat.JSON) -> None:
    try:
        results.serialize(cast("IO[bytes]", into), form)
    finally:
        # Else a failure keeps them, until another thread collects it: which pyoxigraph forbids.
        del results


@pytest.mark.parametrize("form", ["JSON", "XML", "CSV", "TSV"])
@pytest.mark.parametrize("piece", [1, 7, 10_000])
def test_rows_are_counted_in_every_format_however_it_is_cut(form: str, piece: int) -> None:
    written: ox.QueryResultsFormat = getattr(ox.QueryResultsFormat, form)
    text = solutions(TRICKY * 3).serialize(format=written)
    assert text is not None
    counter = RowCounter(written)

    for begin in range(0, len(text), piece):
        counter.add(text[begin : begin + piece])

    assert counter.rows == 3 * len(TRICKY)


def test_a_result_within_its_limits_is_kept_whole() -> None:
    into = sink(result_rows_max=len(TRICKY))
    write(solutions(TRICKY), into)
    assert into.text == solutions(TRICKY).serialize(format=ox.QueryResultsFormat.JSON)


def test_a_result_with_too_many_rows_is_refused() -> None:
    with pytest.raises(TooLarge, match="more than 2 rows") as refusal:
        write(solutions(["x" * 10_000] * 3), sink(result_rows_max=2))
    assert refusal.value.detail == {"limit_rows": 2}


def test_a_result_with_too_many_bytes_is_refused() -> None:
    with pytest.raises(TooLarge, match="longer than 100 bytes"):
        write(solutions(["x" * 200]), sink(result_max_bytes=100))


def test_a_long_result_goes_through_a_file_unchanged() -> None:
    into = sink(result_memory_max_bytes=100)
    write(solutions(["x" * 5_000] * 8), into)

    async def read() -> bytes:
        return b"".join([chunk async for chunk in into.chunks()])

    expected = solutions(["x" * 5_000] * 8).serialize(format=ox.QueryResultsFormat.JSON)
    assert into.text is None
    assert asyncio.run(read()) == expected
    assert into.size == len(expected or b"")


def test_writing_stops_when_nobody_waits() -> None:
    stop = threading.Event()
    stop.set()
    into = ResultSink(ox.QueryResultsFormat.JSON, LimitSettings(), stop)
    with pytest.raises(Stopped):
        write(solutions(["x"]), into)


def test_a_result_that_is_given_up_leaves_no_file(tmp_path: Path) -> None:
    limits = LimitSettings(result_memory_max_bytes=10, result_max_bytes=20_000)
    with pytest.raises(TooLarge):
        written(solutions(["long"] * 5_000), None, limits, threading.Event(), tmp_path)
    assert not list(tmp_path.iterdir())
