"""Tops and the objects on them, on tables whose depth is exact or as noisy as a Kinect's."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
import shapely

from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.anchoring.config import AnchoringConfig
from fluentboard_modules.anchoring.organised import organise
from fluentboard_modules.anchoring.segmentation import Segmentation, segment
from fluentboard_modules.anchoring.supports import Top, find_tops
from fluentboard_modules.anchoring.tables import TableMap
from fluentboard_modules.frames.sensor_frame import SensorFrame

CONFIG = AnchoringConfig()
TABLE = (-0.6, 1.0, 0.70, 0.6, 1.8, 0.74)
MUG = (0.1, 1.3, 0.04, 0.74, 0.84)
CARTON = (-0.3, 1.4, 0.74, -0.2, 1.48, 0.92)
Render = Callable[..., SensorFrame]


def tops_of(frame: SensorFrame) -> list[Top]:
    points = organise(frame, CONFIG.segmentation.noise, CONFIG.supports.range_max_m)
    tops = find_tops(points, CONFIG.supports, np.random.default_rng(0))
    return [top for top in tops if top.raster.area_m2 >= CONFIG.supports.area_min_m2]


def segmented(frame: SensorFrame) -> Segmentation:
    points = organise(frame, CONFIG.segmentation.noise, CONFIG.supports.range_max_m)
    return segment(frame, points, tops_of(frame), CONFIG.segmentation)


def overlaps(frame: SensorFrame, found: Segmentation, labels: Sequence[int]) -> list[float]:
    """Of each true object the best intersection over union with a cluster."""
    assert frame.labels is not None
    return [
        max(
            (
                float(((found.labels == k) & (frame.labels == label)).sum())
                / float(((found.labels == k) | (frame.labels == label)).sum())
                for k in range(1, len(found.clusters) + 1)
            ),
            default=0.0,
        )
        for label in labels
    ]


def test_table_is_found_at_its_height_and_extent(render: Render) -> None:
    (top,) = tops_of(render([TABLE, MUG], noise=np.random.default_rng(1)))
    support = top.support()
    assert support.height_m == pytest.approx(0.74, abs=0.005)
    assert 0.75 < shapely.Polygon(support.boundary_map).area < 1.0  # of 0.96, whole patches only
    assert support.centre_map == pytest.approx([0.0, 1.4], abs=0.07)
    assert np.hypot(*support.slope) < 0.01


def test_outline_of_a_corner_table_is_not_convex(render: Render) -> None:
    wing = (-0.6, 1.8, 0.70, -0.1, 2.4, 0.74)
    (top,) = tops_of(render([TABLE, wing], target=(0.0, 1.6, 0.7)))
    outline = shapely.Polygon(top.support().boundary_map)
    assert outline.area < 0.9 * outline.convex_hull.area


def test_two_tables_are_two_tops(render: Render) -> None:
    low = (-0.6, 1.0, 0.6, -0.05, 1.8, 0.64)
    high = (0.05, 1.0, 0.70, 0.6, 1.8, 0.74)
    heights = sorted(top.support().height_m for top in tops_of(render([low, high])))
    assert heights == pytest.approx([0.64, 0.74], abs=0.005)


def test_floor_without_a_table_is_no_top(render: Render) -> None:
    assert tops_of(render([])) == []


def test_table_that_leans_a_little_is_still_a_table(render: Render) -> None:
    frame = render([TABLE], noise=np.random.default_rng(2))
    angle = np.radians(2.0)
    turn = Pose.from_rpy(0.0, 0.0, 0.0, roll=float(angle)).to_transform()
    leaning = SensorFrame(frame.depth_m, frame.camera, 1.0, turn @ frame.T_map_sensor)
    (top,) = tops_of(leaning)
    assert np.hypot(*top.support().slope) == pytest.approx(np.tan(angle), abs=0.006)


@pytest.mark.parametrize("seed", [None, 3])
def test_every_object_is_one_cluster(render: Render, seed: int | None) -> None:
    noise = None if seed is None else np.random.default_rng(seed)
    frame = render([TABLE, MUG, CARTON], noise=noise)
    found = segmented(frame)
    assert len(found.clusters) == 2
    assert min(overlaps(frame, found, [2, 3])) > 0.9


def test_boxes_have_the_size_and_place_of_the_objects(render: Render) -> None:
    carton, mug = sorted(
        segmented(render([TABLE, MUG, CARTON])).clusters, key=lambda c: c.box.pose.x
    )
    assert carton.centroid_map == pytest.approx([-0.25, 1.44, 0.83], abs=0.02)
    assert carton.box.z_size == pytest.approx(0.18, abs=0.01)
    assert mug.centroid_map[:2] == pytest.approx([0.1, 1.3], abs=0.02)
    assert mug.box.z_size == pytest.approx(0.10, abs=0.01)
    assert not mug.is_cut_off
    assert not mug.is_occluded


def test_object_before_another_is_told_from_it(render: Render) -> None:
    tall = (-0.1, 1.5, 0.74, 0.1, 1.56, 0.98)
    frame = render([TABLE, tall, (0.0, 1.3, 0.04, 0.74, 0.84)])
    found = segmented(frame)
    assert min(overlaps(frame, found, [2, 3])) > 0.9
    occluded = {bool(cluster.is_occluded) for cluster in found.clusters}
    assert occluded == {True, False}


def test_touching_cans_are_cut_at_their_waist(render: Render) -> None:
    pair = [(-0.045, 1.2, 0.045, 0.74, 0.86), (0.045, 1.2, 0.045, 0.74, 0.86)]
    frame = render([TABLE, *pair], eye=(0.0, 0.85, 1.6), target=(0.0, 1.2, 0.8))
    found = segmented(frame)
    assert len(found.clusters) == 2
    assert min(overlaps(frame, found, [2, 3])) > 0.85


def test_backrest_beyond_the_edge_is_no_object(render: Render) -> None:
    backrest = (-0.2, 1.84, 0.3, 0.2, 1.88, 0.95)
    found = segmented(render([TABLE, MUG, backrest]))
    assert len(found.clusters) == 1
    assert found.clusters[0].centroid_map[0] == pytest.approx(0.1, abs=0.02)


def test_object_at_the_border_of_the_image_is_cut_off(render: Render) -> None:
    carton = (0.1, 1.3, 0.74, 0.3, 1.4, 0.84)
    (cluster,) = segmented(render([TABLE, carton], target=(-0.45, 1.3, 0.7))).clusters
    assert cluster.is_cut_off


def test_noise_alone_makes_no_objects(render: Render) -> None:
    for seed in range(3):
        assert not segmented(render([TABLE], noise=np.random.default_rng(seed))).clusters


def test_frame_without_depth_has_nothing(render: Render) -> None:
    frame = render([TABLE])
    empty = SensorFrame(np.zeros_like(frame.depth_m), frame.camera, 1.0, frame.T_map_sensor)
    assert segmented(empty).clusters == ()


def test_what_is_hidden_of_a_table_was_seen_before(render: Render) -> None:
    tables = TableMap(CONFIG.supports)
    whole = tables.complete(tops_of(render([TABLE])))[0].raster.area_m2
    for _ in range(3):
        tables.complete(tops_of(render([TABLE])))
    half = tops_of(render([TABLE], target=(-0.9, 1.3, 0.7)))
    assert half[0].raster.area_m2 < 0.8 * whole
    (completed,) = tables.complete(half)
    assert completed.raster.area_m2 > 0.95 * whole
    assert len(tables.tables) == 1


def test_tops_take_the_name_of_the_placing_area(render: Render) -> None:
    tables = TableMap(CONFIG.supports)
    tables.know("placingAreaTable1", BoundingBox(Pose(0.0, 1.4, 0.74), 1.2, 0.8, 0.0))
    (top,) = tables.complete(tops_of(render([TABLE])))
    assert top.name == "placingAreaTable1"
    tables.forget("placingAreaTable1")
    (top,) = tables.complete(tops_of(render([TABLE])))
    assert top.name == ""


def test_what_an_object_before_it_covers_is_no_waist(render: Render) -> None:
    behind, before = (-0.2, 1.3, 0.74, 0.2, 1.36, 0.97), (-0.1, 1.1, 0.74, 0.1, 1.15, 1.02)
    found = segmented(render([TABLE, behind, before]))
    widths = sorted(max(c.box.x_size, c.box.y_size) for c in found.clusters)
    assert widths == pytest.approx([0.2, 0.4], abs=0.03)
