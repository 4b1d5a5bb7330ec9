"""The ontologies of fluentboard: their texts, their namespaces, and nothing else.

`upper` holds what every robot's board speaks about, `race` the restaurant of the thesis, and
`furniture` planes, pieces of furniture and the rules that recognise them. The texts are Turtle
files inside this package.

    >>> read("upper").startswith("# The upper ontology")
    True
    >>> RACE + "Mug"
    'https://w3id.org/fluentboard/race#Mug'
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files
from importlib.resources.abc import Traversable
from types import MappingProxyType
from typing import Final

_BASE: Final = "https://w3id.org/fluentboard/"

UPPER: Final = _BASE + "upper#"
"""Fluents, poses, boxes, areas, physical entities, robots, activities."""
RACE: Final = _BASE + "race#"
"""The restaurant: its areas, tableware, personal items and activities."""
FURNITURE: Final = _BASE + "furniture#"
"""Planes, pieces of furniture, and the rules that recognise them."""
FB: Final = _BASE + "board#"
"""The board's own vocabulary: extension functions and materialised predicates."""
FLUENT: Final = _BASE + "fluent/"
"""Individuals: the fluent named `mug1` is `FLUENT + "mug1"`."""

RDF: Final = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
RDFS: Final = "http://www.w3.org/2000/01/rdf-schema#"
OWL: Final = "http://www.w3.org/2002/07/owl#"
XSD: Final = "http://www.w3.org/2001/XMLSchema#"
SWRL: Final = "http://www.w3.org/2003/11/swrl#"
SWRLB: Final = "http://www.w3.org/2003/11/swrlb#"

PREFIXES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "rdf": RDF,
        "rdfs": RDFS,
        "owl": OWL,
        "xsd": XSD,
        "swrl": SWRL,
        "swrlb": SWRLB,
        "upper": UPPER,
        "race": RACE,
        "furniture": FURNITURE,
        "fb": FB,
        "fluent": FLUENT,
    }
)
"""Every prefix that queries may use without declaring it, with its namespace."""

ONTOLOGIES: Final = ("upper", "furniture", "race")
"""Names of the ontologies, each after those it imports."""


def ontology_iri(name: str) -> str:
    """The IRI that `owl:imports` uses for an ontology.

    Raises:
        ValueError: there is no ontology of that name.
    """
    return _BASE + _known(name)


def path(name: str) -> Traversable:
    """The Turtle file of an ontology, wherever the package is installed (also inside a zip).

    Raises:
        ValueError: there is no ontology of that name.
    """
    return files(__name__) / f"{_known(name)}.ttl"


def read(name: str) -> str:
    """The Turtle text of an ontology.

    Raises:
        ValueError: there is no ontology of that name.
    """
    return path(name).read_text(encoding="utf-8")


def _known(name: str) -> str:
    if name not in ONTOLOGIES:
        raise ValueError(f"no ontology is called {name!r}; there are {', '.join(ONTOLOGIES)}")
    return name
