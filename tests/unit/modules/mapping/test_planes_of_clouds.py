"""Planar regions of clouds without rows and columns: what they are, and what cannot be one."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from shapely.geometry import box

from fluentboard.errors import InvalidFrame
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.cloud_normals import fit_cloud_planes
from fluentboard_modules.mapping.cloud_regions import outline_of_points, regions_of_cloud
from fluentboard_modules.mapping.config import CloudConfig, ContourConfig
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.voxel_cloud import SceneCloud, VoxelCloud

SENSOR = np.array([0.0, 0.0, 2.0])


def rectangle(
    low: tuple[float, float], high: tuple[float, float], z: float, step_m: float = 0.01
) -> FloatArray:
    x, y = np.meshgrid(np.arange(low[0], high[0], step_m), np.arange(low[1], high[1], step_m))
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z)])


def fused(*parts: FloatArray) -> VoxelCloud:
    scene = SceneCloud()
    for part in parts:
        scene.add(part, SENSOR)
    return scene.voxels()


def regions(cloud: VoxelCloud) -> list[PlanarRegion]:
    return regions_of_cloud(cloud, CloudConfig(), ContourConfig())


def test_voxels_keep_the_mean_of_their_points_however_they_come(rng: np.random.Generator) -> None:
    points = rng.uniform(-1.0, 1.0, (2_000, 3))
    whole, parts = SceneCloud(0.1), SceneCloud(0.1)
    whole.add(points)
    for part in np.array_split(points, 7):
        parts.add(part)
    assert np.allclose(whole.voxels().points, parts.voxels().points)
    keys = {tuple(key) for key in np.floor(points / 0.1).astype(int).tolist()}
    assert len(whole) == len(keys)
    assert whole.voxels().counts.sum() == len(points)


def test_neighbours_are_those_of_the_grid(rng: np.random.Generator) -> None:
    scene = SceneCloud(0.1)
    scene.add(rng.uniform(-0.4, 0.4, (150, 3)))
    voxels = scene.voxels()
    cells = np.floor(voxels.points / 0.1).astype(int)
    for row, around in enumerate(voxels.neighbours):
        near = np.abs(cells - cells[row]).max(axis=1)
        assert set(around[around >= 0].tolist()) == set(np.flatnonzero(near == 1).tolist())


def test_normals_of_a_tilted_plane_are_found_and_face_the_sensor(rng: np.random.Generator) -> None:
    points = rectangle((-0.5, -0.5), (0.5, 0.5), 0.0)
    points[:, 2] = 0.3 * points[:, 0] + rng.normal(0.0, 0.003, len(points))
    planes = fit_cloud_planes(fused(points))
    inside = np.isfinite(planes.residual_m)
    true = np.array([-0.3, 0.0, 1.0]) / np.hypot(0.3, 1.0)
    angle = np.degrees(np.arccos(np.clip(planes.normals[inside] @ true, -1.0, 1.0)))
    assert np.median(angle) < 3.0


def test_a_table_above_a_floor_gives_two_regions_of_their_size() -> None:
    found = regions(
        fused(rectangle((-1.5, -1.5), (1.5, 1.5), 0.0), rectangle((-0.6, -0.4), (0.6, 0.4), 0.72))
    )
    floor, table = found
    assert floor.area_m2 == pytest.approx(9.0, rel=0.05)
    assert table.area_m2 == pytest.approx(0.96, rel=0.06)
    assert table.centroid == pytest.approx((0.0, 0.0, 0.72), abs=0.01)
    assert table.normal[2] > 0.999
    assert [region.index for region in found] == [0, 1]


def test_a_surface_that_a_shadow_parts_is_one_region_and_a_step_makes_two() -> None:
    parted = regions(
        fused(rectangle((-0.8, 0.0), (-0.04, 0.6), 0.7), rectangle((0.04, 0.0), (0.8, 0.6), 0.7))
    )
    assert len(parted) == 1
    stepped = regions(
        fused(rectangle((-0.8, 0.0), (-0.04, 0.6), 0.7), rectangle((0.04, 0.0), (0.8, 0.6), 0.76))
    )
    assert len(stepped) == 2


def test_a_hole_stays_a_hole() -> None:
    points = rectangle((-0.6, -0.6), (0.6, 0.6), 0.0)
    points = points[np.abs(points[:, :2]).max(axis=1) > 0.2]
    (region,) = regions(fused(points))
    assert region.area_m2 == pytest.approx(1.44 - 0.16, rel=0.06)


def test_the_outline_of_points_runs_half_a_cell_outside_them() -> None:
    points = rectangle((0.01, 0.01), (1.0, 0.5), 0.0, step_m=0.02)[:, :2]
    outline = outline_of_points(points, 0.02, ContourConfig())
    assert outline.symmetric_difference(box(0.0, 0.0, 1.0, 0.5)).area < 0.03


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((0, 3)),
        np.full((500, 3), np.nan),
        np.tile([[0.3, 0.2, 0.1]], (5_000, 1)),
        np.column_stack([np.linspace(0.0, 2.0, 5_000), np.zeros(5_000), np.zeros(5_000)]),
    ],
    ids=["empty", "all invalid", "one point many times", "a line"],
)
def test_what_holds_no_plane_gives_none_and_says_why(
    points: FloatArray, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        assert regions(fused(points)) == []
    assert "no planes" in caplog.text


def test_a_single_wall_without_floor_is_a_region(rng: np.random.Generator) -> None:
    flat = rectangle((0.0, 0.0), (2.0, 2.0), 0.0)
    wall = np.column_stack([np.full(len(flat), 1.5), flat[:, 0], flat[:, 1]])
    (region,) = regions(fused(wall))
    assert abs(region.normal[0]) > 0.999
    assert region.area_m2 == pytest.approx(4.0, rel=0.05)


def test_scattered_points_are_no_plane(rng: np.random.Generator) -> None:
    assert regions(fused(rng.uniform(0.0, 1.0, (20_000, 3)))) == []


def test_points_out_of_reach_are_an_error() -> None:
    with pytest.raises(InvalidFrame, match="metres"):
        SceneCloud(0.02).add(np.array([[5.0e7, 0.0, 0.0]]))
