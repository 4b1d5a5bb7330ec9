"""Put things on supports and on the floor without reaching into anything."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import Pose
from fluentboard_modules.simulation.collision import collisions
from fluentboard_modules.simulation.mesh import box
from fluentboard_modules.simulation.scene import Instance, Model, Scene, Support

Place = tuple[float, float, float]
"""x and y in metres and yaw in radians, in the frame of what the thing is placed on."""


def support_of(instance: Instance, name: str = "") -> Support:
    """The support of that name, or the largest one that leaves room above it.

    Raises:
        InvalidInput: the instance has no such support.
    """
    supports = instance.model.supports
    if name:
        supports = tuple(s for s in supports if s.name == name)
    if not supports:
        raise InvalidInput(
            f"{instance.name!r} ({instance.cls}) has no support {name!r} to put things on"
        )
    return max(supports, key=lambda s: (s.clearance > 0.2, s.x_size * s.y_size))


def placed_on(base: Instance, support: Support, model: Model, name: str, place: Place) -> Instance:
    """A thing standing on a support, at a place in the frame of the base."""
    x, y, yaw = place
    low = float(model.mesh.bounds[0, 2])
    T_base_thing = Pose.from_rpy(x, y, support.z - low, yaw=yaw).to_transform()
    pose = Pose.from_transform(base.T_map_model @ T_base_thing)
    return Instance(name, model, pose, on=base.name, support=support.name)


def fits(thing: Instance, scene: Scene, gap_m: float = 0.0) -> bool:
    """Whether the thing keeps that gap to everything but what it stands on."""
    others = [i for i in scene.instances if i.name != thing.on and i.cls != "Floor"]
    return next(collisions(thing, others, -gap_m), None) is None


def try_on_support(
    scene: Scene,
    base: Instance,
    support: Support,
    model: Model,
    name: str,
    draw: Callable[[], Place],
    gap_m: float = 0.004,
    tries: int = 60,
) -> Instance | None:
    """The thing at the first drawn place that is free and wholly on the support, or None.

    Args:
        scene: what stands there already.
        base: what to put it on.
        support: where on the base.
        model: what to put there.
        name: of the new instance.
        draw: the next place to try, in the frame of the base.
        gap_m: distance to everything else.
        tries: how many places to draw.
    """
    if model.mesh.size[2] > support.clearance:
        return None
    candidates = (placed_on(base, support, model, name, draw()) for _ in range(tries))
    return first_that_fits(scene, base, support, candidates, gap_m)


def first_that_fits(
    scene: Scene, base: Instance, support: Support, candidates: Iterable[Instance], gap_m: float
) -> Instance | None:
    """The first candidate whose foot is on the support and which keeps the gap, or None."""
    for thing in candidates:
        if _stands_within(thing, base, support) and fits(thing, scene, gap_m):
            return thing
    return None


def _stands_within(thing: Instance, base: Instance, support: Support) -> bool:
    local = base.T_map_model.inverse().apply(thing.vertices_map)
    # Handles and spouts may reach over the edge, the foot of the thing may not.
    foot = local[local[:, 2] < local[:, 2].min() + 0.01]
    return bool(
        (np.abs(foot[:, 0] - support.x) <= 0.5 * support.x_size).all()
        and (np.abs(foot[:, 1] - support.y) <= 0.5 * support.y_size).all()
    )


def anywhere_on(support: Support, rng: np.random.Generator, margin_m: float = 0.06) -> Place:
    """A random place on a support, away from its edge."""
    half_x = max(0.5 * support.x_size - margin_m, 0.0)
    half_y = max(0.5 * support.y_size - margin_m, 0.0)
    return (
        support.x + float(rng.uniform(-half_x, half_x)),
        support.y + float(rng.uniform(-half_y, half_y)),
        float(rng.uniform(-math.pi, math.pi)),
    )


@dataclass(frozen=True, slots=True)
class Group:
    """Furniture that belongs together, such as a table and its chairs, around its own origin.

    Attributes:
        members: instances whose poses are in the frame of the group.
        reserved: (x, y, x size, y size) of floor that must stay free, in the frame of the group.
    """

    members: tuple[Instance, ...]
    reserved: tuple[tuple[float, float, float, float], ...] = ()

    def at(self, place: Place) -> Group:
        """The members moved to a place in the map; the reserved floor stays in the group frame."""
        T_map_group = Pose.from_rpy(place[0], place[1], 0.0, yaw=place[2]).to_transform()
        return replace(
            self,
            members=tuple(
                replace(m, pose=Pose.from_transform(T_map_group @ m.T_map_model))
                for m in self.members
            ),
        )


class FloorPlan:
    """A scene under construction, with floor that must stay free."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._free: list[Instance] = []

    def try_place(
        self, group: Group, draw: Callable[[], Place], gap_m: float, tries: int = 80
    ) -> bool:
        """Add the group at the first drawn place where it fits; False when none does.

        Args:
            group: what to add.
            draw: the next place of the group's origin to try, in the map frame.
            gap_m: distance of its members to everything else but walls.
            tries: how many places to draw.
        """
        walls = [i for i in self.scene.instances if i.cls == "Wall"]
        furniture = [i for i in self.scene.objects if not i.on]
        for _ in range(tries):
            place = draw()
            members = group.at(place).members
            free = _keep_out(group, place)
            clear = (
                all(_apart(m, walls, 0.0) and _apart(m, furniture, gap_m) for m in members)
                and all(_apart(m, self._free, 0.0) for m in members if not m.on)
                and all(_apart(f, furniture, 0.0) and _apart(f, walls, 0.0) for f in free)
            )
            if clear:
                self.scene = self.scene.with_instances(members)
                self._free += free
                return True
        return False


def _apart(thing: Instance, others: Sequence[Instance], gap_m: float) -> bool:
    return next(collisions(thing, others, -gap_m if gap_m > 0.0 else 0.001), None) is None


def _keep_out(group: Group, place: Place) -> list[Instance]:
    found: list[Instance] = []
    T_map_group = Pose.from_rpy(place[0], place[1], 0.0, yaw=place[2]).to_transform()
    for number, (x, y, x_size, y_size) in enumerate(group.reserved):
        # 10 cm above the floor, so that the slab of the floor does not count.
        model = Model("free floor", "FreeFloor", box(x_size, y_size, 1.5, (0.0, 0.0, 0.1)))
        T_group_area = Pose(x, y, 0.0).to_transform()
        pose = Pose.from_transform(T_map_group @ T_group_area)
        found.append(Instance(f"free {number}", model, pose))
    return found
