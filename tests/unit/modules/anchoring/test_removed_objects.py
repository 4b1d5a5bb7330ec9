"""Is the object gone? Four outcomes, and what must never destroy an anchor (Algorithm 4.2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.anchoring.config import RemovalConfig
from fluentboard_modules.anchoring.removal import Look, Presence, look_at
from fluentboard_modules.frames.sensor_frame import SensorFrame

TABLE = (-0.6, 1.0, 0.70, 0.6, 1.8, 0.74)
MUG = (0.1, 1.3, 0.04, 0.74, 0.84)
PLACE = BoundingBox(Pose(0.1, 1.3, 0.79), 0.08, 0.08, 0.10)
Render = Callable[..., SensorFrame]


def look(frame: SensorFrame, box: BoundingBox = PLACE) -> Look:
    return look_at(box, frame.depth_m, frame.camera, frame.T_map_sensor, RemovalConfig())


def test_object_that_stands_there_is_present(render: Render) -> None:
    assert look(render([TABLE, MUG])).presence is Presence.PRESENT


def test_place_that_is_seen_through_is_absent(render: Render) -> None:
    seen = look(render([TABLE]))
    assert seen.presence is Presence.ABSENT
    assert seen.inside == 0  # the table below is no part of the shrunk box (E3)
    assert seen.behind == seen.pixels


def test_place_behind_something_is_occluded(render: Render) -> None:
    screen = (-0.3, 0.9, 0.74, 0.5, 0.95, 1.3)
    assert look(render([TABLE, screen])).presence is Presence.OCCLUDED
    assert look(render([TABLE, screen, MUG])).presence is Presence.OCCLUDED


def test_place_at_the_border_of_the_image_is_out_of_view(render: Render) -> None:
    assert look(render([TABLE], target=(2.0, 1.3, 0.7))).presence is Presence.OUT_OF_VIEW
    assert look(render([TABLE], target=(0.0, -1.3, 0.7))).presence is Presence.OUT_OF_VIEW


def test_too_far_or_too_near_is_out_of_view(render: Render) -> None:
    far = BoundingBox(Pose(0.0, 6.0, 0.79), 0.08, 0.08, 0.10)
    assert look(render([TABLE]), far).presence is Presence.OUT_OF_VIEW
    near = render([TABLE], eye=(0.1, 1.1, 0.9), target=(0.1, 1.3, 0.79))
    assert look(near).presence is Presence.OUT_OF_VIEW


def test_missing_depth_is_no_evidence_of_absence(render: Render) -> None:
    frame = render([TABLE, MUG])
    assert frame.labels is not None
    glass = np.where(frame.labels == 2, 0.0, frame.depth_m).astype(np.float32)
    seen = look(replace(frame, depth_m=glass))
    assert seen.presence is Presence.OCCLUDED  # E2
    assert seen.unknown > 0.5 * seen.pixels


@pytest.mark.parametrize("seed", range(3))
def test_noise_changes_nothing(render: Render, seed: int) -> None:
    noise = np.random.default_rng(seed)
    assert look(render([TABLE], noise=noise)).presence is Presence.ABSENT
    assert look(render([TABLE, MUG], noise=noise)).presence is Presence.PRESENT


def test_flat_object_keeps_some_of_its_height(render: Render) -> None:
    plate = BoundingBox(Pose(0.1, 1.3, 0.75), 0.22, 0.22, 0.02)
    here = (-0.01, 1.19, 0.74, 0.21, 1.41, 0.76)
    assert look(render([TABLE, here]), plate).presence is Presence.PRESENT
    assert look(render([TABLE]), plate).presence is Presence.ABSENT
