"""Furniture in rows: what touches a piece that was found, and is hardly in the image."""

from __future__ import annotations

import numpy as np
import pytest

from fluentboard.model.geometry import Pose
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.cad_library import library_of
from fluentboard_modules.mapping.config import MappingConfig, VerificationConfig
from fluentboard_modules.mapping.depth_views import thin_view
from fluentboard_modules.mapping.rules import FurnitureRules
from fluentboard_modules.mapping.single_frame import SceneFindings, find_furniture
from fluentboard_modules.mapping.surfaces import detect_regions
from fluentboard_modules.simulation import furniture
from fluentboard_modules.simulation.noise import NoiseConfig
from fluentboard_modules.simulation.office_furniture import plain_table
from fluentboard_modules.simulation.scene import Instance, Scene
from fluentboard_modules.simulation.sensor import RgbdSensor
from fluentboard_modules.simulation.viewpoint import kinect_camera, look_at

CONFIG = MappingConfig(verification=VerificationConfig(generic_models=False))
TABLE = plain_table("seminar_table", 1.4, 0.7, 0.73)


def frame_of(n_tables: int) -> SensorFrame:
    """A view along tables that touch, of which the second is cut off."""
    tables = [
        Instance(f"table{k}", TABLE, Pose.from_rpy(0.0, 1.401 * k, 0.0)) for k in range(n_tables)
    ]
    floor = Instance("floor", furniture.floor(12.0, 12.0), Pose(0.0, 0.0, 0.0))
    return RgbdSensor(kinect_camera(320), NoiseConfig()).look(
        Scene((floor, *tables)),
        look_at(np.array([-1.9, -0.2, 1.3]), np.array([0.0, -0.1, 0.6])),
        1.0,
        np.random.default_rng(3),
    )


def found_in(frame: SensorFrame, rules: FurnitureRules, threads: int = 1) -> SceneFindings:
    """What is found in a view of it, with the model of the tables known."""
    verification = CONFIG.verification.model_copy(update={"threads": threads})
    return find_furniture(
        detect_regions(frame, CONFIG.surfaces),
        [thin_view(frame, CONFIG.surfaces.noise)],
        rules,
        library_of([TABLE]),
        CONFIG.model_copy(update={"verification": verification}),
    )


@pytest.mark.parametrize("n_tables", [1, 2])
def test_tables_that_touch_are_counted_though_one_is_cut_off(
    furniture_rules: FurnitureRules, n_tables: int
) -> None:
    found = found_in(frame_of(n_tables), furniture_rules)

    places = sorted(round(piece.fit.pose.y, 1) for piece in found.furniture if piece.fit)
    assert places == [0.0, 1.4][:n_tables]


def test_several_threads_find_what_one_does(furniture_rules: FurnitureRules) -> None:
    frame = frame_of(2)

    one, three = (found_in(frame, furniture_rules, threads) for threads in (1, 3))

    looks = [
        [(judged.verdict.standing, judged.verdict.score) for judged in found.judged]
        for found in (one, three)
    ]
    assert looks[0] == looks[1]
    assert [piece.fit and piece.fit.pose for piece in one.furniture] == [
        piece.fit and piece.fit.pose for piece in three.furniture
    ]
