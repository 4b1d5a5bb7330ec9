"""The three ontologies, parsed once."""

from __future__ import annotations

import pytest
import rdflib

from fluentboard_ontology import ONTOLOGIES, read


@pytest.fixture(scope="session")
def graphs() -> dict[str, rdflib.Graph]:
    """Each ontology by name."""
    return {name: rdflib.Graph().parse(data=read(name), format="turtle") for name in ONTOLOGIES}


@pytest.fixture(scope="session")
def everything(graphs: dict[str, rdflib.Graph]) -> rdflib.Graph:
    """All ontologies in one graph."""
    union = rdflib.Graph()
    for graph in graphs.values():
        for triple in graph:
            union.add(triple)
    return union
