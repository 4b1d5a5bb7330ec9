"""Poses, boxes, planes and rigid transforms: where frames and units live.

Lengths are metres, angles radians, frames right-handed and the map frame has z up.
A transform is named after the two frames it joins: `T_map_camera` takes camera coordinates to
map coordinates, so in a product the inner names match (`T_map_camera @ T_camera_cup`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidGeometry

FloatArray = NDArray[np.float64]


def _finite(name: str, values: Sequence[float]) -> None:
    for value in values:
        if not math.isfinite(value):
            raise InvalidGeometry(f"{name} holds {value}; every coordinate must be a finite number")


_LAST_ROW = (0.0, 0.0, 0.0, 1.0)


def _is_rotation(rows: Sequence[Sequence[float]], tolerance: float) -> bool:
    """Whether three rows are orthonormal and right-handed.

    Plain arithmetic: transforms are made by the thousand, and numpy takes longer to begin.
    """
    (a, b, c), (d, e, f), (g, h, i) = rows
    off = max(
        abs(a * a + b * b + c * c - 1.0),
        abs(d * d + e * e + f * f - 1.0),
        abs(g * g + h * h + i * i - 1.0),
        abs(a * d + b * e + c * f),
        abs(a * g + b * h + c * i),
        abs(d * g + e * h + f * i),
    )
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    return off <= tolerance and determinant > 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Transform:
    """A rigid motion, `p_target = rotation @ p_source + translation`.

    Attributes:
        matrix: `(4, 4)`; homogeneous, its last row `0 0 0 1`, its rotation orthonormal.

    Raises:
        InvalidGeometry: the matrix is not a finite rigid motion.
    """

    matrix: FloatArray

    def __post_init__(self) -> None:
        matrix = np.asarray(self.matrix, dtype=np.float64)
        if matrix.shape != (4, 4):
            raise InvalidGeometry(f"a transform is a 4x4 matrix, got shape {matrix.shape}")
        if not np.isfinite(matrix).all():
            raise InvalidGeometry("a transform holds NaN or infinity; every entry must be finite")
        rotation = matrix[:3, :3]
        # 1e-3 admits matrices printed with four digits, as recordings often are.
        if not _is_rotation(rotation.tolist(), 1e-3):
            raise InvalidGeometry(
                "the upper left 3x3 block of a transform is not a rotation "
                f"(determinant {np.linalg.det(rotation):.4f}); remove scale, shear and mirroring"
            )
        if max(abs(a - b) for a, b in zip(matrix[3].tolist(), _LAST_ROW, strict=True)) > 1e-6:
            raise InvalidGeometry(f"the last row of a transform is 0 0 0 1, got {matrix[3]}")
        matrix = matrix.copy()
        matrix.setflags(write=False)
        object.__setattr__(self, "matrix", matrix)

    @classmethod
    def _known_rigid(cls, matrix: FloatArray) -> Transform:
        """A transform of a matrix that follows from valid ones: nothing is checked or copied."""
        transform = object.__new__(cls)
        matrix.setflags(write=False)
        object.__setattr__(transform, "matrix", matrix)
        return transform

    @classmethod
    def identity(cls) -> Transform:
        """The motion that moves nothing."""
        return cls(np.eye(4))

    @classmethod
    def from_parts(cls, rotation: FloatArray, translation: FloatArray) -> Transform:
        """A transform from a `(3, 3)` rotation and a `(3,)` translation in metres."""
        matrix = np.eye(4)
        matrix[:3, :3] = rotation
        matrix[:3, 3] = translation
        return cls(matrix)

    @classmethod
    def upright(cls, x: float, y: float, z: float, yaw_rad: float) -> Transform:
        """The motion of what stands: a turn about the vertical, then a shift in metres."""
        _finite("transform", (x, y, z, yaw_rad))
        c, s = math.cos(yaw_rad), math.sin(yaw_rad)
        rows = [[c, -s, 0.0, x], [s, c, 0.0, y], [0.0, 0.0, 1.0, z], _LAST_ROW]
        return cls._known_rigid(np.array(rows))

    @property
    def rotation(self) -> FloatArray:
        """`(3, 3)`; the rotation."""
        return self.matrix[:3, :3]

    @property
    def translation(self) -> FloatArray:
        """`(3,)`; the translation in metres."""
        return self.matrix[:3, 3]

    def apply(self, points_source: FloatArray) -> FloatArray:
        """Points `(..., 3)` of the source frame in the target frame."""
        return points_source @ self.rotation.T + self.translation

    def rotate(self, directions_source: FloatArray) -> FloatArray:
        """Directions `(..., 3)` of the source frame in the target frame."""
        return directions_source @ self.rotation.T

    def inverse(self) -> Transform:
        """The motion back: `T_a_b.inverse()` is `T_b_a`."""
        back = np.eye(4)
        back[:3, :3] = self.rotation.T
        back[:3, 3] = -back[:3, :3] @ self.translation
        return Transform._known_rigid(back)

    def __matmul__(self, other: Transform) -> Transform:
        return Transform._known_rigid(self.matrix @ other.matrix)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Transform):
            return NotImplemented
        return np.array_equal(self.matrix, other.matrix)

    def __hash__(self) -> int:
        return hash(tuple(self.matrix.flat))


@dataclass(frozen=True, slots=True)
class Pose:
    """Where something is and how it is turned: a translation and a unit quaternion.

    Attributes:
        x: metres.
        y: metres.
        z: metres, upwards in the map frame.
        qx: quaternion, x part.
        qy: quaternion, y part.
        qz: quaternion, z part.
        qw: quaternion, scalar part.

    Raises:
        InvalidGeometry: a coordinate is not finite, or the quaternion is not of unit length.
    """

    x: float
    y: float
    z: float
    qx: float = 0.0
    qy: float = 0.0
    qz: float = 0.0
    qw: float = 1.0

    def __post_init__(self) -> None:
        _finite("pose", (self.x, self.y, self.z, self.qx, self.qy, self.qz, self.qw))
        length = math.sqrt(self.qx**2 + self.qy**2 + self.qz**2 + self.qw**2)
        if abs(length - 1.0) > 1e-3:
            raise InvalidGeometry(
                f"pose has a quaternion of length {length:.4f}; divide it by its length"
            )
        if abs(length - 1.0) > 1e-9:  # as printed with a few digits; a rotation needs all of them
            for part in ("qx", "qy", "qz", "qw"):
                object.__setattr__(self, part, getattr(self, part) / length)

    @classmethod
    def from_rpy(
        cls, x: float, y: float, z: float, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0
    ) -> Pose:
        """A pose from fixed-axis roll, pitch and yaw in radians (applied in that order)."""
        _finite("pose", (x, y, z, roll, pitch, yaw))
        cr, sr = math.cos(roll / 2.0), math.sin(roll / 2.0)
        cp, sp = math.cos(pitch / 2.0), math.sin(pitch / 2.0)
        cy, sy = math.cos(yaw / 2.0), math.sin(yaw / 2.0)
        return cls(
            x,
            y,
            z,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        )

    @classmethod
    def from_transform(cls, transform: Transform) -> Pose:
        """The pose whose axes are the columns of the transform's rotation."""
        r = transform.rotation
        # Shepperd's method: divide by the largest of the four candidates, never by a small one.
        trace = float(np.trace(r))
        candidates = (trace, float(r[0, 0]), float(r[1, 1]), float(r[2, 2]))
        best = int(np.argmax(candidates))
        if best == 0:
            q = (r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], 1.0 + trace)
        elif best == 1:
            q = (
                1.0 + 2.0 * r[0, 0] - trace,
                r[0, 1] + r[1, 0],
                r[0, 2] + r[2, 0],
                r[2, 1] - r[1, 2],
            )
        elif best == 2:
            q = (
                r[0, 1] + r[1, 0],
                1.0 + 2.0 * r[1, 1] - trace,
                r[1, 2] + r[2, 1],
                r[0, 2] - r[2, 0],
            )
        else:
            q = (
                r[0, 2] + r[2, 0],
                r[1, 2] + r[2, 1],
                1.0 + 2.0 * r[2, 2] - trace,
                r[1, 0] - r[0, 1],
            )
        quaternion = np.asarray(q, dtype=np.float64)
        quaternion /= np.linalg.norm(quaternion)
        x, y, z = (float(v) for v in transform.translation)
        qx, qy, qz, qw = (float(v) for v in quaternion)
        return cls(x, y, z, qx, qy, qz, qw)

    def to_transform(self) -> Transform:
        """`T_parent_this`: takes coordinates in this pose's axes to its parent frame."""
        x, y, z, w = self.qx, self.qy, self.qz, self.qw
        rotation = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        return Transform.from_parts(rotation, np.array([self.x, self.y, self.z]))

    @property
    def rpy(self) -> tuple[float, float, float]:
        """Fixed-axis roll, pitch and yaw in radians; pitch lies in [-pi/2, pi/2]."""
        x, y, z, w = self.qx, self.qy, self.qz, self.qw
        sin_pitch = max(-1.0, min(1.0, 2.0 * (w * y - z * x)))
        if abs(sin_pitch) > 1.0 - 1e-12:  # gimbal lock: only roll -/+ yaw is defined; put it in yaw
            yaw = math.copysign(2.0, -sin_pitch) * math.atan2(x, w)
            return 0.0, math.copysign(math.pi / 2.0, sin_pitch), _wrapped(yaw)
        roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
        yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        return roll, math.asin(sin_pitch), yaw

    @property
    def yaw_rad(self) -> float:
        """The turn about the vertical in radians."""
        return self.rpy[2]


@dataclass(frozen=True, slots=True)
class BoundingBox:
    """An oriented box: the pose of its centre and its full edge lengths in metres.

    Raises:
        InvalidGeometry: a size is negative or not finite.
    """

    pose: Pose
    x_size: float
    y_size: float
    z_size: float

    def __post_init__(self) -> None:
        sizes = (self.x_size, self.y_size, self.z_size)
        _finite("bounding box", sizes)
        if min(sizes) < 0.0:
            raise InvalidGeometry(f"bounding box has a negative size {sizes}; sizes are in metres")

    @property
    def sizes(self) -> FloatArray:
        """`(3,)`; edge lengths along the box's own axes in metres."""
        return np.array([self.x_size, self.y_size, self.z_size])

    @property
    def volume_m3(self) -> float:
        """Volume in cubic metres."""
        return self.x_size * self.y_size * self.z_size

    def corners(self) -> FloatArray:
        """`(8, 3)`; the corners in the frame the pose is given in."""
        signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
        return self.pose.to_transform().apply(0.5 * signs * self.sizes)

    def contains(self, points: FloatArray) -> NDArray[np.bool_]:
        """Which of the points `(n, 3)` lie inside or on the box (a slab test in its own frame)."""
        local = self.pose.to_transform().inverse().apply(np.asarray(points, dtype=np.float64))
        return np.all(np.abs(local) <= 0.5 * self.sizes, axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class Plane:
    """The plane of all p with `normal . p = offset_m`.

    Attributes:
        normal: `(3,)`; unit length.
        offset_m: signed distance from the origin along the normal.

    Raises:
        InvalidGeometry: the normal is not of unit length.
    """

    normal: FloatArray
    offset_m: float

    def __post_init__(self) -> None:
        normal = np.asarray(self.normal, dtype=np.float64)
        length = float(np.linalg.norm(normal)) if normal.shape == (3,) else math.nan
        if not abs(length - 1.0) < 1e-6:
            raise InvalidGeometry(f"a plane's normal is a unit vector (3,), got {self.normal!r}")
        _finite("plane", (self.offset_m,))
        normal = normal.copy()
        normal.setflags(write=False)
        object.__setattr__(self, "normal", normal)

    def signed_distance(self, points: FloatArray) -> FloatArray:
        """Distances `(n,)` in metres of the points `(n, 3)`, positive on the normal's side."""
        return points @ self.normal - self.offset_m

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Plane):
            return NotImplemented
        return self.offset_m == other.offset_m and np.array_equal(self.normal, other.normal)

    def __hash__(self) -> int:
        return hash((*self.normal.flat, self.offset_m))


def _wrapped(angle_rad: float) -> float:
    return math.atan2(math.sin(angle_rad), math.cos(angle_rad))
