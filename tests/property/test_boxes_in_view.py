"""The slab test of removed-object detection against the convex hull of Algorithm 4.2."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull  # pyright: ignore[reportMissingTypeStubs]

from fluentboard.model.geometry import BoundingBox, Pose, Transform
from fluentboard_modules.anchoring.config import RemovalConfig
from fluentboard_modules.anchoring.removal import Presence, look_at
from fluentboard_modules.frames.sensor_frame import Camera

CAMERA = Camera(80, 60, 70.0, 70.0, 39.5, 29.5)
EXACT = RemovalConfig(shrink_m=0.0, behind_m=0.0)


@settings(max_examples=30)
@given(
    st.floats(-0.2, 0.2),
    st.floats(0.9, 2.0),
    st.floats(0.0, 3.0),
    st.tuples(*[st.floats(0.05, 0.2)] * 3),
    st.integers(0, 1000),
)
def test_slabs_count_what_the_hull_counts(
    x: float, z: float, yaw: float, size: tuple[float, float, float], seed: int
) -> None:
    box = BoundingBox(Pose.from_rpy(x, 0.0, z, yaw=yaw), *size)
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0.5, 2.5, (CAMERA.height, CAMERA.width)).astype(np.float32)
    look = look_at(box, depth, CAMERA, Transform.identity(), EXACT)
    if look.presence is Presence.OUT_OF_VIEW:
        return
    points = (CAMERA.rays() * depth[..., None].astype(np.float64)).reshape(-1, 3)
    faces = np.unique(ConvexHull(np.vstack([box.corners(), np.zeros(3)])).equations, axis=0)
    counted = int(np.all(points @ faces[:, :3].T + faces[:, 3] <= 1e-9, axis=1).sum())
    assert abs(look.before + look.inside - counted) <= 2  # points on a face count either way
