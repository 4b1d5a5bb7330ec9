"""One piece or two side by side: of a row that is hidden at both ends, less than one may be seen.

What is seen of two tables without a gap between them may be no longer than one table. Then a single
one in the middle explains the top as well; only what else the images show, legs and ends, tells.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fluentboard_modules.mapping.alignment import Standing
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.config import VisibilityConfig
from fluentboard_modules.mapping.depth_views import DepthView
from fluentboard_modules.mapping.view_stack import ViewStack
from fluentboard_modules.mapping.visibility import Visibility, compare_with_views

_SHIFTS = np.linspace(-0.45, 0.45, 13)  # of the seam from the middle of the single piece
_BETTER = 0.1  # two must explain so much more than one


def best_pair(
    model: CadModel,
    single: Standing,
    views: Sequence[DepthView],
    config: VisibilityConfig,
    *,
    is_deep: bool,
) -> tuple[Standing, Standing] | None:
    """Two models side by side that explain the images better than one where it was found.

    Args:
        model: of all of them.
        single: where one was found.
        views: depth images without what other pieces explain.
        config: of the comparison.
        is_deep: whether they may also stand one behind the other.

    Returns:
        None if one is as good.
    """
    coarse = config.model_copy(update={"pixel_step": 2})
    views = ViewStack.of(views)

    def seen(standings: Sequence[Standing]) -> Visibility:
        looks = (compare_with_views(model, s.transform, views, coarse) for s in standings)
        return sum(looks, Visibility())

    low, high = model.mesh.bounds
    depth, width = (high - low)[:2].tolist()
    ways = [(0.0, width)] + ([(depth, 0.0)] if is_deep else [])
    one = seen([single])
    least = one.gain(coarse) + _BETTER * one.close
    best: tuple[Standing, Standing] | None = None
    for dx, dy in ways:
        for shift in _SHIFTS.tolist():
            pair = (
                single.moved((shift - 0.5) * dx, (shift - 0.5) * dy, 0.0),
                single.moved((shift + 0.5) * dx, (shift + 0.5) * dy, 0.0),
            )
            gain = seen(pair).gain(coarse) - coarse.doubt_m2
            if gain > least:
                best, least = pair, gain
    return best
