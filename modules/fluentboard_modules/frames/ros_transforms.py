"""TransformTree: where frames were relative to each other, from recorded ROS transforms."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, field

import numpy as np

from fluentboard.errors import InvalidFrame
from fluentboard.model.geometry import FloatArray, Pose, Transform

# Preferred in this order, as REP 105 names them.
_FIXED_FRAMES = ("map", "odom", "world")
_END_TOLERANCE_S = 0.1  # a transform published at 10 Hz may end that long before the last image
_LONGEST_GAP_S = 5.0


@dataclass
class _Edge:
    """All that is known about a frame relative to its parent."""

    parent: str
    is_static: bool
    stamps_s: list[float] = field(default_factory=list[float])
    transforms: list[Transform] = field(default_factory=list[Transform])


class TransformTree:
    """Frames, each with a parent, whose relative poses are interpolated between recorded ones."""

    def __init__(self) -> None:
        self._edges: dict[str, _Edge] = {}
        self._is_sorted = True

    def add(
        self, parent: str, child: str, stamp_s: float, T_parent_child: Transform, *, is_static: bool
    ) -> None:
        """Takes in one recorded transform; a frame that changes its parent keeps the new one."""
        parent, child = frame_name(parent), frame_name(child)
        edge = self._edges.get(child)
        if edge is None or edge.parent != parent or edge.is_static != is_static:
            edge = self._edges[child] = _Edge(parent, is_static)
        if is_static:
            edge.stamps_s, edge.transforms = [stamp_s], [T_parent_child]
            return
        edge.stamps_s.append(stamp_s)
        edge.transforms.append(T_parent_child)
        self._is_sorted = False

    @property
    def frames(self) -> list[str]:
        """All frames, sorted by name."""
        return sorted({*self._edges, *(edge.parent for edge in self._edges.values())})

    def fixed_frame(self, frame: str) -> str:
        """The frame that poses of `frame` are best given in: map, odom, world or the root."""
        chain = self._chain(frame_name(frame))
        return next((name for name in _FIXED_FRAMES if name in chain), chain[-1])

    def moves(self, frame: str) -> bool:
        """Some transform above the frame changes with time."""
        chain = self._chain(frame_name(frame))
        return any(name in self._edges and not self._edges[name].is_static for name in chain)

    def lookup(self, target: str, source: str, stamp_s: float) -> Transform:
        """`T_target_source` at a time.

        Args:
            target: name of a frame.
            source: name of another one.
            stamp_s: the time, on the axis of the recorded stamps.

        Raises:
            InvalidFrame: the frames are not connected, or not at that time.
        """
        target, source = frame_name(target), frame_name(source)
        up_from_target, up_from_source = self._chain(target), self._chain(source)
        common = next((name for name in up_from_source if name in up_from_target), None)
        if common is None:
            raise InvalidFrame(
                f"no transform between {target!r} and {source!r}; the frames of the recording are "
                f"{', '.join(self.frames) or 'none'}"
            )
        T_common_target = self._climb(target, common, stamp_s)
        return T_common_target.inverse() @ self._climb(source, common, stamp_s)

    def _chain(self, frame: str) -> list[str]:
        chain = [frame]
        while (edge := self._edges.get(chain[-1])) is not None:
            if edge.parent in chain:
                raise InvalidFrame(
                    f"the recorded transforms go in a circle: {' -> '.join([*chain, edge.parent])}"
                )
            chain.append(edge.parent)
        return chain

    def _climb(self, frame: str, ancestor: str, stamp_s: float) -> Transform:
        self._sort()
        found = Transform.identity()
        while frame != ancestor:
            edge = self._edges[frame]
            found = _at(edge, frame, stamp_s) @ found
            frame = edge.parent
        return found

    def _sort(self) -> None:
        if self._is_sorted:
            return
        for edge in self._edges.values():
            order = np.argsort(edge.stamps_s, kind="stable")
            edge.stamps_s = [edge.stamps_s[place] for place in order]
            edge.transforms = [edge.transforms[place] for place in order]
        self._is_sorted = True


def frame_name(name: str) -> str:
    """The name without the slash that ROS 1 allowed in front of it."""
    return name.removeprefix("/")


def interpolated(before: Transform, after: Transform, share: float) -> Transform:
    """The motion a share of the way from one to another, at constant speeds.

    Args:
        before: at share 0.
        after: at share 1.
        share: in [0, 1].
    """
    a, b = _quaternion(before), _quaternion(after)
    cosine = float(a @ b)
    if cosine < 0.0:  # the two signs of a quaternion are the same rotation; take the short way
        b, cosine = -b, -cosine
    angle = float(np.arccos(min(1.0, cosine)))
    if angle < 1e-6:
        turned = (1.0 - share) * a + share * b
    else:
        turned = (np.sin((1.0 - share) * angle) * a + np.sin(share * angle) * b) / np.sin(angle)
    turned /= np.linalg.norm(turned)
    place = (1.0 - share) * before.translation + share * after.translation
    x, y, z = (float(value) for value in place)
    qx, qy, qz, qw = (float(value) for value in turned)
    return Pose(x, y, z, qx, qy, qz, qw).to_transform()


def _quaternion(transform: Transform) -> FloatArray:
    pose = Pose.from_transform(transform)
    return np.array([pose.qx, pose.qy, pose.qz, pose.qw])


def _at(edge: _Edge, child: str, stamp_s: float) -> Transform:
    if edge.is_static:
        return edge.transforms[0]
    stamps_s = edge.stamps_s
    first_s, last_s = stamps_s[0], stamps_s[-1]
    if not first_s - _END_TOLERANCE_S <= stamp_s <= last_s + _END_TOLERANCE_S:
        raise InvalidFrame(
            f"the transform {edge.parent!r} -> {child!r} is recorded from {first_s:.3f} to "
            f"{last_s:.3f} s, not at {stamp_s:.3f} s"
        )
    after = bisect_left(stamps_s, stamp_s)
    if after == 0:
        return edge.transforms[0]
    if after == len(stamps_s):
        return edge.transforms[-1]
    gap_s = stamps_s[after] - stamps_s[after - 1]
    if gap_s > _LONGEST_GAP_S:
        nearest = min(after - 1, after, key=lambda place: abs(stamps_s[place] - stamp_s))
        if abs(stamps_s[nearest] - stamp_s) <= _END_TOLERANCE_S:
            return edge.transforms[nearest]
        raise InvalidFrame(
            f"the transform {edge.parent!r} -> {child!r} has a gap of {gap_s:.1f} s around "
            f"{stamp_s:.3f} s"
        )
    share = (stamp_s - stamps_s[after - 1]) / gap_s
    return interpolated(edge.transforms[after - 1], edge.transforms[after], share)
