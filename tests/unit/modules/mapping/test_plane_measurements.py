"""What the rules measure: features of planes and relations between them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fluentboard.model.geometry import Plane
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.plane_features import PlaneRelations, measure_features

TOLERANCES = {
    "isLowerThan": {"minimumRise": 0.05},
    "isBelow": {"minimumRise": 0.1, "minimumOverlap": 0.2},
    "isPerpendicularTo": {"angleTolerance": np.deg2rad(25.0)},
    "isParallelTo": {"angleTolerance": np.deg2rad(10.0)},
    "isAdjacentTo": {"maximumGap": 0.25},
    "isBackedBy": {"minimumDepth": 0.42, "maximumDepth": 0.75, "minimumOverlap": 0.5},
}
MakePlane = Callable[..., PlanarRegion]


def related(relation: str, *planes: PlanarRegion) -> set[tuple[int, int]]:
    relations = PlaneRelations(planes, TOLERANCES)
    everything = np.ones((len(planes), len(planes)), dtype=np.bool_)
    return {(int(i), int(j)) for i, j in np.argwhere(relations.holds(relation, everything))}


def test_features_of_a_tilted_plane(make_plane: MakePlane) -> None:
    tilt = np.deg2rad(20.0)
    plane = make_plane((0.0, 0.0, 0.7), (np.sin(tilt), 0.0, np.cos(tilt)), (1.5, 0.5))

    features = measure_features([plane])

    assert features["hasInclination"][0] == pytest.approx(tilt)
    assert features["hasSize"][0] == pytest.approx(0.75)
    assert features["hasPosY"][0] == pytest.approx(0.7)
    assert features["hasLength"][0] == pytest.approx(1.5)
    assert features["hasWidth"][0] == pytest.approx(0.5)


def test_inclination_does_not_care_which_side_is_seen(make_plane: MakePlane) -> None:
    ceiling = make_plane((0.0, 0.0, 2.5), (0.0, 0.0, -1.0))

    assert measure_features([ceiling])["hasInclination"][0] == pytest.approx(0.0, abs=1e-9)


def test_heights_count_from_a_sloping_floor(make_plane: MakePlane) -> None:
    normal = np.array([-0.02, 0.0, 1.0]) / np.hypot(0.02, 1.0)
    floor = Plane(normal, 0.0)  # rises by 2 cm per metre along x

    features = measure_features([make_plane((3.0, 0.0, 0.72))], floor)

    assert features["hasPosY"][0] == pytest.approx(0.66, abs=1e-3)


def test_a_board_is_below_another_if_they_overlap_from_above(make_plane: MakePlane) -> None:
    low, high = make_plane((0.0, 0.0, 0.1)), make_plane((0.5, 0.0, 0.5))
    aside = make_plane((3.0, 0.0, 0.5))

    assert related("isBelow", low, high, aside) == {(0, 1)}
    assert related("isLowerThan", low, high, aside) == {(0, 1), (0, 2)}


def test_a_wall_is_perpendicular_to_the_floor_both_ways(make_plane: MakePlane) -> None:
    floor, wall = make_plane((0.0, 0.0, 0.0)), make_plane((0.0, 0.5, 0.5), (0.0, -1.0, 0.0))

    assert related("isPerpendicularTo", floor, wall) == {(0, 1), (1, 0)}
    assert related("isParallelTo", floor, wall) == {(0, 0), (1, 1)}


@pytest.mark.parametrize(("gap", "near"), [(0.2, True), (0.3, False)])
def test_adjacency_is_the_gap_between_the_contours(
    make_plane: MakePlane, gap: float, near: bool
) -> None:
    a, b = make_plane((0.0, 0.0, 0.0)), make_plane((1.0 + gap, 0.0, 0.0))

    assert ((0, 1) in related("isAdjacentTo", a, b)) is near


def test_a_plane_is_not_adjacent_to_itself(make_plane: MakePlane) -> None:
    assert related("isAdjacentTo", make_plane((0.0, 0.0, 0.0))) == set()


def test_only_candidates_are_judged(make_plane: MakePlane) -> None:
    planes = [make_plane((0.0, 0.0, 0.0)), make_plane((0.0, 0.0, 1.0))]
    relations = PlaneRelations(planes, TOLERANCES)

    assert not relations.holds("isLowerThan", np.zeros((2, 2), dtype=np.bool_)).any()


def test_measurements_say_value_and_limit(make_plane: MakePlane) -> None:
    relations = PlaneRelations(
        [make_plane((0.0, 0.0, 0.0)), make_plane((1.31, 0.0, 0.0))], TOLERANCES
    )

    (gap,) = relations.measure("isAdjacentTo", 0, 1)

    assert gap.value == pytest.approx(0.31, abs=0.005)
    assert gap.limit == 0.25
    assert not gap.holds


def test_without_planes_nothing_is_measured() -> None:
    assert all(values.size == 0 for values in measure_features([]).values())
    assert related("isAdjacentTo") == set()


@pytest.mark.parametrize(
    ("depth_m", "beside_m", "is_backed"),
    [(0.6, 0.0, True), (0.6, 0.9, True), (0.6, 1.3, False), (0.3, 0.0, False), (1.0, 0.0, False)],
)
def test_a_front_is_backed_by_a_wall_as_far_behind_as_a_worktop_is_deep(
    make_plane: MakePlane, depth_m: float, beside_m: float, is_backed: bool
) -> None:
    front = make_plane((0.0, 0.0, 0.45), (0.0, -1.0, 0.0), (2.0, 0.8))
    wall = make_plane((beside_m, depth_m, 1.3), (0.0, -1.0, 0.0), (2.0, 0.8))

    assert ((0, 1) in related("isBackedBy", front, wall)) == is_backed
    assert (1, 0) not in related("isBackedBy", front, wall)
