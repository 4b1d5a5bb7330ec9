"""SensorFrame: one look of a depth camera, with everything needed to place it in the map."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidFrame
from fluentboard.model.geometry import FloatArray, Transform


@dataclass(frozen=True, slots=True)
class Camera:
    """A pinhole camera without distortion; x right, y down, z forward (optical frame).

    Attributes:
        width: pixels.
        height: pixels.
        fx: focal length in pixels along x.
        fy: focal length in pixels along y.
        cx: principal point in pixels along x; the centre of pixel 0 is at 0.
        cy: principal point in pixels along y.

    Raises:
        InvalidFrame: a focal length or an image side is not positive.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        if self.width <= 0 or self.height <= 0 or not (self.fx > 0.0 and self.fy > 0.0):
            raise InvalidFrame(
                f"camera of {self.width}x{self.height} px with focal lengths {self.fx}, {self.fy}; "
                "give positive numbers of pixels"
            )

    @classmethod
    def from_matrix(cls, width: int, height: int, matrix: FloatArray) -> Camera:
        """The camera of a `(3, 3)` matrix `fx 0 cx / 0 fy cy / 0 0 1`."""
        (fx, _, cx), (_, fy, cy) = matrix[:2].tolist()
        return cls(width, height, fx, fy, cx, cy)

    def rays(self) -> FloatArray:
        """`(h, w, 3)`; per pixel the direction in the camera frame with z = 1."""
        u, v = np.meshgrid(np.arange(self.width), np.arange(self.height))
        return np.stack(
            [(u - self.cx) / self.fx, (v - self.cy) / self.fy, np.ones(u.shape)], axis=-1
        )

    def resized(self, width: int) -> Camera:
        """The same camera with an image of another width, and its height in proportion."""
        share = width / self.width
        height = max(round(self.height * share), 1)
        # Pixel centres are whole numbers, so the image's left edge lies at -0.5.
        cx, cy = ((c + 0.5) * share - 0.5 for c in (self.cx, self.cy))
        return Camera(width, height, self.fx * share, self.fy * share, cx, cy)

    def project(self, points_camera: FloatArray) -> FloatArray:
        """Pixel coordinates `(n, 2)` of points `(n, 3)` in front of the camera (z > 0)."""
        z = points_camera[:, 2]
        return np.stack(
            [
                self.fx * points_camera[:, 0] / z + self.cx,
                self.fy * points_camera[:, 1] / z + self.cy,
            ],
            axis=-1,
        )


@dataclass(frozen=True, slots=True)
class SensorFrame:
    """One depth image, placed in the map and on the board's time axis.

    Attributes:
        depth_m: `(h, w)` float32; distance along the optical axis in metres, 0 where unknown.
        camera: the depth camera.
        stamp_s: when it was taken, in seconds on the board's time axis.
        T_map_sensor: takes points of the depth camera's optical frame to the map frame.
        colour: `(h', w', 3)` uint8 RGB, or None; not necessarily registered to the depth image.
        colour_camera: the colour camera, where it differs from the depth camera.
        T_colour_depth: takes points of the depth camera to the colour camera, where it differs.
        labels: `(h, w)` int32 instance ids (0 = background), where the source knows the truth.
        sensor: name of the sensor.
        index: running number within its source.
        cloud_sensor: `(n, 3)`; all points in the depth camera's frame, in metres, where the source
            is an unorganised cloud and the depth image only one view of it.

    Raises:
        InvalidFrame: an image has the wrong shape or type.
    """

    depth_m: NDArray[np.float32]
    camera: Camera
    stamp_s: float
    T_map_sensor: Transform
    colour: NDArray[np.uint8] | None = None
    colour_camera: Camera | None = None
    T_colour_depth: Transform | None = None
    labels: NDArray[np.int32] | None = None
    sensor: str = "camera"
    index: int = 0
    cloud_sensor: FloatArray | None = None

    def __post_init__(self) -> None:
        shape = (self.camera.height, self.camera.width)
        if self.depth_m.shape != shape:
            raise InvalidFrame(
                f"frame {self.index}: depth image has shape {self.depth_m.shape}, its camera says "
                f"{shape}; give the intrinsics of this image size"
            )
        if self.labels is not None and self.labels.shape != shape:
            raise InvalidFrame(
                f"frame {self.index}: label image has shape {self.labels.shape}, depth has {shape}"
            )
        if self.colour is not None and (self.colour.ndim != 3 or self.colour.shape[2] != 3):
            raise InvalidFrame(
                f"frame {self.index}: colour image has shape {self.colour.shape}, not (h, w, 3)"
            )
        cloud = self.cloud_sensor
        if cloud is not None and (cloud.ndim != 2 or cloud.shape[1] != 3):
            raise InvalidFrame(
                f"frame {self.index}: cloud has shape {cloud.shape}, expected (n, 3)"
            )

    @property
    def valid(self) -> NDArray[np.bool_]:
        """`(h, w)`; where the depth is known."""
        return np.isfinite(self.depth_m) & (self.depth_m > 0.0)

    def points_sensor(self) -> FloatArray:
        """`(h, w, 3)`; organised points in the sensor frame, NaN where the depth is unknown."""
        depth = np.where(self.valid, self.depth_m, np.nan).astype(np.float64)
        return self.camera.rays() * depth[..., None]

    def points_map(self) -> FloatArray:
        """`(h, w, 3)`; organised points in the map frame, NaN where the depth is unknown."""
        return self.T_map_sensor.apply(self.points_sensor())


class FrameSource(Protocol):
    """Anything that yields sensor frames in time order: a recording, a simulator, a live robot."""

    @property
    def name(self) -> str:
        """What to call the source in messages."""
        ...

    def __len__(self) -> int:
        """How many frames there are; raises TypeError when the source is live."""
        ...

    def __iter__(self) -> Iterator[SensorFrame]:
        """The frames; a frame that cannot be read is skipped with a warning in the log."""
        ...
