"""What a document says of a fluent is gathered, in memory and on disk alike."""

from __future__ import annotations

import pyoxigraph as ox
import pytest

from fluentboard.api.descriptions import Descriptions
from fluentboard_ontology import FLUENT, PREFIXES, XSD

A = "http://www.w3.org/1999/02/22-rdf-syntax-ns#type"
MUG = ox.NamedNode(PREFIXES["race"] + "Mug")
SIZE = ox.Literal("0.1234567890123", datatype=ox.NamedNode(XSD + "float"))


def triple(name: str, predicate: str, target: ox.NamedNode | ox.Literal) -> ox.Triple:
    return ox.Triple(ox.NamedNode(FLUENT + name), ox.NamedNode(predicate), target)


SAID = [
    ("a", triple("a", A, MUG)),
    ("b", triple("b", "urn:size", SIZE)),
    ("a", triple("a", "urn:text", ox.Literal('line\n"quoted"', language="en"))),
    ("b", triple("b", A, MUG)),
    ("a", triple("a", A, MUG)),
    ("c", triple("c", "urn:near", ox.NamedNode(FLUENT + "a"))),
]


@pytest.mark.parametrize("in_memory_max", [1, 2, 4, 100])
def test_statements_are_together_however_they_were_scattered(in_memory_max: int) -> None:
    with Descriptions(in_memory_max) as descriptions:
        for name, statement in SAID:
            descriptions.add(name, statement)
        assert [descriptions.class_of(name) for name in "abcd"] == [
            MUG.value,
            MUG.value,
            None,
            None,
        ]
        found = [set(triples) for triples in descriptions]
        # A statement that is made twice is one, and numbers keep all their digits.
        assert sum(map(len, found)) == 5
    expected = [{said for name, said in SAID if name == wanted} for wanted in "abc"]
    assert sorted(found, key=len) == sorted(expected, key=len)
