"""Scenes: named things with a class, a mesh and a pose; the truth behind a simulated frame."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fluentboard.errors import InvalidInput, InvalidName
from fluentboard.model.geometry import BoundingBox, FloatArray, Pose, Transform
from fluentboard_modules.simulation.mesh import Mesh
from fluentboard_modules.simulation.solids import Prism, prism_around

Colour = tuple[int, int, int]

BACKGROUND_CLASSES = frozenset({"Floor", "Wall", "Ceiling", "Building"})
"""Classes of the room itself: they carry label 0 in a label image."""


@dataclass(frozen=True, slots=True)
class Support:
    """A horizontal rectangle on which things can stand, in the frame of its model.

    Attributes:
        name: such as `top` or `board3`.
        x: centre in metres.
        y: centre in metres.
        z: height of the surface in metres.
        x_size: extent along x in metres.
        y_size: extent along y in metres.
        clearance: free height above the surface in metres.
    """

    name: str
    x: float
    y: float
    z: float
    x_size: float
    y_size: float
    clearance: float = 2.0


@dataclass(frozen=True, eq=False)
class Model:
    """What a kind of thing looks like.

    Its frame: origin at the centre of its footprint on the ground or on its support, z up, +x to
    the front (the open side of a shelf, the way a sitter on a chair looks, the tip of a fork).

    Attributes:
        name: of the model, shared by all instances.
        cls: class name in the ontology, such as `Chair`.
        mesh: metres.
        colour: RGB, 0 to 255.
        supports: where other things may stand on it.
        polished: ranges `(first, end)` of the mesh's triangles that are polished metal; a depth
            camera hardly sees it.
    """

    name: str
    cls: str
    mesh: Mesh
    colour: Colour = (160, 160, 160)
    supports: tuple[Support, ...] = ()
    polished: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True, eq=False)
class Instance:
    """One thing in a scene.

    Attributes:
        name: unique in its scene.
        model: what it looks like.
        pose: of the model's frame in the map frame.
        label: its number in label images, the same in every frame and after every change; 0 for
            the room itself. A scene gives out the numbers.
        on: name of the instance it stands on, empty for the floor.
        support: name of the support of that instance, where known.
    """

    name: str
    model: Model
    pose: Pose
    label: int = 0
    on: str = ""
    support: str = ""

    @property
    def cls(self) -> str:
        """Class name in the ontology."""
        return self.model.cls

    @cached_property
    def T_map_model(self) -> Transform:
        """Takes points of the model's frame to the map frame."""
        return self.pose.to_transform()

    @cached_property
    def vertices_map(self) -> FloatArray:
        """`(n, 3)`; the vertices in the map frame."""
        return self.T_map_model.apply(self.model.mesh.vertices)

    @cached_property
    def bounds_map(self) -> FloatArray:
        """`(2, 3)`; lowest and highest coordinates in the map frame."""
        return np.array([self.vertices_map.min(axis=0), self.vertices_map.max(axis=0)])

    @cached_property
    def prisms(self) -> tuple[Prism, ...]:
        """Its solids as upright prisms in the map frame."""
        return tuple(
            prism_around(self.vertices_map[first:end]) for first, end in self.model.mesh.solids
        )

    @cached_property
    def box(self) -> BoundingBox:
        """The model's own bounding box, placed in the map."""
        low, high = self.model.mesh.bounds
        T_model_box = Transform.from_parts(np.eye(3), 0.5 * (low + high))
        x_size, y_size, z_size = (float(v) for v in high - low)
        pose = Pose.from_transform(self.T_map_model @ T_model_box)
        return BoundingBox(pose, x_size, y_size, z_size)

    @property
    def is_background(self) -> bool:
        """Whether it is part of the room: floor, wall, building."""
        return self.cls in BACKGROUND_CLASSES


@dataclass(frozen=True, slots=True)
class SearchVolume:
    """A region where a searched object may be, in the map frame."""

    name: str
    box: BoundingBox


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything that stands in a room, in the map frame (z up, floor at z = 0, metres).

    A scene never changes: `with_instances`, `without` and `moved` return a new one, so a sensor may
    keep what it built for a scene as long as it sees the same object.

    Attributes:
        instances: the room and the things in it.
        search_volumes: named regions for an object search, if the scene defines any.
        next_label: the label the next added instance gets; labels are never used twice.

    Raises:
        InvalidName: two instances share a name, or one has none.
    """

    instances: tuple[Instance, ...] = ()
    search_volumes: tuple[SearchVolume, ...] = ()
    next_label: int = 1

    def __post_init__(self) -> None:
        seen: set[str] = set()
        labelled: list[Instance] = []
        following = max([self.next_label, *(i.label + 1 for i in self.instances)])
        for instance in self.instances:
            if not instance.name or instance.name in seen:
                raise InvalidName(
                    f"scene has the instance name {instance.name!r} twice or empty; every instance "
                    "needs a name of its own"
                )
            seen.add(instance.name)
            if instance.label == 0 and not instance.is_background:
                instance = replace(instance, label=following)
                following += 1
            labelled.append(instance)
        object.__setattr__(self, "instances", tuple(labelled))
        object.__setattr__(self, "next_label", following)

    @cached_property
    def _by_name(self) -> dict[str, Instance]:
        return {instance.name: instance for instance in self.instances}

    def __contains__(self, name: object) -> bool:
        return name in self._by_name

    def __getitem__(self, name: str) -> Instance:
        """The instance of that name.

        Raises:
            InvalidInput: the scene has none.
        """
        try:
            return self._by_name[name]
        except KeyError:
            raise InvalidInput(
                f"the scene has no instance {name!r}; it has {', '.join(sorted(self._by_name))}"
            ) from None

    @property
    def objects(self) -> tuple[Instance, ...]:
        """Everything but the room itself."""
        return tuple(i for i in self.instances if not i.is_background)

    def of_class(self, *classes: str) -> tuple[Instance, ...]:
        """The instances of any of these classes."""
        return tuple(i for i in self.instances if i.cls in classes)

    def standing_on(self, name: str) -> tuple[Instance, ...]:
        """The instances that stand directly on that one."""
        return tuple(i for i in self.instances if i.on == name)

    @cached_property
    def bounds(self) -> FloatArray:
        """`(2, 3)`; lowest and highest coordinates of everything in it."""
        if not self.instances:
            raise InvalidInput("an empty scene has no bounds; add an instance first")
        each = np.array([i.bounds_map for i in self.instances])
        return np.array([each[:, 0].min(axis=0), each[:, 1].max(axis=0)])

    def free_name(self, stem: str) -> str:
        """`stem1`, or the first number that no instance carries yet."""
        number = 1
        while f"{stem}{number}" in self._by_name:
            number += 1
        return f"{stem}{number}"

    def with_instances(self, added: Iterable[Instance]) -> Scene:
        """The scene with more instances; each gets a new label."""
        return replace(self, instances=(*self.instances, *added))

    def without(self, name: str) -> Scene:
        """The scene without that instance and without what stands on it."""
        gone = {name, *(i.name for i in self._carried_by(self[name].name))}
        return replace(self, instances=tuple(i for i in self.instances if i.name not in gone))

    def moved(self, name: str, pose: Pose, on: str | None = None, support: str = "") -> Scene:
        """The scene with that instance at another pose; what stands on it moves along.

        Args:
            name: of the instance.
            pose: the new one, in the map frame.
            on: what it stands on from now on; None leaves that as it is.
            support: name of the support of `on`.
        """
        T_new_old = pose.to_transform() @ self[name].T_map_model.inverse()
        carried = {i.name for i in self._carried_by(name)}

        def follow(instance: Instance) -> Instance:
            if instance.name == name:
                placed = replace(instance, pose=pose)
                return placed if on is None else replace(placed, on=on, support=support)
            if instance.name in carried:
                return replace(instance, pose=Pose.from_transform(T_new_old @ instance.T_map_model))
            return instance

        return replace(self, instances=tuple(follow(i) for i in self.instances))

    def _carried_by(self, name: str) -> list[Instance]:
        carried: dict[str, Instance] = {}
        waiting = [name]
        while waiting:
            for instance in self.standing_on(waiting.pop()):
                if instance.name != name and instance.name not in carried:
                    carried[instance.name] = instance
                    waiting.append(instance.name)
        return list(carried.values())
