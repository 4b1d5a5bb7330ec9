"""Any plane in front of any camera is found with its own equation, whatever frame the map is in."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fluentboard.model.geometry import Pose
from fluentboard_modules.frames.gravity import align_with_gravity
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.mapping.config import SurfacesConfig
from fluentboard_modules.mapping.surfaces import detect_regions

CAMERA = Camera(80, 60, 72.0, 70.0, 41.0, 28.0)
angles = st.floats(-np.pi, np.pi)
poses = st.builds(
    Pose.from_rpy, st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3), angles, angles, angles
)


@settings(max_examples=40)
@given(st.floats(-0.9, 0.9), st.floats(-0.9, 0.9), st.floats(0.8, 2.5), poses)
def test_a_lone_plane_is_one_region_with_its_equation(
    lean_x: float, lean_y: float, distance_m: float, pose: Pose
) -> None:
    toward_camera = np.array([lean_x, lean_y, -1.0]) / np.sqrt(1.0 + lean_x**2 + lean_y**2)
    inverse_depth = -(CAMERA.rays() @ toward_camera) / distance_m
    assume(inverse_depth.min() > 0.2)  # the whole plane within 5 m
    T_map_sensor = pose.to_transform()
    frame = SensorFrame((1.0 / inverse_depth).astype(np.float32), CAMERA, 1.0, T_map_sensor)

    (region,) = detect_regions(frame, SurfacesConfig())

    normal = T_map_sensor.rotate(toward_camera)
    assert np.allclose(region.normal, normal, atol=2e-3)
    origin = T_map_sensor.translation
    assert abs(normal @ (region.centroid - origin) + distance_m) < 2e-3
    # A pixel covers z^2 / (fx fy) across the optical axis, and z / d times that on the plane.
    true_area = (inverse_depth**-3.0).sum() / (distance_m * CAMERA.fx * CAMERA.fy)
    assert abs(region.area_m2 - true_area) < 0.1 * true_area
    assert region.touches_edge


@settings(max_examples=50)
@given(st.lists(st.floats(-10, 10), min_size=3, max_size=3))
def test_gravity_always_ends_up_pointing_down(vector: list[float]) -> None:
    gravity = np.array(vector)
    assume(np.linalg.norm(gravity) > 1e-3)
    down = gravity / np.linalg.norm(gravity)

    rotation = align_with_gravity(gravity).rotation

    assert np.allclose(rotation @ down, (0.0, 0.0, -1.0), atol=1e-6)
    angle = np.arccos(np.clip(0.5 * (np.trace(rotation) - 1.0), -1.0, 1.0))
    needed = np.arccos(np.clip(-down[2], -1.0, 1.0))
    assert abs(angle - needed) < 1e-5  # the smallest rotation that does it
