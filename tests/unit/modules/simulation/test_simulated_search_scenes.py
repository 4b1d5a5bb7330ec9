"""A pepper mill is hidden so that it has to be searched for, and can be found."""

from __future__ import annotations

import numpy as np
import pytest

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import BoundingBox
from fluentboard_modules.simulation.noise import NoiseConfig
from fluentboard_modules.simulation.robots import CALVIN, View
from fluentboard_modules.simulation.scene import Scene
from fluentboard_modules.simulation.search_scenes import SearchScene, hidden_pepper_mill


@pytest.fixture(scope="module")
def made() -> SearchScene:
    return hidden_pepper_mill(6)


def inside(scene: Scene, box: BoundingBox, name: str) -> bool:
    centre = scene[name].box.pose.to_transform().translation
    local = box.pose.to_transform().inverse().apply(centre)
    return bool((np.abs(local) <= 0.5 * np.array(box.sizes) + 1e-6).all())


def test_there_is_one_mill_and_it_is_in_the_volume_that_the_truth_names(made: SearchScene) -> None:
    (mill,) = made.scene.of_class("PepperMill")
    assert mill.name == made.target
    holding = [v.name for v in made.scene.search_volumes if inside(made.scene, v.box, mill.name)]
    assert holding == [made.hidden_in]


def test_there_are_six_volumes_as_in_the_thesis(made: SearchScene) -> None:
    assert len(made.scene.search_volumes) == 6


def test_the_same_seed_hides_it_in_the_same_place(made: SearchScene) -> None:
    again = hidden_pepper_mill(6)
    assert again.scene[again.target].pose == made.scene[made.target].pose
    assert hidden_pepper_mill(7).scene[made.target].pose != made.scene[made.target].pose


def test_the_robot_does_not_see_it_from_the_start(made: SearchScene) -> None:
    robot = made.robot(noise=NoiseConfig.none(), image_width=160)
    frame = robot.sense()
    assert frame.labels is not None
    assert made.scene[made.target].label not in frame.labels
    assert 0.0 < made.visible_share < 0.7


def test_the_robot_sees_it_from_somewhere(made: SearchScene) -> None:
    robot = made.robot(noise=NoiseConfig.none(), image_width=160)
    mill = made.scene[made.target]
    x, y, _ = mill.T_map_model.translation
    seen = False
    for angle in np.linspace(-np.pi, np.pi, 24):
        stand = (float(x + 1.2 * np.cos(angle)), float(y + 1.2 * np.sin(angle)))
        if not robot.costmap.is_free(*stand):
            continue
        robot.move_to(View(*stand, float(angle + np.pi), 0.1, 0.0, 0.4))
        labels = robot.sense().labels
        assert labels is not None
        seen = seen or bool((labels == mill.label).sum() > 10)
    assert seen


def test_a_robot_with_a_fixed_head_can_search_too(made: SearchScene) -> None:
    robot = made.robot(CALVIN, image_width=80)
    assert robot.view.tilt_rad == pytest.approx(CALVIN.tilt_rad[0])
    assert robot.sense().depth_m.any()


def test_a_second_room_lies_behind_a_door() -> None:
    made = hidden_pepper_mill(1, rooms=2)
    robot = made.robot(image_width=64)
    west, east = (made.scene[name].box.pose for name in ("table1", "table2"))
    assert west.x < made.scene["partition1"].pose.x < east.x
    way = robot.costmap.path((made.start.x, made.start.y), (1.5, 3.4))
    through = way.points[np.abs(way.points[:, 0] - made.scene["partition1"].pose.x).argmin()]
    assert 2.9 < through[1] < 3.95
    assert len(made.scene.search_volumes) == 6
    with pytest.raises(InvalidInput, match="3 rooms"):
        hidden_pepper_mill(1, rooms=3)
