"""Fifteen tables of nine classes: the data set of Section 4.3.1, made anew."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from fluentboard.errors import InvalidInput
from fluentboard_modules.frames.sources import open_source
from fluentboard_modules.simulation.collision import collisions
from fluentboard_modules.simulation.cutlery import handled_fork, handled_knife, handled_spoon
from fluentboard_modules.simulation.drive import SimulatedDrive
from fluentboard_modules.simulation.raycasting import SceneCaster
from fluentboard_modules.simulation.table_scenes import (
    INSPECTED,
    TABLE_SCENES,
    table_scene,
    table_scene_drive,
)
from fluentboard_modules.simulation.table_service import TABLEWARE_CLASSES

SCENES = [table_scene(number) for number in range(1, TABLE_SCENES + 1)]


def test_there_are_about_as_many_objects_of_the_nine_classes_as_in_the_thesis() -> None:
    counted = Counter(thing.cls for made in SCENES for thing in made.objects)
    assert set(counted) == set(TABLEWARE_CLASSES)
    assert 130 <= counted.total() <= 160  # the thesis: 144


def test_five_scenes_are_seen_by_a_pr2_and_ten_by_calvin() -> None:
    assert Counter(made.robot.name for made in SCENES) == {"PR2": 5, "Calvin": 10}


def test_every_table_is_another_and_the_same_for_the_same_seed() -> None:
    layouts = [tuple((o.name, o.pose) for o in made.objects) for made in SCENES]
    assert len(set(layouts)) == TABLE_SCENES
    again = tuple((o.name, o.pose) for o in table_scene(4).objects)
    assert again == layouts[3]
    assert tuple((o.name, o.pose) for o in table_scene(4, seed=1).objects) != again


def test_nothing_on_a_table_reaches_into_anything_else() -> None:
    for made in SCENES[::3]:
        for thing in made.objects:
            others = [i for i in made.objects if i.name != thing.name]
            assert next(collisions(thing, others, -0.001), None) is None


def test_a_scene_that_is_not_there_is_refused() -> None:
    for number in (0, 16):
        with pytest.raises(InvalidInput, match="they are 1 to 15"):
            table_scene(number)
    with pytest.raises(InvalidInput, match="no table scene has the number 16"):
        open_source("sim:tables?scene=16")
    with pytest.raises(InvalidInput, match="no option 'scene'"):
        open_source("sim:room?scene=2")


def test_cutlery_is_of_one_size_and_only_its_handle_is_matt() -> None:
    sizes = np.array([m.mesh.size for m in (handled_fork(), handled_knife(), handled_spoon())])
    assert np.ptp(sizes[:, 0]) < 0.02
    assert np.ptp(sizes[:, 2]) < 0.006
    for model in (handled_fork(), handled_knife(), handled_spoon()):
        (first, end), *_ = model.polished
        heights = model.mesh.vertices[model.mesh.triangles[end:].ravel()]
        assert first == 0
        assert heights[:, 0].max() < 0.02  # the handle is the half away from the tip
        assert model.mesh.volume_m3 > 0.0


def test_polished_metal_gives_a_noisy_camera_no_depth() -> None:
    drive = table_scene_drive(3, width=320)
    frame = drive.read(0)
    caster = SceneCaster(drive.scene)
    hits = caster.cast_camera(drive.camera.rays().astype(np.float32), drive.poses[0])
    polished = np.append(caster.triangle_polished, False)[hits.triangle]
    assert polished.sum() > 20
    assert (frame.depth_m[polished] > 0.0).mean() < 0.35  # edges wander over it
    matt = (hits.distance < 2.0) & ~polished
    assert (frame.depth_m[matt] > 0.0).mean() > 0.9


@pytest.mark.parametrize("number", [2, 8])
def test_everything_is_seen_and_lost_from_sight_again(number: int) -> None:
    drive = open_source(f"sim:tables?scene={number}&width=80&noise=0")
    assert isinstance(drive, SimulatedDrive)
    wanted = {thing.label for thing in drive.scene.standing_on(INSPECTED)}
    seen: list[set[int]] = []
    for frame in drive:
        assert frame.labels is not None
        seen.append({int(label) for label in np.unique(frame.labels)} & wanted)
    assert len(seen) == 72
    assert {label for labels in seen for label in labels} == wanted
    assert any(not labels for labels in seen)  # on the way between two places
    assert any(0 < len(labels) < len(wanted) for labels in seen)
