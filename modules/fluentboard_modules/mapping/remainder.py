"""What found furniture leaves unexplained of depth images: later hypotheses must explain the rest.

Section 3.3.1 names adjacent furniture as a failure. A second table beside the first slides onto it
if it may explain the same pixels once more, and is contradicted where its top seems to go on into
the first. So what a piece that was found explains is taken out of the images, as if it had not been
measured, before anything else is compared with them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fluentboard_modules.mapping.alignment import Standing
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.config import VisibilityConfig
from fluentboard_modules.mapping.depth_views import DepthView

_NEAREST_M = 0.1
_INSIDE_M = 0.03


@dataclass(frozen=True, slots=True, eq=False)
class _Explained:
    """Which measurements in a part of an image a piece explains."""

    window: tuple[slice, slice]
    mask: NDArray[np.bool_]


Memory = dict[tuple[int, str, Standing, bool], _Explained | None]
"""What pieces explain of views: by identity of the view, model, place, and whether filled."""


class Remainder:
    """Depth images of which found pieces are taken away, one after the other.

    Args:
        views: the images.
        config: how near to a model a measurement is explained.
        memory: of what pieces explain, to be shared by all remainders of the same images.
    """

    def __init__(
        self,
        views: Sequence[DepthView],
        config: VisibilityConfig,
        memory: Memory | None = None,
    ) -> None:
        self.views = list(views)
        self._whole = list(views)
        self._config = config
        self._memory: Memory = {} if memory is None else memory

    def take(self, model: CadModel, standing: Standing, *, is_filled: bool = False) -> None:
        """Takes away what a piece explains.

        Args:
            model: of the piece.
            standing: where it stands.
            is_filled: whether all within its box belongs to it, as the books in a shelf do.
        """
        for k, whole in enumerate(self._whole):
            key = id(whole), model.name, standing, is_filled
            if key not in self._memory:
                self._memory[key] = self._explained(whole, model, standing, is_filled)
            explained = self._memory[key]
            if explained is None:
                continue
            rest = self.views[k].depth_m.copy()
            rest[explained.window][explained.mask] = 0.0
            self.views[k] = replace(self.views[k], depth_m=rest)

    def _explained(
        self, view: DepthView, model: CadModel, standing: Standing, is_filled: bool
    ) -> _Explained | None:
        window = _window(view, model, standing)
        if window is None:
            return None
        rays, depth = view.rays[window], view.depth_m[window]
        T_model_sensor = standing.transform.inverse() @ view.T_map_sensor
        origin = T_model_sensor.translation.astype(np.float32)
        directions = rays @ T_model_sensor.rotation.T.astype(np.float32)
        hits = model.caster.cast(
            np.concatenate([np.broadcast_to(origin, rays.shape), directions], -1)
        )
        tolerance = np.maximum(
            np.float32(self._config.tolerance_m),
            np.float32(self._config.tolerance_sigma) * view.sigma_m[window],
        )
        mask = _near(depth, hits.distance, tolerance)
        if is_filled:
            low, high = model.mesh.bounds
            points = origin + depth[..., None] * directions
            in_box = (points >= low - _INSIDE_M) & (points <= high + _INSIDE_M)
            mask |= in_box.all(axis=-1) & (depth > 0.0)
        return _Explained(window, mask) if mask.any() else None


def _near(
    depth: NDArray[np.float32], expected: NDArray[np.float32], tolerance: NDArray[np.float32]
) -> NDArray[np.bool_]:
    """Which measurements are as deep as the model is at their pixel or at one beside it."""
    h, w = depth.shape
    padded = np.pad(expected, 1, constant_values=np.inf)
    near = np.zeros(depth.shape, dtype=np.bool_)
    for dy, dx in ((1, 1), (0, 1), (2, 1), (1, 0), (1, 2)):
        near |= np.abs(depth - padded[dy : dy + h, dx : dx + w]) <= tolerance
    return near & (depth > 0.0)


def _window(view: DepthView, model: CadModel, standing: Standing) -> tuple[slice, slice] | None:
    """Rows and columns that may show the model; None if none do."""
    low, high = model.mesh.bounds
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    points = view.T_sensor_map.apply(standing.transform.apply(low + corners * (high - low)))
    camera = view.camera
    if float(points[:, 2].max()) < _NEAREST_M:
        return None
    if float(points[:, 2].min()) < _NEAREST_M:
        return slice(0, camera.height), slice(0, camera.width)
    pixels = camera.project(points)
    left, top = np.floor(pixels.min(axis=0) - 2.0).astype(int).tolist()
    right, bottom = np.ceil(pixels.max(axis=0) + 3.0).astype(int).tolist()
    left, right = max(left, 0), min(right, camera.width)
    top, bottom = max(top, 0), min(bottom, camera.height)
    if right <= left or bottom <= top:
        return None
    return slice(top, bottom), slice(left, right)
