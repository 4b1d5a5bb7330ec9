"""The deviations written with a pose: as large as the errors are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from fluentboard.model.geometry import FloatArray, Pose
from fluentboard_modules.mapping.alignment import Standing
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.config import DepthNoiseConfig, VerificationConfig
from fluentboard_modules.mapping.depth_views import DepthView, thin_view
from fluentboard_modules.mapping.placement import Looker, best_place
from fluentboard_modules.mapping.pose_covariance import pose_covariance
from fluentboard_modules.simulation import furniture
from fluentboard_modules.simulation.noise import NoiseConfig
from fluentboard_modules.simulation.office_furniture import plain_table
from fluentboard_modules.simulation.scene import Instance, Model, Scene
from fluentboard_modules.simulation.sensor import RgbdSensor
from fluentboard_modules.simulation.viewpoint import kinect_camera, look_at

CONFIG = VerificationConfig()
CHAIR, TABLE = furniture.chair(), plain_table("desk", 1.4, 0.7, 0.73)
SHELF = furniture.shelf()


def view_of(model: Model, eye: Sequence[float], seed: int) -> DepthView:
    scene = Scene(
        (
            Instance("floor", furniture.floor(10.0, 10.0), Pose(0.0, 0.0, 0.0)),
            Instance("piece", model, Pose(0.0, 0.0, 0.0)),
        )
    )
    frame = RgbdSensor(kinect_camera(160), NoiseConfig()).look(
        scene,
        look_at(np.array(eye), np.array([0.0, 0.0, 0.5])),
        1.0,
        np.random.default_rng(seed),
    )
    return thin_view(frame, DepthNoiseConfig())


def covariance_of(model: Model, views: list[DepthView]) -> tuple[FloatArray, FloatArray]:
    """Error and covariance of a model that stands at the origin."""
    looker = Looker(CadModel(model.name, model.cls, model.mesh), views, CONFIG)
    _, best = best_place(looker, [Standing(0.03, -0.02, 0.05)])
    refined = looker.refine(best.standing)
    at = best.standing
    error = np.array([at.x, at.y, at.yaw_rad])
    return error, pose_covariance(looker, best, refined, CONFIG.covariance)


@pytest.mark.parametrize("model", [CHAIR, TABLE], ids=["chair", "table"])
def test_squared_errors_over_their_variances_are_about_three(model: Model) -> None:
    ratios: list[float] = []
    for seed in range(10):
        angle = 2.0 * np.pi * seed / 10.0 + 0.2
        eye = (2.2 * np.cos(angle), 2.2 * np.sin(angle), 1.4)
        error, covariance = covariance_of(model, [view_of(model, eye, seed)])
        ratios.append(float(error @ np.linalg.inv(covariance) @ error))

    assert 0.05 < np.mean(ratios) < 6.0  # 3 if errors were exactly as written
    assert max(ratios) < 16.3  # one in a thousand


def test_two_looks_bind_a_pose_better_than_one() -> None:
    one, other = view_of(CHAIR, (2.0, 0.8, 1.4), 0), view_of(CHAIR, (-0.8, 2.0, 1.4), 1)

    _, single = covariance_of(CHAIR, [one])
    _, both = covariance_of(CHAIR, [one, other])

    assert np.trace(both) < np.trace(single)


def test_what_stands_in_a_shelf_makes_its_place_along_the_wall_uncertain() -> None:
    _, covariance = covariance_of(SHELF, [view_of(SHELF, (2.4, 0.3, 1.4), 0)])

    assert np.sqrt(covariance[1, 1]) > 0.9 * CONFIG.covariance.contents_m
    assert not CadModel(TABLE.name, TABLE.cls, TABLE.mesh).holds_things
