"""Random sets of planes that are nearly furniture, on which two classifiers can be compared.

Every set holds some pieces whose heights, sizes and places are off by about as much as the margins
of the rules, so that for each definition there are planes that just satisfy it and planes that just
do not, next to planes of other pieces and planes that belong to nothing.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from shapely.geometry import MultiPolygon, box

from fluentboard.model.geometry import Transform
from fluentboard_modules.mapping.planar_region import PlanarRegion, upright_axes

_Vector = tuple[float, float, float]
_UP: _Vector = (0.0, 0.0, 1.0)
_FRONT: _Vector = (0.0, -1.0, 0.1)
# Per piece its planes: centre (m, from the middle of its footprint), normal, and sides (m).
_PIECES: Mapping[str, tuple[tuple[_Vector, _Vector, tuple[float, float]], ...]] = {
    "chair": (((0.0, 0.0, 0.45), _UP, (0.42, 0.4)), ((0.0, 0.24, 0.75), _FRONT, (0.4, 0.32))),
    "table with a chair": (
        ((0.0, 0.0, 0.73), _UP, (1.4, 0.8)),
        ((0.1, 0.48, 0.82), _FRONT, (0.4, 0.35)),
    ),
    "shelf": tuple(((0.0, 0.0, z), _UP, (0.8, 0.34)) for z in (0.13, 0.46, 0.82)),
    "shelf on a plinth": tuple(((0.0, 0.0, z), _UP, (0.9, 0.4)) for z in (0.05, 0.4, 0.9)),
    "row of shelves": tuple(((0.0, 0.0, z), _UP, (2.4, 0.4)) for z in (0.12, 0.45, 0.85)),
    "filled shelf": (
        ((0.0, -0.1, 0.9), (0.0, -1.0, 0.0), (0.8, 1.4)),
        ((0.0, 0.05, 0.46), _UP, (0.8, 0.2)),
    ),
    "cabinet": (
        ((0.0, 0.0, 1.0), _UP, (0.8, 0.4)),
        ((0.0, -0.21, 0.52), (0.0, -1.0, 0.0), (0.8, 0.9)),
    ),
    "counter": (((0.0, 0.0, 0.92), _UP, (1.8, 0.6)),),
    "coffee table": (((0.0, 0.0, 0.48), _UP, (1.0, 0.6)),),
    "floor": (((0.0, 0.0, 0.0), _UP, (2.5, 2.0)),),
    "wall": (((0.0, 0.0, 1.2), (0.0, -1.0, 0.0), (2.0, 1.2)),),
}
_OFF_M = 0.04  # as a standard deviation; the rules' margin is 0.05 m
_OFF_RAD = 0.12
_STRAYS_MAX = 3
_ROOM_M = 1.5  # pieces overlap in some sets


def random_plane_set(rng: np.random.Generator, pieces_max: int = 2) -> list[PlanarRegion]:
    """Two to nine planes, by default, of nearly furniture.

    Args:
        rng: where the numbers come from.
        pieces_max: at most so many pieces, at least one.
    """
    names = list(_PIECES)
    planes: list[PlanarRegion] = []
    for _ in range(int(rng.integers(1, pieces_max + 1))):
        turn = Transform.from_parts(_turned(rng.uniform(-np.pi, np.pi)), np.zeros(3))
        at = np.array([*rng.uniform(0.0, _ROOM_M, 2), 0.0])
        for centre, normal, sides in _PIECES[names[int(rng.integers(len(names)))]]:
            planes.append(
                _plane(
                    len(planes),
                    at + turn.rotate(np.asarray(centre)) + rng.normal(0.0, _OFF_M, 3),
                    turn.rotate(np.asarray(normal)) + rng.normal(0.0, _OFF_RAD, 3),
                    np.asarray(sides) * rng.uniform(0.5, 1.3, 2),
                    rng,
                )
            )
    for _ in range(int(rng.integers(1, _STRAYS_MAX + 1))):
        centre = np.array([*rng.uniform(-0.5, _ROOM_M, 2), rng.uniform(0.0, 1.3)])
        normal = np.asarray(_UP) if rng.random() < 0.5 else rng.normal(0.0, 1.0, 3)
        planes.append(_plane(len(planes), centre, normal, rng.uniform(0.1, 1.5, 2), rng))
    return planes


def _turned(yaw_rad: float) -> np.ndarray:
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _plane(
    index: int,
    centre: np.ndarray,
    normal: np.ndarray,
    sides: np.ndarray,
    rng: np.random.Generator,
) -> PlanarRegion:
    half = 0.5 * sides
    return PlanarRegion(
        index=index,
        T_map_region=Transform.from_parts(upright_axes(normal / np.linalg.norm(normal)), centre),
        contour=MultiPolygon([box(-half[0], -half[1], half[0], half[1])]),
        n_points=100,
        rms_m=0.003,
        excess_m2=float(rng.choice((0.0, 4e-5))),
    )
