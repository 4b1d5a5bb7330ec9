"""What happens to a scene between two visits: things are moved, removed, added, swapped."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial

import numpy as np
from pydantic import Field

from fluentboard.model.geometry import Pose, Transform
from fluentboard_modules.settings import Settings
from fluentboard_modules.simulation.placement import (
    anywhere_on,
    first_that_fits,
    fits,
    support_of,
    try_on_support,
)
from fluentboard_modules.simulation.scene import Instance, Scene


class ChangeKind(StrEnum):
    """What happened to one thing."""

    MOVED = "moved"
    REMOVED = "removed"
    ADDED = "added"
    SWAPPED = "swapped"


@dataclass(frozen=True, slots=True)
class Change:
    """One true change between two states of a scene.

    Attributes:
        kind: what happened.
        name: of the thing.
        before: its pose in the earlier scene, None if it was not there.
        after: its pose in the later scene, None if it is gone.
        partner: the other thing of a swap.
    """

    kind: ChangeKind
    name: str
    before: Pose | None
    after: Pose | None
    partner: str = ""


class ChangeConfig(Settings):
    """How many changes of which kind, and how far things move."""

    moved: int = Field(default=3, ge=0)
    removed: int = Field(default=1, ge=0)
    added: int = Field(default=1, ge=0)
    swapped: int = Field(default=0, ge=0)
    """Pairs of things of the same support that change places."""

    distance_m: tuple[float, float] = (0.05, 0.35)
    """How far a moved thing goes. Same objects on real desks moved 0.07 m (median) and 0.30 m (90th
    percentile) between recordings of one week."""

    classes: frozenset[str] = frozenset()
    """Only things of these classes change; empty: what stands on something, except books."""


def changed(
    scene: Scene, rng: np.random.Generator, config: ChangeConfig | None = None
) -> tuple[Scene, tuple[Change, ...]]:
    """The scene at the next visit, and what truly happened in between.

    Names and labels stay with their things. A change for which there is no room is not made, so the
    list may be shorter than asked for.

    Args:
        scene: the earlier state.
        rng: decides what changes and how.
        config: how many changes.
    """
    config = config if config is not None else ChangeConfig()
    untouched = [i.name for i in scene.objects if _may_change(i, config)]
    rng.shuffle(untouched)
    changes: list[Change] = []
    for _ in range(config.swapped):
        scene = _swap(scene, untouched, changes)
    for _ in range(config.removed):
        if untouched:
            after = scene.without(untouched.pop())
            gone = [i for i in scene.instances if i.name not in after]
            changes += [Change(ChangeKind.REMOVED, i.name, i.pose, None) for i in gone]
            untouched = [name for name in untouched if name in after]
            scene = after
    for _ in range(config.moved):
        scene = _move(scene, untouched, changes, rng, config)
    for _ in range(config.added):
        scene = _add(scene, untouched, changes, rng)
    return scene, tuple(changes)


def _may_change(instance: Instance, config: ChangeConfig) -> bool:
    if config.classes:
        return instance.cls in config.classes
    return bool(instance.on) and instance.cls != "Book"


def _move(
    scene: Scene,
    untouched: list[str],
    changes: list[Change],
    rng: np.random.Generator,
    config: ChangeConfig,
) -> Scene:
    while untouched:
        thing = scene[untouched.pop()]
        moved = _moved_on_support(scene, thing, rng, config) if thing.on else None
        if not thing.on:
            moved = _moved_on_floor(scene, thing, rng, config)
        if moved is None:
            continue
        after = scene.moved(thing.name, moved.pose)
        changes.append(Change(ChangeKind.MOVED, thing.name, thing.pose, moved.pose))
        return after
    return scene


def _moved_on_support(
    scene: Scene, thing: Instance, rng: np.random.Generator, config: ChangeConfig
) -> Instance | None:
    base = scene[thing.on]
    candidates = (replace(thing, pose=_strayed(thing, rng, config, 0.4)) for _ in range(60))
    rest = scene.without(thing.name)
    return first_that_fits(rest, base, support_of(base, thing.support), candidates, 0.004)


def _moved_on_floor(
    scene: Scene, thing: Instance, rng: np.random.Generator, config: ChangeConfig
) -> Instance | None:
    rest = scene.without(thing.name)
    candidates = (replace(thing, pose=_strayed(thing, rng, config, 0.2)) for _ in range(60))
    return next((c for c in candidates if fits(c, rest, 0.005)), None)


def _strayed(
    thing: Instance, rng: np.random.Generator, config: ChangeConfig, turn_rad: float
) -> Pose:
    """The pose after a step in the plane and a turn about the vertical."""
    distance = float(rng.uniform(*config.distance_m))
    angle = float(rng.uniform(-math.pi, math.pi))
    turn = Pose.from_rpy(0.0, 0.0, 0.0, yaw=float(rng.normal(0.0, turn_rad))).to_transform()
    step = distance * np.array([math.cos(angle), math.sin(angle), 0.0])
    old = thing.T_map_model
    return Pose.from_transform(
        Transform.from_parts(turn.rotation @ old.rotation, old.translation + step)
    )


def _add(
    scene: Scene, untouched: list[str], changes: list[Change], rng: np.random.Generator
) -> Scene:
    """Another thing of a kind that is there, on the same support as its like."""
    while untouched:
        like = scene[untouched.pop()]
        if not like.on:
            continue
        base = scene[like.on]
        support = support_of(base, like.support)
        # The label makes the name new for ever, even if a thing of that kind was removed before.
        name = f"{like.cls[0].lower()}{like.cls[1:]}{scene.next_label}"
        if name in scene:
            continue
        draw = partial(anywhere_on, support, rng)
        thing = try_on_support(scene, base, support, like.model, name, draw)
        if thing is not None:
            changes.append(Change(ChangeKind.ADDED, name, None, thing.pose))
            return scene.with_instances([thing])
    return scene


def _swap(scene: Scene, untouched: list[str], changes: list[Change]) -> Scene:
    """Let the first two things of one support that fit change places."""
    for first in untouched:
        for second in untouched:
            a, b = scene[first], scene[second]
            if first >= second or a.on != b.on or a.support != b.support:
                continue
            if a.model is b.model or a.model.name == b.model.name:
                continue  # nobody could tell
            after = _exchanged(scene, a, b)
            if all(fits(after[name], after, 0.002) for name in (first, second)):
                untouched.remove(first)
                untouched.remove(second)
                for thing, partner in ((a, second), (b, first)):
                    pose = after[thing.name].pose
                    changes.append(
                        Change(ChangeKind.SWAPPED, thing.name, thing.pose, pose, partner)
                    )
                return after
    return scene


def _exchanged(scene: Scene, a: Instance, b: Instance) -> Scene:
    def at(place: Instance, thing: Instance) -> Pose:
        # The support decides the height; each keeps its own way of standing.
        z = place.pose.z if not thing.on else thing.pose.z
        x, y = place.pose.x, place.pose.y
        roll, pitch, _ = thing.pose.rpy
        return Pose.from_rpy(x, y, z, roll, pitch, place.pose.yaw_rad)

    return scene.moved(a.name, at(b, a)).moved(b.name, at(a, b))
