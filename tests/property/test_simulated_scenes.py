"""Generated scenes: nothing interpenetrates, everything stands on something, seeds repeat."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import FloatArray, Pose
from fluentboard_modules.simulation.changes import ChangeConfig, ChangeKind, changed
from fluentboard_modules.simulation.collision import all_collisions
from fluentboard_modules.simulation.furniture import table
from fluentboard_modules.simulation.navigation import costmap
from fluentboard_modules.simulation.placement import support_of
from fluentboard_modules.simulation.restaurant import RestaurantConfig, restaurant
from fluentboard_modules.simulation.rooms import furnished_room
from fluentboard_modules.simulation.scene import Instance, Scene
from fluentboard_modules.simulation.scene_json import scene_to_json
from fluentboard_modules.simulation.table_setting import TableSettingConfig, lay_table

SEEDS = range(3)
GENERATORS: list[Callable[[np.random.Generator], Scene]] = [restaurant, furnished_room]
COMPLETE = TableSettingConfig(missing=0.0)


@pytest.fixture(
    scope="module",
    params=[
        pytest.param((generator, seed), id=f"{generator.__name__}-{seed}")
        for generator in GENERATORS
        for seed in SEEDS
    ],
)
def scene(request: pytest.FixtureRequest) -> Scene:
    generator, seed = request.param
    return generator(np.random.default_rng(seed))


def feet_in_frame_of(base: Instance, thing: Instance) -> FloatArray:
    local = base.T_map_model.inverse().apply(thing.vertices_map)
    return local[local[:, 2] < local[:, 2].min() + 1e-6]


def test_nothing_reaches_into_anything(scene: Scene):
    assert all_collisions(scene) == []


def test_everything_stands_on_its_support_or_on_the_floor(scene: Scene):
    for thing in scene.objects:
        if not thing.on:
            assert thing.bounds_map[0, 2] == pytest.approx(0.0, abs=1e-6)
            continue
        base = scene[thing.on]
        support = support_of(base, thing.support)
        feet = feet_in_frame_of(base, thing)
        assert feet[:, 2] == pytest.approx(support.z, abs=1e-6)
        assert (np.abs(feet[:, 0] - support.x) <= 0.5 * support.x_size + 1e-6).all()
        assert (np.abs(feet[:, 1] - support.y) <= 0.5 * support.y_size + 1e-6).all()


def test_a_robot_finds_free_floor(scene: Scene):
    room = costmap(scene, 0.36)
    assert (room.cost == 0).mean() > 0.15


@pytest.mark.parametrize("generator", GENERATORS)
def test_the_same_seed_gives_the_same_scene(generator: Callable[[np.random.Generator], Scene]):
    first, second = (generator(np.random.default_rng(7)) for _ in range(2))
    assert scene_to_json(first) == scene_to_json(second)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_restaurant_has_two_tables_four_chairs_and_a_counter(seed: int):
    scene = restaurant(np.random.default_rng(seed))
    counted = {cls: len(scene.of_class(cls)) for cls in ("Table", "Chair", "Counter")}
    assert counted == {"Table": 2, "Chair": 4, "Counter": 1}


def test_the_size_of_the_restaurant_is_configurable(rng: np.random.Generator):
    config = RestaurantConfig(chairs_per_table=3, guests_per_table=1, shelves=0)
    scene = restaurant(rng, config)
    assert len(scene.of_class("Chair")) == 6
    assert scene.of_class("Shelf") == ()
    assert all_collisions(scene) == []


@pytest.mark.parametrize("guests", range(1, 7))
def test_forks_lie_left_and_knives_and_spoons_right_of_the_plate(
    guests: int, rng: np.random.Generator
):
    bare = Scene((Instance("table1", table(width=1.8), Pose(0.0, 0.0, 0.0)),))
    laid = lay_table(bare, "table1", guests, rng, COMPLETE)
    plates, forks = laid.of_class("Plate"), laid.of_class("Fork")
    knives, spoons = laid.of_class("Knife"), laid.of_class("Spoon")
    assert len(plates) == len(forks) == len(knives) == len(spoons) == guests
    for plate, fork, knife, spoon in zip(plates, forks, knives, spoons, strict=True):
        # Cutlery points away from its guest, so its own frame says where left is.
        seen_by_guest = [
            fork.T_map_model.rotation.T
            @ (thing.T_map_model.translation - plate.T_map_model.translation)
            for thing in (fork, knife, spoon)
        ]
        left, right, far_right = (float(v[1]) for v in seen_by_guest)
        assert left > 0.12
        assert right < -0.12
        assert far_right < right


def test_what_guests_share_stands_between_them(rng: np.random.Generator):
    bare = Scene((Instance("table1", table(width=1.4), Pose(0.0, 0.0, 0.0)),))
    laid = lay_table(bare, "table1", 2, rng, COMPLETE)
    (sign,) = laid.of_class("TableSign")
    assert np.hypot(sign.pose.x, sign.pose.y) < 0.25
    (jug,) = laid.of_class("Jug")
    for cls in ("SugarPot", "MilkPot"):
        (pot,) = laid.of_class(cls)
        assert np.hypot(pot.pose.x - jug.pose.x, pot.pose.y - jug.pose.y) < 0.25


def test_a_table_cannot_be_laid_for_more_guests_than_it_seats(rng: np.random.Generator):
    bare = Scene((Instance("table1", table(width=0.8), Pose(0.0, 0.0, 0.0)),))
    with pytest.raises(InvalidInput, match="seats 2"):
        lay_table(bare, "table1", 3, rng)


@pytest.mark.parametrize("seed", SEEDS)
def test_changes_between_visits_are_the_ones_reported(seed: int):
    before = restaurant(np.random.default_rng(seed))
    config = ChangeConfig(moved=3, removed=2, added=2, swapped=1)
    after, changes = changed(before, np.random.default_rng(seed), config)
    told: dict[ChangeKind, set[str]] = {
        kind: {c.name for c in changes if c.kind is kind} for kind in ChangeKind
    }
    names_before = {i.name for i in before.instances}
    names_after = {i.name for i in after.instances}
    assert names_before - names_after == told[ChangeKind.REMOVED]
    assert names_after - names_before == told[ChangeKind.ADDED]
    elsewhere = {n for n in names_before & names_after if before[n].pose != after[n].pose}
    assert elsewhere == told[ChangeKind.MOVED] | told[ChangeKind.SWAPPED]
    assert [len(told[k]) for k in ChangeKind] == [3, 2, 2, 2]


@pytest.mark.parametrize("seed", SEEDS)
def test_after_changes_nothing_reaches_into_anything(seed: int):
    before = restaurant(np.random.default_rng(seed))
    after, _ = changed(before, np.random.default_rng(seed), ChangeConfig(swapped=2, moved=6))
    assert all_collisions(after) == []


def test_labels_and_names_stay_with_their_things(rng: np.random.Generator):
    scene = restaurant(rng)
    labels = {i.name: i.label for i in scene.objects}
    for _ in range(3):
        scene, _ = changed(scene, rng, ChangeConfig(moved=2, removed=2, added=2))
        for instance in scene.objects:
            assert labels.setdefault(instance.name, instance.label) == instance.label
    assert len(set(labels.values())) == len(labels)


def test_a_moved_thing_goes_as_far_as_configured(rng: np.random.Generator):
    scene = restaurant(rng)
    _, changes = changed(scene, rng, ChangeConfig(moved=5, removed=0, added=0))
    for change in changes:
        assert change.before is not None
        assert change.after is not None
        gone = np.hypot(change.after.x - change.before.x, change.after.y - change.before.y)
        assert 0.05 <= gone <= 0.35 + 1e-9


def test_furniture_can_be_moved_too(rng: np.random.Generator):
    scene = restaurant(rng)
    config = ChangeConfig(moved=2, removed=0, added=0, classes=frozenset({"Chair"}))
    after, changes = changed(scene, rng, config)
    assert {scene[c.name].cls for c in changes} == {"Chair"}
    assert all_collisions(after) == []
