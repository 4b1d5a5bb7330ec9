"""The steps of a search for furniture: what is left to explain, walls, sides, slivers, pairs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely.geometry import MultiPolygon, box

from fluentboard.model.geometry import BoundingBox, Pose, Transform
from fluentboard_modules.mapping.alignment import Standing
from fluentboard_modules.mapping.cad_library import library_of
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.candidates import lies_on
from fluentboard_modules.mapping.config import DepthNoiseConfig, VisibilityConfig
from fluentboard_modules.mapping.depth_views import DepthView, thin_view
from fluentboard_modules.mapping.level_strips import boxed, common_headings, level_strips
from fluentboard_modules.mapping.planar_region import (
    PlanarRegion,
    as_multipolygon,
    parts_of,
    upright_axes,
)
from fluentboard_modules.mapping.remainder import Remainder
from fluentboard_modules.mapping.room_walls import is_in_wall, room_walls, without_walls
from fluentboard_modules.mapping.row_splitting import best_pair
from fluentboard_modules.mapping.side_fronts import fronts_beside
from fluentboard_modules.mapping.visibility import compare_with_views
from fluentboard_modules.simulation import furniture
from fluentboard_modules.simulation.office_furniture import plain_table
from fluentboard_modules.simulation.scene import Instance, Model, Scene
from fluentboard_modules.simulation.sensor import RgbdSensor
from fluentboard_modules.simulation.viewpoint import kinect_camera, look_at

VISIBILITY = VisibilityConfig()
TABLE = plain_table("seminar_table", 1.4, 0.7, 0.73)
SHELF = furniture.shelf(width=0.8, depth=0.38, height=1.86, compartments=5)
FLOOR = Instance("floor", furniture.floor(14.0, 14.0), Pose(0.0, 0.0, 0.0))


def cad(model: Model) -> CadModel:
    (found,) = library_of([model]).models
    return found


def view_of(*instances: Instance, eye: tuple[float, float, float], at: float = 0.6) -> DepthView:
    frame = RgbdSensor(kinect_camera(320)).look(
        Scene((FLOOR, *instances)),
        look_at(np.array(eye), np.array([0.0, 0.0, at])),
        1.0,
        np.random.default_rng(1),
    )
    return thin_view(frame, DepthNoiseConfig())


def upright(x: float, y: float, yaw: float, length: float, height: float) -> PlanarRegion:
    """A plane from the floor upwards whose normal has a heading; seen from where that points."""
    normal = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    middle = np.array([x, y, 0.5 * height])
    half = 0.5 * length
    return PlanarRegion(
        0,
        Transform.from_parts(upright_axes(normal), middle),
        MultiPolygon([box(-half, -0.5 * height, half, 0.5 * height)]),
        1000,
        0.001,
        sensor_position=middle + 2.0 * normal,
    )


def test_what_a_piece_explains_speaks_for_no_other() -> None:
    view = view_of(Instance("table", TABLE, Pose(0.0, 0.0, 0.0)), eye=(-2.0, 0.3, 1.4))
    model, rest = cad(TABLE), Remainder([view], VISIBILITY)
    before = compare_with_views(model, Standing(0, 0, 0).transform, rest.views, VISIBILITY)

    rest.take(model, Standing(0.0, 0.0, 0.0))

    after = compare_with_views(model, Standing(0, 0, 0).transform, rest.views, VISIBILITY)
    assert before.explained > 0.2
    assert after.explained < 0.05 * before.explained
    floor_before, floor_after = (
        np.count_nonzero(v.points_map[:, 2] < 0.02) for v in (view, rest.views[0])
    )
    assert floor_after > 0.9 * floor_before


def test_what_is_in_a_filled_piece_is_taken_with_it() -> None:
    block = Instance("books", furniture.shelf(width=0.6, depth=0.2), Pose(0.05, 0.0, 0.0))
    view = view_of(Instance("shelf", SHELF, Pose(0.0, 0.0, 0.0)), block, eye=(2.2, 0.4, 1.2))
    hollow, filled = (Remainder([view], VISIBILITY) for _ in range(2))

    hollow.take(cad(SHELF), Standing(0.0, 0.0, 0.0))
    filled.take(cad(SHELF), Standing(0.0, 0.0, 0.0), is_filled=True)

    in_box = [
        np.count_nonzero((abs(points[:, :2]) < (0.18, 0.38)).all(axis=1) & (points[:, 2] > 0.1))
        for points in (rest.views[0].points_map for rest in (hollow, filled))
    ]
    assert in_box[1] == 0 < in_box[0]


def test_wall_is_what_nothing_is_seen_behind() -> None:
    wall = Instance("wall", furniture.wall(12.0, 2.5), Pose.from_rpy(0.8, 0.0, 0.0, yaw=np.pi))
    view = view_of(
        wall, Instance("table", TABLE, Pose(0.0, 0.0, 0.0)), eye=(-2.2, 0.4, 1.4), at=0.9
    )
    seen = view.points_map[(view.points_map[:, 2] > 0.8) & (view.points_map[:, 0] > 0.5)]
    behind = upright(float(np.median(seen[:, 0])), 0.0, np.pi, 3.0, 1.8)
    before = upright(0.0, 0.0, np.pi, 1.4, 0.7)  # through the table: the wall is seen behind it

    walls = room_walls([behind, before], [view])

    assert walls == [behind]
    moved = without_walls([view], walls)[0]
    on_it = abs(moved.points_map - behind.centroid) < (0.01, 1.5, 0.9)
    assert not on_it.all(axis=1).any()
    assert np.array_equal(moved.depth_m > 0.0, view.depth_m > 0.0)


@pytest.mark.parametrize(
    ("x", "is_inside"), [(0.0, True), (0.28, False), (-0.5, True), (1.0, False)]
)
def test_nothing_stands_in_a_wall_or_behind_it(x: float, is_inside: bool) -> None:
    piece = BoundingBox(Pose(x, 0.0, 0.4), 0.5, 0.5, 0.8)

    wall, back = upright(0.0, 0.0, 0.0, 3.0, 2.0), upright(0.0, 0.0, 0.0, 0.5, 1.0)
    assert is_in_wall(piece, [wall]) is is_inside
    assert is_in_wall(piece, [wall], may_touch=True) is is_inside
    assert is_in_wall(piece, [back], may_touch=True) is (x < -0.1)


def test_side_of_a_shelf_says_where_its_front_is() -> None:
    model = cad(SHELF)
    # The shelf faces +x, its right side is at y = -0.4; who looks from there and from the front
    # sees the side and the front.
    side = replace(
        upright(0.0, -0.4, -0.5 * np.pi, 0.38, 1.8), sensor_position=np.array([1, -2, 1])
    )

    (front,) = fronts_beside(side, model)

    assert front.centroid[:2] == pytest.approx([0.19, 0.0], abs=1e-6)
    assert front.normal == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)
    assert front.extents_m == pytest.approx((0.8, 1.8))
    assert fronts_beside(upright(0.0, 0.0, 0.0, 1.0, 1.8), model) == []


def test_sliver_of_a_top_is_a_reason_to_look_there() -> None:
    table = Instance("table", TABLE, Pose(0.0, 0.0, 0.0))
    view = view_of(table, eye=(-4.5, 0.0, 1.25))

    strips = level_strips([view], 0.73, [0.0])

    assert len(strips) == 1
    assert np.abs(strips[0].centroid[:2]).max() < 0.4
    assert strips[0].extents_m[1] > 1.0
    assert level_strips([view], 1.1, [0.0]) == []


def test_wall_at_the_height_of_a_top_is_no_sliver() -> None:
    wall = Instance("wall", furniture.wall(4.0, 2.5), Pose.from_rpy(0.5, 0.0, 0.0, yaw=np.pi))

    assert level_strips([view_of(wall, eye=(-3.0, 0.0, 1.3), at=0.9)], 0.73, [0.0]) == []


def test_heading_of_a_room_is_that_of_most_upright_surface() -> None:
    planes = [upright(0, 0, 0.3, 3.0, 2.0), upright(0, 0, 0.3 + 0.5 * np.pi, 2.0, 2.0)]

    assert common_headings([*planes, upright(0, 0, 0.8, 0.4, 0.5)]) == pytest.approx([0.3], abs=0.1)
    assert common_headings([]) == []


@pytest.mark.parametrize("n_tables", [1, 2])
def test_two_tables_are_told_from_one_by_their_legs(n_tables: int) -> None:
    ends = [-0.7, 0.7] if n_tables == 2 else [0.0]
    tables = [Instance(f"table{k}", TABLE, Pose(0.0, y, 0.0)) for k, y in enumerate(ends)]
    # Boxes hide both ends: what is seen of the top is no longer than one table.
    hiding = [
        Instance(f"hiding{k}", furniture.wall(1.2, 1.2), Pose.from_rpy(-0.9, y, 0.0))
        for k, y in enumerate((-1.25, 1.25))
    ]
    view = view_of(*tables, *hiding, eye=(-2.6, 0.0, 1.5))

    pair = best_pair(cad(TABLE), Standing(0.0, 0.0, 0.0), [view], VISIBILITY, is_deep=True)

    assert (pair is not None) == (n_tables == 2)
    if pair is not None:
        assert sorted(one.y for one in pair) == pytest.approx([-0.7, 0.7], abs=0.15)


@pytest.mark.parametrize("neck_m", [0.0, 0.06])
def test_islands_of_a_plane_are_looked_at_one_by_one(neck_m: float) -> None:
    islands_of_it = (box(-0.5, -0.1, -0.1, 0.1), box(0.2, -0.1, 0.5, 0.1))
    neck = box(-0.2, -0.5 * neck_m, 0.3, 0.5 * neck_m)
    two = as_multipolygon(shapely.union_all([*islands_of_it, neck]))
    region = replace(upright(1.0, 2.0, 0.0, 1.0, 1.0), contour=two)

    islands = parts_of(region)

    islands.sort(key=lambda one: -one.area_m2)
    assert [one.area_m2 for one in islands] == pytest.approx([0.08, 0.06], abs=0.006)
    assert region.T_map_region.inverse().apply(islands[1].centroid[None])[0] == pytest.approx(
        [0.35, 0.0, 0.0], abs=0.02
    )
    assert parts_of(upright(0.0, 0.0, 0.0, 1.0, 1.0)) == []


def test_seats_that_noise_joins_are_looked_at_one_by_one() -> None:
    seats = (box(-0.6, -0.25, -0.05, 0.25), box(0.05, -0.25, 0.6, 0.25))
    bridge = box(-0.1, -0.08, 0.1, 0.08)
    joined = as_multipolygon(shapely.union_all([*seats, bridge]))
    level = Transform.from_parts(np.eye(3), np.array([0.0, 0.0, 0.45]))
    plane = replace(upright(0.0, 0.0, 0.0, 1.0, 1.0), contour=joined, T_map_region=level)

    found = parts_of(plane)

    assert sorted(round(one.centroid[0], 1) for one in found) == [-0.3, 0.3]


def test_small_part_of_a_top_is_turned_as_others_are() -> None:
    corner = MultiPolygon([shapely.Polygon([(0.0, 0.0), (0.3, 0.0), (0.0, 0.3)])])
    level = PlanarRegion(
        0, Transform.from_parts(np.eye(3), np.array([1.0, 2.0, 0.73])), corner, 100, 0.001
    )

    turned = boxed(level, 0.25 * np.pi)

    assert turned.height_m == pytest.approx(0.73)
    assert sorted(turned.extents_m) == pytest.approx([0.212, 0.424], abs=0.02)
    assert turned.T_map_region.rotation[:2, 0] == pytest.approx([0.7071, 0.7071], abs=1e-4)


def test_seat_below_a_top_is_no_part_of_the_table() -> None:
    model = cad(TABLE)
    top, seat = (
        replace(
            upright(0.0, 0.0, 0.0, 0.4, 0.4),
            T_map_region=Transform.from_parts(np.eye(3), np.array([0.0, 0.0, height])),
        )
        for height in (0.73, 0.45)
    )
    at = Pose(0.0, 0.0, 0.0)

    assert lies_on(top, model, at)
    assert not lies_on(seat, model, at)
