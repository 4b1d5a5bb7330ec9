"""A few frames kept for pictures, and the way that the camera took."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.furniture_item import FurnitureItem

_FRAMES_KEPT = 32  # of about 2 MB each
_SEAT_M = 0.5  # a height at which most furniture has its middle


class Album:
    """Keeps some frames, spread evenly over all that were added."""

    def __init__(self) -> None:
        self._frames: list[SensorFrame] = []
        self._positions: list[FloatArray] = []
        self._keep_every = 1

    @property
    def frames(self) -> Sequence[SensorFrame]:
        """The frames kept, in order."""
        return self._frames

    @property
    def path_map(self) -> FloatArray:
        """`(n, 3)`; where the camera was, in order."""
        return np.array(self._positions).reshape(-1, 3)

    def add(self, frame: SensorFrame) -> None:
        """Looks at one more frame."""
        if len(self._positions) % self._keep_every == 0:
            self._frames.append(frame)
        self._positions.append(frame.T_map_sensor.translation)
        if len(self._frames) > _FRAMES_KEPT:
            self._frames = self._frames[::2]
            self._keep_every *= 2

    def best(self, furniture: Sequence[FurnitureItem]) -> SensorFrame | None:
        """The frame with most furniture near its middle; None if there is no frame."""
        return max(self._frames, key=lambda frame: _in_view(frame, furniture), default=None)


def _in_view(frame: SensorFrame, furniture: Sequence[FurnitureItem]) -> float:
    """A piece in the middle of the image counts 1, one at its border or outside 0."""
    T_sensor_map = frame.T_map_sensor.inverse()
    half = 0.5 * np.array([frame.camera.width, frame.camera.height])
    total = 0.0
    for item in furniture:
        centre = T_sensor_map.apply(np.array([[item.box.pose.x, item.box.pose.y, _SEAT_M]]))
        if centre[0, 2] > _SEAT_M:
            off = float(np.abs(frame.camera.project(centre)[0] / half - 1.0).max())
            total += max(0.0, 1.0 - off**2)
    return total
