"""ViewStack: some depth images as one array each of depth, noise, cameras and places."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import overload

import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.depth_views import DepthView


class ViewStack(Sequence[DepthView]):
    """Depth images that compiled loops look at all at once.

    A call costs more than a look at one thinned image; smaller images are filled up with unknown
    depth.

    Args:
        views: the images, the best first.
    """

    def __init__(self, views: Sequence[DepthView]) -> None:
        self._views = tuple(views)

    @classmethod
    def of(cls, views: Sequence[DepthView]) -> ViewStack:
        """The views themselves if they are a stack already."""
        return views if isinstance(views, cls) else cls(views)

    def __len__(self) -> int:
        return len(self._views)

    @overload
    def __getitem__(self, index: int) -> DepthView: ...

    @overload
    def __getitem__(self, index: slice) -> Sequence[DepthView]: ...

    def __getitem__(self, index: int | slice) -> DepthView | Sequence[DepthView]:
        return self._views[index]

    @cached_property
    def depth_m(self) -> NDArray[np.float32]:
        """`(n, h, w)`; 0 where unknown."""
        return self._filled_up([view.depth_m for view in self._views])

    @cached_property
    def sigma_m(self) -> NDArray[np.float32]:
        """`(n, h, w)`; standard deviation of each depth."""
        return self._filled_up([view.sigma_m for view in self._views])

    @cached_property
    def cameras(self) -> FloatArray:
        """`(n, 4)`; fx, fy, cx, cy, pixels."""
        return np.array([view.intrinsics for view in self._views]).reshape(-1, 4)

    @cached_property
    def sizes(self) -> NDArray[np.int64]:
        """`(n, 2)`; rows and columns of each image."""
        shapes = [view.depth_m.shape for view in self._views]
        return np.array(shapes, dtype=np.int64).reshape(-1, 2)

    @cached_property
    def T_sensor_map(self) -> FloatArray:
        """`(n, 4, 4)`; each takes points of the map to a sensor."""
        matrices = [view.T_sensor_map.matrix for view in self._views]
        return np.array(matrices).reshape(-1, 4, 4)

    @cached_property
    def T_map_sensor(self) -> FloatArray:
        """`(n, 4, 4)`; each takes points of a sensor to the map."""
        matrices = [view.T_map_sensor.matrix for view in self._views]
        return np.array(matrices).reshape(-1, 4, 4)

    def thinned(self, spacing_m: float) -> tuple[FloatArray, NDArray[np.int64]]:
        """The measured points of all views, one per view and cube of a grid, sorted by cube.

        Returns:
            `(n, 3)` in the map, and `(n,)` the numbers of the cubes.
        """
        if spacing_m not in self._thinned:
            parts = [view.thinned(spacing_m) for view in self._views]
            points = np.concatenate([np.zeros((0, 3)), *(part[0] for part in parts)])
            cubes = np.concatenate([np.zeros(0, dtype=np.int64), *(part[1] for part in parts)])
            order = np.argsort(cubes, kind="stable")
            self._thinned[spacing_m] = points[order], cubes[order]
        return self._thinned[spacing_m]

    @cached_property
    def _thinned(self) -> dict[float, tuple[FloatArray, NDArray[np.int64]]]:
        return {}

    def _filled_up(self, images: Sequence[NDArray[np.float32]]) -> NDArray[np.float32]:
        rows, columns = self.sizes.max(axis=0).tolist() if len(self) else (0, 0)
        stack = np.zeros((len(images), rows, columns), dtype=np.float32)
        for number, image in enumerate(images):
            stack[number, : image.shape[0], : image.shape[1]] = image
        return stack
