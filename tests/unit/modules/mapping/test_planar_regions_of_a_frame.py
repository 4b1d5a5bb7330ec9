"""From a depth image to regions in the map: right place, size, height; odd input survives."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from fluentboard.model.geometry import Transform
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.mapping.config import ContourConfig, SegmentationConfig, SurfacesConfig
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.surfaces import detect_regions

CONFIG = SurfacesConfig()
Render = Callable[..., SensorFrame]


def at_height(regions: list[PlanarRegion], height_m: float) -> list[PlanarRegion]:
    return [r for r in regions if abs(r.height_m - height_m) < 0.03 and r.normal[2] > 0.95]


def test_a_table_top_is_found_with_its_size_and_height(
    render: Render, table_boxes: Any, rng: np.random.Generator
) -> None:
    (top,) = at_height(detect_regions(render(table_boxes, noise=rng), CONFIG), 0.72)

    assert top.height_m == pytest.approx(0.72, abs=0.005)
    assert top.area_m2 == pytest.approx(1.4 * 0.8, rel=0.05)
    assert sorted(top.extents_m) == pytest.approx([0.8, 1.4], abs=0.05)
    assert np.allclose(top.centroid[:2], (0.0, 1.6), atol=0.02)
    assert top.normal[2] > 0.999
    assert not top.touches_edge


def test_residuals_are_those_of_the_noise(
    render: Render, table_boxes: Any, rng: np.random.Generator
) -> None:
    (clean,) = at_height(detect_regions(render(table_boxes), CONFIG), 0.72)
    (noisy,) = at_height(detect_regions(render(table_boxes, noise=rng), CONFIG), 0.72)

    assert clean.rms_m < 1e-4
    assert 0.001 < noisy.rms_m < 0.006


def test_the_floor_runs_into_the_border_of_the_image(render: Render, table_boxes: Any) -> None:
    (floor,) = at_height(detect_regions(render(table_boxes), CONFIG), 0.0)

    assert floor.touches_edge


def test_normals_face_the_sensor(render: Render, chair_boxes: Any) -> None:
    for region in detect_regions(render(chair_boxes, width=320), CONFIG):
        assert region.normal @ (region.sensor_position - region.centroid) > 0.0


def test_seat_and_backrest_are_two_regions(render: Render, chair_boxes: Any) -> None:
    regions = detect_regions(render(chair_boxes, width=320), CONFIG)

    (seat,) = at_height(regions, 0.45)
    backs = [r for r in regions if r.normal[1] < -0.95 and r.height_m > 0.5]
    assert seat.area_m2 == pytest.approx(0.44 * 0.45, rel=0.1)
    assert len(backs) == 1
    assert backs[0].area_m2 == pytest.approx(0.44 * 0.45, rel=0.15)


def test_a_top_cut_apart_by_what_stands_in_front_stays_one_region(
    render: Render, table_boxes: Any
) -> None:
    pole = ((-0.03, 0.9, 0.0), (0.03, 0.95, 1.5))

    assert len(at_height(detect_regions(render([*table_boxes, pole]), CONFIG), 0.72)) == 1


def test_a_box_on_the_table_is_a_hole_in_its_top(render: Render, table_boxes: Any) -> None:
    parcel = ((-0.2, 1.3, 0.72), (0.2, 1.4, 0.8))

    (top,) = at_height(detect_regions(render([*table_boxes, parcel]), CONFIG), 0.72)

    assert sum(len(part.interiors) for part in top.contour.geoms) >= 1
    assert top.area_m2 < 1.4 * 0.8 - 0.4 * 0.1


def test_regions_come_largest_first_and_numbered(render: Render, table_boxes: Any) -> None:
    regions = detect_regions(render(table_boxes), CONFIG)

    assert [region.index for region in regions] == list(range(len(regions)))
    assert all(a.area_m2 >= b.area_m2 for a, b in pairwise(regions))


def test_pixels_of_a_region_lie_on_its_plane(render: Render, table_boxes: Any) -> None:
    frame = render(table_boxes)
    points = frame.points_map()
    for region in detect_regions(frame, CONFIG):
        top, left, bottom, right = region.pixel_box
        step = CONFIG.segmentation.step_px
        on_region = points[top:bottom:step, left:right:step][region.pixel_mask]
        assert np.abs(region.plane.signed_distance(on_region)).max() < 0.03


def test_the_map_frame_moves_the_regions_with_it(render: Render, table_boxes: Any) -> None:
    frame = render(table_boxes)
    T_new_map = Transform.from_parts(
        np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.array([1.0, 2.0, 0.1])
    )
    moved = SensorFrame(frame.depth_m, frame.camera, frame.stamp_s, T_new_map @ frame.T_map_sensor)

    before = detect_regions(frame, CONFIG)
    after = detect_regions(moved, CONFIG)

    assert len(before) == len(after)
    for a, b in zip(before, after, strict=True):
        assert np.allclose(T_new_map.apply(a.centroid), b.centroid, atol=1e-6)
        assert a.area_m2 == pytest.approx(b.area_m2, rel=1e-3)


CAMERA = Camera(80, 60, 72.0, 72.0, 40.0, 30.0)


def frame_of(depth: np.ndarray[Any, Any]) -> SensorFrame:
    return SensorFrame(depth.astype(np.float32), CAMERA, 1.0, Transform.identity())


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf, -1.0])
def test_an_image_without_depth_has_no_regions(value: float) -> None:
    assert detect_regions(frame_of(np.full((60, 80), value)), CONFIG) == []


def test_a_flat_constant_image_is_one_wall() -> None:
    (wall,) = detect_regions(frame_of(np.full((60, 80), 1.0)), CONFIG)

    assert wall.area_m2 == pytest.approx(80 * 60 / 72.0**2, rel=0.05)
    assert wall.touches_edge


@pytest.mark.parametrize(
    "depth",
    [
        np.where(np.random.default_rng(1).random((60, 80)) < 0.5, 1.0, 0.0),
        np.random.default_rng(2).uniform(0.5, 5.0, (60, 80)),
        np.full((60, 80), 1e-3),
        np.full((60, 80), 1e4),
        np.eye(60, 80),
    ],
    ids=["half missing", "static", "at the lens", "beyond range", "one line"],
)
def test_senseless_images_do_not_crash(depth: np.ndarray[Any, Any]) -> None:
    for region in detect_regions(frame_of(depth), CONFIG):
        assert np.isfinite(region.centroid).all()
        assert region.area_m2 > 0.0


def test_a_tiny_image_does_not_crash() -> None:
    camera = Camera(3, 2, 3.0, 3.0, 1.0, 1.0)
    frame = SensorFrame(np.ones((2, 3), np.float32), camera, 1.0, Transform.identity())

    assert detect_regions(frame, CONFIG) == []


def test_thresholds_come_from_the_configuration(render: Render, table_boxes: Any) -> None:
    frame = render(table_boxes)
    only_floor = CONFIG.model_copy(update={"contours": ContourConfig(smallest_region_m2=2.0)})
    nothing = CONFIG.model_copy(update={"segmentation": SegmentationConfig(seed_cells=100_000)})

    assert len(detect_regions(frame, only_floor)) == 1
    assert detect_regions(frame, nothing) == []
