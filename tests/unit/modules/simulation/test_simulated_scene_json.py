"""Scenes as JSON: what is written is read again, and what is wrong is named."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.simulation.furniture import table
from fluentboard_modules.simulation.rooms import furnished_room
from fluentboard_modules.simulation.scene import Instance, Scene, SearchVolume
from fluentboard_modules.simulation.scene_json import (
    load_scene,
    scene_from_json,
    scene_to_json,
)
from fluentboard_modules.simulation.tableware import mug

SCENE = Scene(
    (
        Instance("table1", table(), Pose.from_rpy(2.0, 3.0, 0.0, yaw=0.3)),
        Instance("mug1", mug(), Pose.from_rpy(2.1, 3.2, 0.74, 0.0, 0.1, -2.0), on="table1"),
        Instance("mug2", mug(), Pose(2.1, 2.8, 0.74), on="table1", support="top"),
    ),
    (SearchVolume("table", BoundingBox(Pose(2.0, 3.0, 0.86), 0.8, 0.8, 0.2)),),
).without("mug2")


def written() -> dict[str, Any]:
    return json.loads(json.dumps(scene_to_json(SCENE)))


def test_a_scene_survives_json():
    again = scene_from_json(written())
    for before, after in zip(SCENE.instances, again.instances, strict=True):
        assert (after.name, after.cls, after.label) == (before.name, before.cls, before.label)
        assert (after.on, after.support) == (before.on, before.support)
        assert np.allclose(after.vertices_map, before.vertices_map, atol=1e-8)
        assert after.model.supports == before.model.supports
        assert after.model.mesh.solids == before.model.mesh.solids
    assert again.next_label == SCENE.next_label
    assert again.search_volumes == SCENE.search_volumes


def test_writing_what_was_read_gives_the_same_text():
    assert scene_to_json(scene_from_json(written())) == scene_to_json(SCENE)


def test_a_model_is_written_once():
    assert set(written()["models"]) == {"table_1400_800_740", "mug_82_95"}


def test_the_truth_of_a_recording_has_no_meshes():
    assert "models" not in scene_to_json(SCENE, meshes=False)


def without_instances(document: dict[str, Any]) -> None:
    del document["instances"]


def without_a_pose(document: dict[str, Any]) -> None:
    del document["instances"][0]["pose"]


def with_a_short_pose(document: dict[str, Any]) -> None:
    document["instances"][0]["pose"] = [1.0, 2.0]


def with_words_for_a_pose(document: dict[str, Any]) -> None:
    document["instances"][0]["pose"] = ["left"] * 6


def without_meshes(document: dict[str, Any]) -> None:
    document["models"] = {}


@pytest.mark.parametrize(
    ("damage", "complaint"),
    [
        (without_instances, "instances"),
        (without_a_pose, "pose"),
        (with_a_short_pose, "2 numbers"),
        (with_words_for_a_pose, "could not convert"),
        (without_meshes, "neither described"),
    ],
)
def test_what_is_wrong_with_a_scene_is_named(
    damage: Callable[[dict[str, Any]], None], complaint: str
):
    document = written()
    damage(document)
    with pytest.raises(InvalidInput, match=complaint):
        scene_from_json(document)


def test_things_keep_their_colours(tmp_path: Path):
    scene = furnished_room(np.random.default_rng(2))
    (tmp_path / "room.json").write_text(json.dumps(scene_to_json(scene)))
    again = load_scene(tmp_path / "room.json")
    for thing in scene.instances:
        assert again[thing.name].model.colour == thing.model.colour, thing.name
        assert again[thing.name].model.polished == thing.model.polished
