from __future__ import annotations

import pytest

from fluentboard.api.result_cache import Cached, Key, ResultCache

ANSWER = Cached("text/csv", b"x" * 100)


def key(text: str = "ASK {}", accept: str | None = None) -> Key:
    return Key(text, accept, (), ())


def test_an_answer_is_known_until_the_next_commit() -> None:
    cache = ResultCache(10_000)
    cache.put(7, key(), ANSWER)
    assert cache.get(7, key()) == ANSWER
    assert cache.get(8, key()) is None


def test_an_answer_is_known_for_the_same_question_only() -> None:
    cache = ResultCache(10_000)
    cache.put(7, key(), ANSWER)
    assert cache.get(7, key(accept="text/csv")) is None
    assert cache.get(7, key("ASK { }")) is None


def test_an_answer_of_an_earlier_commit_does_not_come_back() -> None:
    cache = ResultCache(10_000)
    cache.put(8, key(), ANSWER)
    cache.put(7, key("ASK { }"), ANSWER)
    assert cache.get(7, key("ASK { }")) is None
    assert cache.get(8, key("ASK { }")) is None


def test_the_oldest_answers_make_room() -> None:
    cache = ResultCache(2_000)
    for number in range(10):
        cache.put(7, key(f"ASK {{ {number} }}"), ANSWER)
    known = [cache.get(7, key(f"ASK {{ {number} }}")) is not None for number in range(10)]
    assert known == [False] * 7 + [True] * 3


def test_a_cache_of_no_size_keeps_nothing() -> None:
    cache = ResultCache(0)
    cache.put(7, key(), ANSWER)
    assert cache.get(7, key()) is None


def test_a_long_answer_is_not_kept() -> None:
    cache = ResultCache(10**9)
    cache.put(7, key(), Cached("text/csv", b"x" * 100_000))
    assert cache.get(7, key()) is None


@pytest.mark.parametrize("call", ["NOW()", "rand ()", "UUID()", "StrUUID()", "BNODE()"])
def test_an_answer_that_may_differ_by_itself_is_not_kept(call: str) -> None:
    cache = ResultCache(10_000)
    text = f"SELECT ({call} AS ?x) {{}}"
    cache.put(7, key(text), ANSWER)
    assert cache.get(7, key(text)) is None
