"""The truth as fluents: Listing 4.1 for a scene, Listing 4.2 for what happened to it."""

from __future__ import annotations

import pytest

from fluentboard.errors import InvalidInput
from fluentboard.model.fluent import Fluent
from fluentboard.model.geometry import Pose
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_modules.simulation.scene import Instance, Scene
from fluentboard_modules.simulation.tableware import mug
from fluentboard_modules.simulation.truth import history_fluents, scene_fluents

SCENE = Scene((Instance("mug1", mug(), Pose.from_rpy(5.59, 10.3, 0.71, yaw=-1.4)),))


def by_name(fluents: tuple[Fluent, ...]) -> dict[str, Fluent]:
    return {fluent.name: fluent for fluent in fluents}


def values(fluent: Fluent) -> dict[str, object]:
    return {statement.name: statement.value for statement in fluent.properties}


def test_a_thing_is_four_fluents_named_as_in_listing_4_1():
    fluents = scene_fluents(SCENE)
    assert [(f.name, f.class_name) for f in fluents] == [
        ("mug1", "Mug"),
        ("poseMug1_0", "Pose"),
        ("bBoxMug1_0", "BBox"),
        ("poseBBMug1_0", "Pose"),
    ]


def test_the_object_refers_to_its_pose_and_box():
    fluents = by_name(scene_fluents(SCENE))
    assert values(fluents["mug1"]) == {"hasPose": "poseMug1_0", "hasBoundingBox": "bBoxMug1_0"}
    assert values(fluents["bBoxMug1_0"])["hasPose"] == "poseBBMug1_0"


def test_the_pose_is_that_of_the_model_and_the_box_pose_its_centre():
    fluents = by_name(scene_fluents(SCENE))
    pose, centre = values(fluents["poseMug1_0"]), values(fluents["poseBBMug1_0"])
    assert pose == pytest.approx({"hasX": 5.59, "hasY": 10.3, "hasZ": 0.71, "hasYaw": -1.4})
    assert centre["hasZ"] == pytest.approx(0.71 + 0.5 * 0.095)


def test_the_box_has_the_size_of_the_mesh():
    box = values(by_name(scene_fluents(SCENE))["bBoxMug1_0"])
    size = mug().mesh.size
    assert (box["hasXSize"], box["hasYSize"], box["hasZSize"]) == pytest.approx(tuple(size))


def test_a_moved_thing_gets_new_fluents_and_its_old_ones_end():
    later = SCENE.moved("mug1", Pose(5.63, 10.24, 0.79))
    fluents = by_name(history_fluents([(None, SCENE), (100.0, later)]))
    moment = Interval.at(100.0)
    assert fluents["mug1"].finish == UNKNOWN
    assert len(fluents["mug1"].properties) == 4
    for name in ("poseMug1", "bBoxMug1", "poseBBMug1"):
        assert (fluents[f"{name}_0"].start, fluents[f"{name}_0"].finish) == (UNKNOWN, moment)
        assert (fluents[f"{name}_1"].start, fluents[f"{name}_1"].finish) == (moment, UNKNOWN)


def test_what_did_not_move_gets_no_new_fluents():
    assert history_fluents([(None, SCENE), (100.0, SCENE)]) == scene_fluents(SCENE)


def test_a_removed_thing_ends_with_its_pose():
    fluents = by_name(history_fluents([(None, SCENE), (100.0, SCENE.without("mug1"))]))
    assert fluents["mug1"].finish == Interval.at(100.0)
    assert fluents["poseMug1_0"].finish == Interval.at(100.0)


def test_a_new_thing_starts_when_it_came():
    fluents = by_name(history_fluents([(None, Scene()), (100.0, SCENE)]))
    assert fluents["mug1"].start == Interval.at(100.0)


def test_visits_out_of_order_are_refused():
    with pytest.raises(InvalidInput, match="increase"):
        history_fluents([(100.0, SCENE), (90.0, SCENE)])


def test_a_thing_that_comes_back_needs_a_new_name():
    gone = SCENE.without("mug1")
    with pytest.raises(InvalidInput, match="new name"):
        history_fluents([(None, SCENE), (1.0, gone), (2.0, SCENE)])
