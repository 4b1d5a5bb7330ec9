"""Fluents to measure with: observed objects, each with pose, box and box pose (Listing 4.1)."""

from __future__ import annotations

import random
from collections.abc import Iterable, Iterator

from fluentboard.board.triples import fluent_lines
from fluentboard.board.vocabulary import Vocabulary, parse_statements
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_ontology import ONTOLOGIES, read

CLASSES = ("Mug", "Coffee", "Plate", "Fork", "Knife", "Spoon", "Table", "Chair")


def vocabulary() -> Vocabulary:
    """The built-in ontologies."""
    return Vocabulary(
        triple for name in ONTOLOGIES for triple in parse_statements(read(name), name)
    )


def fluents(count: int, prefix: str = "o", seed: int = 1) -> Iterator[Fluent]:
    """`count` fluents: a quarter are objects, the others their poses and boxes.

    Half of the objects have ended, as on a board that has been running for a while.
    """
    rng = random.Random(seed)
    for number in range((count + 3) // 4):
        seen = 1000.0 + number
        start = Interval.at(seen)
        finish = Interval.at(seen + rng.uniform(5.0, 500.0)) if number % 2 else UNKNOWN
        pose, box, centre = (f"{prefix}{number}_{part}" for part in ("pose", "box", "centre"))
        x, y = round(rng.uniform(0.0, 12.0), 3), round(rng.uniform(0.0, 12.0), 3)
        position = (
            Property("hasX", "xsd:float", x),
            Property("hasY", "xsd:float", y),
            Property("hasZ", "xsd:float", 0.72),
            Property("hasYaw", "xsd:float", round(rng.uniform(-3.0, 3.0), 3)),
        )
        yield Fluent(
            f"{prefix}{number}",
            CLASSES[number % len(CLASSES)],
            start,
            finish,
            (Property("hasPose", "Pose", pose), Property("hasBoundingBox", "BBox", box)),
        )
        yield Fluent(pose, "Pose", start, finish, position)
        yield Fluent(
            box,
            "BBox",
            start,
            finish,
            (
                Property("hasPose", "Pose", centre),
                Property("hasXSize", "xsd:float", 0.07),
                Property("hasYSize", "xsd:float", 0.094),
                Property("hasZSize", "xsd:float", 0.084),
            ),
        )
        yield Fluent(centre, "Pose", start, finish, position)


def ntriples(some: Iterable[Fluent], words: Vocabulary) -> str:
    """The fluents as the board writes them to its RDF store."""
    return "".join(line for fluent in some for line in fluent_lines(fluent, words))


ANCHORING_QUERY = """\
SELECT DISTINCT ?instance WHERE
{
  ?instance upper:hasBoundingBox ?any .
  ?instance a ?subclass .
  {
    {?subclass rdfs:subClassOf+ race:Kitchenware}
    UNION {?subclass rdfs:subClassOf+ race:PersonalItem}
  }
}
"""
"""Section 4.2.4, verbatim."""
