"""Poses from depth images: looking again never makes them worse, and a right one stays right."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fluentboard.model.geometry import FloatArray, Pose
from fluentboard_modules.mapping.alignment import Standing
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.config import DepthNoiseConfig, VerificationConfig
from fluentboard_modules.mapping.depth_views import DepthView, thin_view
from fluentboard_modules.mapping.placement import Looker, best_place
from fluentboard_modules.mapping.refinement import Heading
from fluentboard_modules.simulation import furniture
from fluentboard_modules.simulation.noise import NoiseConfig
from fluentboard_modules.simulation.office_furniture import (
    conference_chair,
    office_chair,
    plain_table,
)
from fluentboard_modules.simulation.scene import Instance, Model, Scene
from fluentboard_modules.simulation.sensor import RgbdSensor
from fluentboard_modules.simulation.viewpoint import kinect_camera, look_at

PIECES = (conference_chair(), office_chair(), plain_table("desk", 1.4, 0.7, 0.73))
CONFIG = VerificationConfig()
FLOOR = furniture.floor(10.0, 10.0)


@cache
def cad(number: int) -> CadModel:
    piece = PIECES[number]
    return CadModel(piece.name, piece.cls, piece.mesh)


def view_of(
    piece: Model, at: Standing, angle: float, away_m: float, noise: NoiseConfig, seed: int
) -> DepthView:
    """One look at a piece on the floor from some side."""
    scene = Scene((Instance("floor", FLOOR, Pose(0.0, 0.0, 0.0)), Instance("it", piece, at.pose)))
    eye = np.array([at.x + away_m * math.cos(angle), at.y + away_m * math.sin(angle), 1.4])
    frame = RgbdSensor(kinect_camera(160), noise).look(
        scene, look_at(eye, np.array([at.x, at.y, 0.5])), 1.0, np.random.default_rng(seed)
    )
    return thin_view(frame, DepthNoiseConfig())


def errors(found: Standing, true: Standing, order: int) -> tuple[float, float]:
    """Metres, and radians up to turns that look alike."""
    turned = math.remainder(found.yaw_rad - true.yaw_rad, 2.0 * math.pi / max(order, 1))
    return math.hypot(found.x - true.x, found.y - true.y), abs(turned)


@pytest.mark.parametrize("number", range(len(PIECES)), ids=[piece.name for piece in PIECES])
@given(yaw=st.floats(-3.1, 3.1), angle=st.floats(-3.1, 3.1), away_m=st.floats(1.5, 3.0))
@settings(max_examples=8)
def test_a_true_pose_is_kept_by_exact_images(
    number: int, yaw: float, angle: float, away_m: float
) -> None:
    true = Standing(0.4, -0.3, yaw)
    view = view_of(PIECES[number], true, angle, away_m, NoiseConfig.none(), 0)
    looker = Looker(cad(number), [view], CONFIG)

    _, best = best_place(looker, [true])

    off_m, off_rad = errors(best.standing, true, cad(number).symmetry_order)
    assert off_m < 0.01
    assert off_rad < math.radians(0.5)


@pytest.mark.parametrize("number", range(len(PIECES)), ids=[piece.name for piece in PIECES])
def test_final_poses_are_better_than_initial_ones_on_average(number: int) -> None:
    before, after = mean_errors(number, spread_m=0.03, spread_rad=0.05, heading_rad=None)

    assert (after < 0.5 * before).all()


def test_a_turn_that_a_backrest_says_well_is_not_spoilt() -> None:
    before, after = mean_errors(0, spread_m=0.01, spread_rad=0.002, heading_rad=0.002)

    assert (after <= before).all()


def mean_errors(
    number: int, *, spread_m: float, spread_rad: float, heading_rad: float | None
) -> tuple[FloatArray, FloatArray]:
    """Mean metres and radians of initial and of final poses, of one noisy view each."""
    rng = np.random.default_rng(number)
    before: list[tuple[float, float]] = []
    after: list[tuple[float, float]] = []
    order = cad(number).symmetry_order
    for seed in range(24):
        true = Standing(0.0, 0.0, float(rng.uniform(-3.1, 3.1)))
        angle, away_m = float(rng.uniform(-3.1, 3.1)), float(rng.uniform(1.5, 3.0))
        view = view_of(PIECES[number], true, angle, away_m, NoiseConfig(), seed)
        dx, dy = rng.normal(0.0, spread_m, 2).tolist()
        dyaw = float(rng.normal(0.0, spread_rad))
        start = true.moved(dx, dy, dyaw)
        heading = None if heading_rad is None else Heading(start.yaw_rad, heading_rad)
        initial, best = best_place(Looker(cad(number), [view], CONFIG, heading), [start])
        before.append(errors(initial.standing, true, order))
        after.append(errors(best.standing, true, order))
    return np.mean(before, axis=0), np.mean(after, axis=0)
