"""Visits and what `simulate` writes: changes are told, the same seed gives the same bytes."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from fluentboard.errors import InvalidInput
from fluentboard.model.yaml_format import read_fluents
from fluentboard_modules.frames.folders import open_folder
from fluentboard_modules.frames.simulated_sources import drive_of
from fluentboard_modules.frames.sources import open_source
from fluentboard_modules.simulation.drive import SimulatedDrive
from fluentboard_modules.simulation.scene_json import load_scene
from fluentboard_modules.simulation.simulate import simulate
from fluentboard_modules.simulation.visits import visits

SHORT = {"frames": "3", "width": "64"}


def contents(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture(scope="module")
def drive() -> SimulatedDrive:
    return drive_of("tables?scene=2", SHORT)


@pytest.fixture(scope="module")
def written(drive: SimulatedDrive, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("simulated") / "twice"
    told: list[tuple[int, int]] = []
    made = simulate(drive, folder, 2, lambda done, total: told.append((done, total)))
    assert told == [(k + 1, 6) for k in range(6)]
    assert made.frames == 6
    return folder


def test_the_same_seed_gives_the_same_bytes(written: Path, tmp_path: Path) -> None:
    simulate(drive_of("sim:tables?scene=2", SHORT), tmp_path / "again", 2)
    assert contents(tmp_path / "again") == contents(written)
    simulate(drive_of("tables?scene=2&seed=1", SHORT), tmp_path / "other")
    assert contents(tmp_path / "other") != contents(written / "visit1")


def test_a_later_visit_is_a_source_of_its_own(written: Path) -> None:
    source = open_source("sim:tables?scene=2&frames=3&width=64&visit=2")
    for frame, again in zip(source, open_folder(written / "visit2"), strict=True):
        assert frame.stamp_s == pytest.approx(again.stamp_s)
        assert np.abs(frame.depth_m - again.depth_m).max() <= 0.0005 + 1e-6


def test_every_change_between_visits_is_in_the_scenes(drive: SimulatedDrive) -> None:
    first, second = visits(drive, 2)
    before, after = first.drive.scene, second.drive.scene
    kinds = {change.kind.value for change in second.changes}
    assert kinds == {"moved", "removed", "added", "swapped"}
    for change in second.changes:
        assert (change.name in before) == (change.before is not None)
        assert (change.name in after) == (change.after is not None)
        if change.after is not None:
            assert after[change.name].pose == change.after
    changed = {change.name for change in second.changes}
    for thing in before.objects:
        if thing.name not in changed:
            assert after[thing.name].pose == thing.pose
    assert second.drive.start_s > first.drive.start_s + 600.0


def test_the_truth_is_there_as_fluents_and_as_json(drive: SimulatedDrive, written: Path) -> None:
    fluents = list(read_fluents((written / "truth.yaml").read_text().splitlines()))
    changes = json.loads((written / "changes.json").read_text())
    names = {fluent.name for fluent in fluents}
    assert {thing.name for thing in drive.scene.objects} <= names
    for change in changes:
        (fluent,) = (f for f in fluents if f.name == change["name"])
        poses = [p for p in fluent.properties if p.name == "hasPose"]
        assert len(poses) == (2 if change["kind"] in ("moved", "swapped") else 1)
        assert (fluent.finish.latest is not None) == (change["kind"] == "removed")
        assert (fluent.start.latest is not None) == (change["kind"] == "added")


def test_the_truth_of_a_recording_is_a_scene_with_its_models(
    drive: SimulatedDrive, written: Path
) -> None:
    scene = load_scene(written / "visit1" / "truth.json")
    assert [i.name for i in scene.instances] == [i.name for i in drive.scene.instances]
    for thing, again in zip(drive.scene.objects, scene.objects, strict=True):
        assert again.label == thing.label
        assert again.bounds_map == pytest.approx(thing.bounds_map, abs=1e-5)


def test_a_folder_with_something_in_it_is_left_alone(drive: SimulatedDrive, written: Path) -> None:
    with pytest.raises(InvalidInput, match="not empty"):
        simulate(drive, written)


@pytest.mark.parametrize(
    ("scene", "asked", "message"),
    [
        ("ballroom", {}, "no simulated scene is called 'ballroom'"),
        ("room?seed=1", {"seed": "2"}, "seed is given twice"),
        ("room", {"robot": "R2D2"}, "no robot is called 'R2D2'; give one of PR2"),
        ("nowhere/scene.json", {}, "cannot read the scene"),
        ("room?visit=0", {}, "visit=0; give a whole number of at least 1"),
    ],
)
def test_a_mistaken_wish_is_explained(scene: str, asked: dict[str, str], message: str) -> None:
    with pytest.raises(InvalidInput, match=message):
        drive_of(scene, asked)


def test_a_scene_file_can_be_driven_through(drive: SimulatedDrive, written: Path) -> None:
    again = drive_of(str(written / "visit1" / "truth.json"), {"frames": "4", "width": "32"})
    assert len(list(again)) == 4
    assert len(again.scene.objects) == len(drive.scene.objects)
