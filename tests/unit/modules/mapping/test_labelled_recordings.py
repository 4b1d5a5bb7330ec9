"""Any recording with labels is evaluated like the simulated rooms."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from fluentboard.errors import InvalidInput
from fluentboard_modules.mapping.evaluate import evaluate_recording
from fluentboard_modules.mapping.labels import labels_beside, read_labels
from fluentboard_modules.simulation.drive import table_drive
from fluentboard_modules.simulation.restaurant import restaurant
from fluentboard_modules.simulation.simulate import simulate
from fluentboard_modules.simulation.viewpoint import kinect_camera

CLASSES = ("Chair", "Table")
LABELS = """
furniture:
  - class: Table
    name: desk
    pose: {x: 1.0, y: 2.0, yaw_deg: 90}
    size: [1.4, 0.8, 0.74]
  - {class: Chair, pose: {x: 0.5, y: 2.0}, size: [0.4, 0.4, 0.9]}
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "labels.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_labels_stand_on_the_floor_at_their_pose(tmp_path: Path) -> None:
    desk, chair = read_labels(written(tmp_path, LABELS), CLASSES)
    assert (desk.name, desk.class_name, chair.name) == ("desk", "Table", "Chair2")
    assert (desk.box.pose.z, desk.box.z_size) == (0.37, 0.74)
    assert desk.box.pose.yaw_rad == pytest.approx(0.5 * np.pi)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("furniture: [", "labels"),
        ("[]", "give a list `furniture`"),
        ("furniture: [{class: Table}]", "furniture.0.pose: field required"),
        (LABELS.replace("Table", "Piano"), "piece 1: no class 'Piano'"),
        (LABELS.replace("0.8,", "0.0,"), "piece 1: sizes"),
        (LABELS.replace("1.0", ".nan"), "furniture.0.pose.x"),
        ("--- !Fluent\nnonsense", "labels.yaml"),
    ],
)
def test_bad_labels_say_where_and_what(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InvalidInput, match="labels") as refused:
        read_labels(written(tmp_path, text), CLASSES)
    assert said in str(refused.value)


def test_labels_that_are_not_there_are_asked_for(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="--labels FILE"):
        labels_beside(str(tmp_path / "recording"))


def test_simulated_recording_is_rated_against_its_truth(tmp_path: Path) -> None:
    scene = restaurant(np.random.default_rng(0))
    camera = kinect_camera(320)
    drive = table_drive(scene, "table1", 0, 8, clearance_m=0.9, camera=camera)
    simulate(drive, tmp_path / "around")

    trial = evaluate_recording(str(tmp_path / "around"), output=tmp_path / "kept.json")

    table = trial.rows["Table"]
    assert (table.true_positives, table.false_positives) == (1, 0)
    assert table.final_m[0] < 0.1
    assert table.final_rad[0] < 0.1
    # The other tables of the restaurant are not in the picture.
    assert table.false_negatives == len(scene.of_class("Table")) - 1
    kept = json.loads((tmp_path / "kept.json").read_text())
    assert kept["rows"]["Table"]["precision"] == 1.0
