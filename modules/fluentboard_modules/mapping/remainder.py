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
from fluentboard_modules.mapping.view_kernels import explained_pixels
from fluentboard_modules.mapping.visibility import draw_into

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
        drawing = draw_into(model, standing.transform, view, _INSIDE_M)
        if drawing is None:
            return None
        low, high = model.mesh.bounds
        mask = explained_pixels(
            drawing.expected,
            view.depth_m,
            view.sigma_m,
            view.intrinsics,
            drawing.window,
            drawing.T_sensor_model.inverse().matrix,
            np.array([low - _INSIDE_M, high + _INSIDE_M]),
            is_filled,
            self._config.tolerance_m,
            self._config.tolerance_sigma,
        )
        top, bottom, left, right = drawing.window.tolist()
        window = slice(top, bottom), slice(left, right)
        return _Explained(window, mask) if mask.any() else None
