"""Poses and bounding boxes as fluents, and back (Listing 4.1; pure)."""

from __future__ import annotations

from collections.abc import Mapping

from fluentboard.errors import InvalidGeometry
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard.model.interval import UNKNOWN, Interval

_COORDINATES = ("hasX", "hasY", "hasZ", "hasRoll", "hasPitch", "hasYaw")
_POSITION = _COORDINATES[:3]
_DIGITS = 5  # a hundredth of a millimetre; xsd:float holds no more for places within a building
_SIZES = ("hasXSize", "hasYSize", "hasZSize")


def pose_fluent(name: str, pose: Pose, start: Interval) -> Fluent:
    """A pose as an open fluent; angles of 0 are left out, as in the listing."""
    values = dict(zip(_COORDINATES, (pose.x, pose.y, pose.z, *pose.rpy), strict=True))
    properties = tuple(
        Property(key, "xsd:float", round(float(value), _DIGITS))
        for key, value in values.items()
        if key in _POSITION or round(value, _DIGITS) != 0.0
    )
    return Fluent(name, "Pose", start, UNKNOWN, properties)


def box_fluents(name: str, pose_name: str, box: BoundingBox, start: Interval) -> list[Fluent]:
    """A bounding box and the pose of its centre as open fluents."""
    sizes = zip(_SIZES, (box.x_size, box.y_size, box.z_size), strict=True)
    properties = (
        Property("hasPose", "Pose", pose_name),
        *(Property(key, "xsd:float", round(float(size), _DIGITS)) for key, size in sizes),
    )
    return [
        Fluent(name, "BBox", start, UNKNOWN, properties),
        pose_fluent(pose_name, box.pose, start),
    ]


def pose_of(fluent: Fluent) -> Pose:
    """The pose that a fluent describes; coordinates that it leaves out are 0."""
    x, y, z, roll, pitch, yaw = (_number(fluent, key) for key in _COORDINATES)
    return Pose.from_rpy(x, y, z, roll, pitch, yaw)


def box_of(fluent: Fluent, by_name: Mapping[str, Fluent]) -> BoundingBox:
    """The box that a fluent describes.

    Args:
        fluent: of class BBox.
        by_name: fluents among which its pose is.

    Raises:
        InvalidGeometry: its pose is not among them.
    """
    poses = [by_name[str(name)] for name in fluent.values("hasPose") if str(name) in by_name]
    if not poses:
        raise InvalidGeometry(f"box {fluent.name!r} has no pose; assert the fluent it refers to")
    return BoundingBox(pose_of(poses[-1]), *(_number(fluent, key) for key in _SIZES))


def _number(fluent: Fluent, key: str) -> float:
    values = fluent.values(key)
    return float(values[-1]) if values else 0.0
