"""Queries of the RDF store: which commit their results are exact at."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pyoxigraph as ox
import pytest

import fluentboard.board.rdf_store as store_module
from fluentboard.board.store import EmbeddedStore

ASK = "ASK { ?s ?p ?o }"


class Meddler:
    """Has the store go on to another commit each time that a query begins."""

    def __init__(self, store: EmbeddedStore, commits: int) -> None:
        self.store = store
        self.left = commits
        self.asked: list[int] = []

    def __call__(self, commit: int) -> Mapping[ox.NamedNode, Any]:
        self.asked.append(commit)
        if self.left:
            self.left -= 1
            self.store.apply(f"<urn:s> <urn:p> <urn:o{commit}> .", "", commit + 1)
        return {}


@pytest.fixture
def store() -> EmbeddedStore:
    return EmbeddedStore(None)


def test_undisturbed_results_are_exact(store: EmbeddedStore) -> None:
    meddler = Meddler(store, 0)
    commit, is_exact, _ = store.marked_query(ASK, functions_at=meddler)
    assert (commit, is_exact, meddler.asked) == (0, True, [0])


def test_a_quick_query_that_met_with_a_commit_is_asked_again(
    store: EmbeddedStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store_module, "_PATIENCE_S", 60.0)
    meddler = Meddler(store, 1)
    commit, is_exact, results = store.marked_query(ASK, functions_at=meddler)
    assert (commit, is_exact, meddler.asked) == (1, True, [0, 1])
    assert bool(results)


def test_a_slow_query_that_met_with_a_commit_is_not_asked_again(
    store: EmbeddedStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store_module, "_PATIENCE_S", -1.0)
    meddler = Meddler(store, 1)
    commit, is_exact, _ = store.marked_query(ASK, functions_at=meddler)
    assert (commit, is_exact, meddler.asked) == (0, False, [0])


def test_a_snapshot_is_exact_however_many_commits_come(store: EmbeddedStore) -> None:
    meddler = Meddler(store, 4)
    commit, _ = store.snapshot_query(ASK, functions_at=meddler)
    assert (commit, meddler.asked) == (4, [0, 1, 2, 3, 4])
