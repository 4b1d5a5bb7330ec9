"""Colour registered to depth: for every depth pixel the colour of what is seen there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fluentboard_modules.frames.sensor_frame import SensorFrame


def registered_colour(frame: SensorFrame) -> NDArray[np.uint8] | None:
    """`(h, w, 3)` uint8 RGB of the size of the depth image; None if the frame has no colour.

    Black where the depth is unknown or the colour camera does not look, unless the cameras are one
    and the same.

    Args:
        frame: any frame.
    """
    if frame.colour is None:
        return None
    height, width = frame.depth_m.shape
    if frame.colour_camera is None and frame.colour.shape[:2] == (height, width):
        return frame.colour
    colour_height, colour_width = frame.colour.shape[:2]
    camera = frame.colour_camera or frame.camera
    points = frame.points_sensor()[frame.valid]
    if frame.T_colour_depth is not None:
        points = frame.T_colour_depth.apply(points)
    registered = np.zeros((height, width, 3), dtype=np.uint8)
    in_front = points[:, 2] > 1e-6
    pixels = np.full((len(points), 2), -1, dtype=np.int64)
    projected = np.rint(camera.project(points[in_front]))
    # Points far to the side project to anywhere; a cast of huge numbers to integers is undefined.
    pixels[in_front] = np.clip(projected, -1, 1 << 20).astype(np.int64)
    u, v = pixels.T
    seen = (u >= 0) & (u < colour_width) & (v >= 0) & (v < colour_height)
    rows, columns = np.nonzero(frame.valid)
    registered[rows[seen], columns[seen]] = frame.colour[v[seen], u[seen]]
    return registered
