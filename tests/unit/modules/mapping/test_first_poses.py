"""From planes to a first pose and box."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from shapely.affinity import rotate
from shapely.geometry import MultiPolygon, Polygon, box

from fluentboard_modules.mapping.config import HypothesisConfig
from fluentboard_modules.mapping.hypotheses import (
    place_hypothesis,
    placing_box,
    principal_yaw,
    upright_box,
)
from fluentboard_modules.mapping.planar_region import PlanarRegion, as_multipolygon
from fluentboard_modules.mapping.rules import FurnitureRules

MakePlane = Callable[..., PlanarRegion]
CONFIG = HypothesisConfig()


def turned(plane: PlanarRegion, angle_deg: float) -> PlanarRegion:
    return replace(plane, contour=as_multipolygon(rotate(plane.contour, angle_deg)))


@pytest.mark.parametrize("angle_deg", [-60.0, 0.0, 25.0, 80.0])
@pytest.mark.parametrize("how", ["rectangle", "pca"])
def test_a_table_is_turned_along_its_longer_side(
    furniture_rules: FurnitureRules, make_plane: MakePlane, angle_deg: float, how: str
) -> None:
    top = turned(make_plane((1.0, 2.0, 0.73), size=(1.6, 0.8)), angle_deg)
    table = furniture_rules.classify([top]).hypotheses[0]
    config = HypothesisConfig.model_validate({"top_orientation": how})

    placed = place_hypothesis(table, furniture_rules.rules.furniture["Table"], [top], config)

    assert placed.pose.yaw_rad == pytest.approx(np.deg2rad(angle_deg), abs=1e-3)
    assert (placed.pose.x, placed.pose.y, placed.pose.z) == pytest.approx((1.0, 2.0, 0.73))
    assert placed.box.sizes == pytest.approx([1.6, 0.8, 0.73], abs=1e-3)
    assert placed.box.pose.z == pytest.approx(0.365)


def test_sides_tell_the_direction_of_a_top_hidden_in_part(
    furniture_rules: FurnitureRules, make_plane: MakePlane
) -> None:
    whole = make_plane((0.0, 0.0, 0.73), size=(1.6, 0.8))
    corner = Polygon([(0.8, 0.4), (0.8, -0.2), (0.0, 0.4)])
    seen = replace(whole, contour=as_multipolygon(whole.contour.difference(corner)))
    table = furniture_rules.classify([seen]).hypotheses[0]
    furniture = furniture_rules.rules.furniture["Table"]

    by_sides = place_hypothesis(table, furniture, [seen], CONFIG)
    by_axes = place_hypothesis(table, furniture, [seen], HypothesisConfig(top_orientation="pca"))

    assert abs(by_sides.pose.yaw_rad) < np.deg2rad(1.0)
    assert abs(by_axes.pose.yaw_rad) > np.deg2rad(4.0)


def test_the_edge_of_a_backrest_is_none_to_face_away_from(
    furniture_rules: FurnitureRules, make_plane: MakePlane
) -> None:
    seat = make_plane((0.0, 0.0, 0.47), size=(0.45, 0.45))
    edge = make_plane((-0.25, 0.22, 0.83), (0.0, 1.0, 0.0), (0.1, 0.5))
    chair = furniture_rules.classify([seat, edge]).hypotheses[0]

    placed = place_hypothesis(chair, furniture_rules.rules.furniture["Chair"], [seat, edge], CONFIG)

    assert placed.back_plane is None


@pytest.mark.parametrize("heading_deg", [0.0, 90.0, -135.0])
def test_a_chair_faces_away_from_its_backrest(
    furniture_rules: FurnitureRules, make_plane: MakePlane, heading_deg: float
) -> None:
    heading = np.deg2rad(heading_deg)
    front = np.array([np.cos(heading), np.sin(heading), 0.0])
    seat = make_plane((0.0, 0.0, 0.45), size=(0.4, 0.4))
    back = make_plane(
        np.array([0.0, 0.0, 0.75]) - 0.22 * front, front + np.array([0.0, 0.0, 0.2]), (0.4, 0.3)
    )
    chair = furniture_rules.classify([seat, back]).hypotheses[0]

    placed = place_hypothesis(chair, furniture_rules.rules.furniture["Chair"], [seat, back], CONFIG)

    assert placed.back_plane == 1
    error = placed.pose.yaw_rad - heading
    assert abs(np.arctan2(np.sin(error), np.cos(error))) < np.deg2rad(2.0)
    assert placed.box.z_size == pytest.approx(0.9, abs=0.02)


def test_the_side_the_sensor_saw_the_backrest_from_does_not_matter(
    furniture_rules: FurnitureRules, make_plane: MakePlane
) -> None:
    seat = make_plane((0.0, 0.0, 0.45), size=(0.4, 0.4))
    seen_from_behind = make_plane((0.0, 0.22, 0.75), (0.0, 1.0, 0.0), (0.4, 0.3))
    planes = [seat, seen_from_behind]
    chair = furniture_rules.classify(planes).hypotheses[0]

    placed = place_hypothesis(chair, furniture_rules.rules.furniture["Chair"], planes, CONFIG)

    assert placed.pose.yaw_rad == pytest.approx(-0.5 * np.pi, abs=0.02)


def test_of_two_backrests_the_seats_own_is_taken(
    furniture_rules: FurnitureRules, make_plane: MakePlane
) -> None:
    seat = make_plane((0.0, 0.0, 0.45), size=(0.4, 0.4))
    own = make_plane((0.0, 0.22, 0.75), (0.0, -1.0, 0.0), (0.4, 0.3))
    neighbours = make_plane((0.45, 0.3, 0.75), (0.0, -1.0, 0.0), (0.4, 0.3))
    planes = [seat, neighbours, own]
    chair = furniture_rules.classify(planes).hypotheses[0]

    placed = place_hypothesis(chair, furniture_rules.rules.furniture["Chair"], planes, CONFIG)

    assert placed.back_plane == 2


def test_things_are_placed_on_the_top(make_plane: MakePlane) -> None:
    area = placing_box(make_plane((1.0, 2.0, 0.73), size=(1.6, 0.8)), 0.0, CONFIG)

    assert area.sizes == pytest.approx([1.6, 0.8, CONFIG.placing_height_m])
    assert area.corners()[:, 2].min() == pytest.approx(0.73)


def test_a_box_holds_all_its_planes(make_plane: MakePlane) -> None:
    planes = [make_plane((0.0, 0.0, z), size=(0.8, 0.3)) for z in (0.13, 0.48, 0.83)]

    around = upright_box(planes, 0.3)

    for plane in planes:
        assert around.contains(plane.outline_map() * 0.999).all()


def test_principal_axis_leaves_out_holes() -> None:
    plate = box(-1.0, -1.0, 1.0, 1.0).difference(box(-0.9, -0.5, 0.9, 0.5))

    assert abs(abs(principal_yaw(as_multipolygon(plate))) - 0.5 * np.pi) < 1e-6


def test_an_empty_area_has_no_axis() -> None:
    assert principal_yaw(MultiPolygon()) == 0.0
