"""PointCloud: points as a file or a message holds them, wherever the sensor was."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidFrame
from fluentboard.model.geometry import FloatArray, Transform


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Points with what is known about each; organised if they come row by row from an image.

    Attributes:
        points: `(n, 3)` in metres, in the cloud's own frame; NaN where nothing was measured.
        width: points per row; all of them if the cloud is not organised.
        height: rows; 1 if the cloud is not organised.
        colours: `(n, 3)` uint8 RGB, or None.
        labels: `(n,)` int32 instance labels, or None.
        T_cloud_sensor: where the file says the sensor was; None if it says nothing.

    Raises:
        InvalidFrame: the numbers of points, colours or labels do not go together.
    """

    points: FloatArray
    width: int
    height: int
    colours: NDArray[np.uint8] | None = None
    labels: NDArray[np.int32] | None = None
    T_cloud_sensor: Transform | None = None

    def __post_init__(self) -> None:
        count = self.width * self.height
        sizes = [len(a) for a in (self.points, self.colours, self.labels) if a is not None]
        if any(size != count for size in sizes):
            raise InvalidFrame(
                f"a cloud of {self.width} x {self.height} points has arrays of {sizes} entries"
            )

    @property
    def is_organised(self) -> bool:
        """The points are the pixels of an image."""
        return self.height > 1

    @property
    def valid(self) -> NDArray[np.bool_]:
        """`(n,)`; where something was measured."""
        return np.isfinite(self.points).all(axis=1)


def unpacked_rgb(packed: NDArray[np.uint32]) -> NDArray[np.uint8]:
    """`(n, 3)` uint8 RGB of colours packed as 0x(AA)RRGGBB, as PCL and ROS do."""
    return np.stack([packed >> 16 & 0xFF, packed >> 8 & 0xFF, packed & 0xFF], axis=-1).astype(
        np.uint8
    )
