"""Normals from inverse depth."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.mapping.config import DepthNoiseConfig, NormalsConfig
from fluentboard_modules.mapping.normals import depth_sigma_m, fit_local_planes

CAMERA = Camera(80, 60, 72.0, 72.0, 40.0, 30.0)


@pytest.mark.parametrize("normal", [(0.0, 0.0, -1.0), (0.3, 0.0, -1.0), (-0.2, 0.6, -1.0)])
def test_a_plane_has_its_own_coefficients_everywhere(normal: tuple[float, float, float]) -> None:
    unit = np.array(normal) / np.linalg.norm(normal)
    coefficients = -unit / 1.5  # the plane n . p = -1.5
    depth = (1.0 / (CAMERA.rays() @ coefficients)).astype(np.float32)

    local = fit_local_planes(depth, CAMERA, NormalsConfig(), DepthNoiseConfig())

    assert local.is_planar.mean() > 0.95
    assert np.allclose(local.coefficients[local.is_planar], coefficients, atol=1e-3)


def test_windows_across_a_depth_edge_have_no_plane() -> None:
    depth = np.full((60, 80), 2.0, np.float32)
    depth[:, :40] = 1.0

    local = fit_local_planes(depth, CAMERA, NormalsConfig(), DepthNoiseConfig())

    assert not local.is_planar[:, 38:42].any()
    assert local.is_planar[10:50, 10:30].all()


def test_unknown_depth_has_no_plane() -> None:
    depth = np.zeros((60, 80), np.float32)

    assert not fit_local_planes(depth, CAMERA, NormalsConfig(), DepthNoiseConfig()).is_planar.any()


def test_noise_of_the_sensor_does_not_hide_the_floor(
    render: Callable[..., SensorFrame], rng: np.random.Generator
) -> None:
    frame = render([], noise=rng)

    local = fit_local_planes(frame.depth_m, frame.camera, NormalsConfig(), DepthNoiseConfig())

    near = (frame.depth_m > 0.0) & (frame.depth_m < 3.0)
    assert local.is_planar[near].mean() > 0.9


def test_depth_noise_grows_with_the_square_of_the_distance() -> None:
    sigma = depth_sigma_m(np.array([0.4, 1.4, 2.4], np.float32), DepthNoiseConfig())

    assert np.allclose(sigma, [0.0012, 0.0031, 0.0088])


def test_a_table_top_seen_at_a_grazing_angle_is_a_plane(rng: np.random.Generator) -> None:
    camera = Camera(640, 120, 580.0, 580.0, 320.0, -100.0)
    coefficients = np.array([0.0, 1.0 / 0.57, 0.0])  # 0.57 m below the eye, which looks level
    # Pixels wander sideways: each reads the depth of a place beside it.
    rays = camera.rays()
    rays[..., 1] += rng.normal(0.0, 0.8 / camera.fy, rays.shape[:2])
    depth = 1.0 / (rays @ coefficients)
    depth += rng.normal(0.0, 0.0012 + 0.0019 * (depth - 0.4) ** 2)

    def planar(noise: DepthNoiseConfig) -> float:
        local = fit_local_planes(depth.astype(np.float32), camera, NormalsConfig(), noise)
        return float(local.is_planar[10:-10, 10:-10].mean())

    assert planar(DepthNoiseConfig()) > 0.9
    assert planar(DepthNoiseConfig(lateral_px=0.0)) < 0.6
