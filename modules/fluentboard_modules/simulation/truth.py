"""The truth about a scene as fluents, as the board would hold it (Listings 4.1 and 4.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from fluentboard.errors import InvalidInput
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_modules.simulation.scene import Instance, Scene

_STILL_M = 1e-6


def scene_fluents(scene: Scene, since_s: float | None = None) -> tuple[Fluent, ...]:
    """Four fluents for everything in a scene but the room itself: object, pose, box, box pose.

    Args:
        scene: what is there.
        since_s: since when it is there; None: since before the record began.
    """
    return history_fluents([(since_s, scene)])


def history_fluents(visits: Sequence[tuple[float | None, Scene]]) -> tuple[Fluent, ...]:
    """The true fluents after several visits.

    What moved between two visits has its pose, box and box pose ended at the later one and gets
    new ones; what is gone is ended; what is new starts then.

    Args:
        visits: time and scene of each, in time order; only the first time may be None (unknown).

    Raises:
        InvalidInput: the times do not increase.
    """
    tracks: dict[str, _Track] = {}
    previous_s: float | None = None
    for number, (time_s, scene) in enumerate(visits):
        if number > 0 and (time_s is None or (previous_s is not None and time_s <= previous_s)):
            raise InvalidInput(
                f"visit {number} is at {time_s} s after {previous_s} s; times must increase"
            )
        previous_s = time_s
        now = UNKNOWN if time_s is None else Interval.at(time_s)
        present = {instance.name: instance for instance in scene.objects}
        for name, track in tracks.items():
            if track.finish is None and name not in present:
                track.vanish(now)
        for name, instance in present.items():
            if name not in tracks:
                tracks[name] = _Track(name, instance.cls, now)
            elif tracks[name].finish is not None:
                raise InvalidInput(
                    f"{name!r} was gone before visit {number} and is back; a thing that was "
                    "removed and comes again needs a new name"
                )
            tracks[name].see(instance, now)
    return tuple(fluent for track in tracks.values() for fluent in track.fluents())


@dataclass(slots=True)
class _Place:
    pose: Pose
    box: BoundingBox
    start: Interval
    finish: Interval = UNKNOWN


@dataclass(slots=True)
class _Track:
    """One thing and where it was."""

    name: str
    cls: str
    start: Interval
    finish: Interval | None = None
    places: list[_Place] = field(default_factory=list)

    def see(self, instance: Instance, now: Interval) -> None:
        if self.places and _same(self.places[-1].pose, instance.pose):
            return
        if self.places:
            self.places[-1].finish = now
        self.places.append(_Place(instance.pose, instance.box, now))

    def vanish(self, now: Interval) -> None:
        self.finish = now
        self.places[-1].finish = now

    def fluents(self) -> list[Fluent]:
        stem = self.name[:1].upper() + self.name[1:]
        statements: list[Property] = []
        parts: list[Fluent] = []
        for number, place in enumerate(self.places):
            pose, box, centre = (f"{kind}{stem}_{number}" for kind in ("pose", "bBox", "poseBB"))
            statements += [
                Property("hasPose", "Pose", pose),
                Property("hasBoundingBox", "BBox", box),
            ]
            held = Fluent(pose, "Pose", place.start, place.finish, pose_properties(place.pose))
            sizes = [
                ("hasXSize", place.box.x_size),
                ("hasYSize", place.box.y_size),
                ("hasZSize", place.box.z_size),
            ]
            parts += [
                held,
                Fluent(
                    box,
                    "BBox",
                    place.start,
                    place.finish,
                    (
                        Property("hasPose", "Pose", centre),
                        *(Property(key, "xsd:float", value) for key, value in sizes),
                    ),
                ),
                replace(held, name=centre, properties=pose_properties(place.box.pose)),
            ]
        finish = UNKNOWN if self.finish is None else self.finish
        return [Fluent(self.name, self.cls, self.start, finish, tuple(statements)), *parts]


def pose_properties(pose: Pose) -> tuple[Property, ...]:
    """The properties of a `Pose` fluent; roll and pitch are left out where they are 0."""
    roll, pitch, yaw = pose.rpy
    values = [("hasX", pose.x), ("hasY", pose.y), ("hasZ", pose.z)]
    values += [
        (key, angle) for key, angle in (("hasRoll", roll), ("hasPitch", pitch)) if abs(angle) > 1e-9
    ]
    values.append(("hasYaw", yaw))
    return tuple(Property(key, "xsd:float", float(value)) for key, value in values)


def _same(a: Pose, b: Pose) -> bool:
    # A quaternion and its negative are the same rotation.
    dot = a.qx * b.qx + a.qy * b.qy + a.qz * b.qz + a.qw * b.qw
    still = max(abs(a.x - b.x), abs(a.y - b.y), abs(a.z - b.z)) < _STILL_M
    return still and abs(dot) > 1.0 - 1e-10
