"""Where a CAD model stands: of many possible starts the best place, by what depth images show."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.mapping.alignment import Standing, align
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.config import VerificationConfig
from fluentboard_modules.mapping.depth_views import DepthView
from fluentboard_modules.mapping.refinement import Heading, Refined, refine
from fluentboard_modules.mapping.starts import quarter_turns
from fluentboard_modules.mapping.view_stack import ViewStack
from fluentboard_modules.mapping.visibility import Visibility, compare_with_views, scene_points

_SEARCH_STEPS_M = (0.2, 0.1, 0.05)  # of the search along what ICP cannot see
_GLANCE_VIEWS = 3
# Shares of what speaks for the first place that another must gain, if it is so far off.
_TURNED_RAD, _TURNED_DOUBT = 0.5, 0.05
_MOVED_M, _MOVED_DOUBT = 0.03, 0.02
_NEARLY = 0.35  # of what speaks for a place, another turn may have less before it is aligned
# A pixel or so along its outline, what speaks for a model of n pixels changes by half of
# _UNNOTICED * n ** -0.75 (standard deviation, as a share; 40 to 5000 pixels): the outline has
# about n ** 0.5 pixels, of which one or the other is won or lost.
_UNNOTICED = 1.8
# After the ICP none of 351 pieces accepted in simulated rooms was below 0.52; of 432 that
# were rejected, 43 % were below 0.45.
_DOUBTFUL = 0.45
_HOPELESS = 0.2  # nothing is aligned below this closeness
SETTLED_SCORE = 0.9
"""Nothing is searched from here on."""


@dataclass(frozen=True, slots=True)
class Trial:
    """A model somewhere, and how that looks."""

    standing: Standing
    visibility: Visibility
    closeness: float
    gain: float
    score: float

    @property
    def is_hopeless(self) -> bool:
        """Whether hardly anything there is like the model."""
        return self.closeness < _HOPELESS

    @property
    def is_doubtful(self) -> bool:
        """Whether no refinement would make it furniture."""
        return self.closeness < _DOUBTFUL


class Looker:
    """Looks at one model in the same views, here and there.

    Args:
        model: what may be there.
        views: depth images of the place, the best first.
        config: of the comparison.
        heading: which way it faces, if its planes say so.
    """

    def __init__(
        self,
        model: CadModel,
        views: Sequence[DepthView],
        config: VerificationConfig,
        heading: Heading | None = None,
    ) -> None:
        self.model = model
        self.views = ViewStack.of(views)
        self.config = config
        self.heading = heading
        self._glances: dict[Standing, Trial] = {}
        self._coarse = config.visibility.model_copy(update={"pixel_step": 2})

    def look(self, standing: Standing) -> Trial:
        """With all views and all their pixels."""
        visibility = compare_with_views(
            self.model, standing.transform, self.views, self.config.visibility
        )
        return self._trial(standing, visibility)

    def glance(self, standing: Standing) -> Trial:
        """With the best views and every other pixel in both directions."""
        known = self._glances.get(standing)
        if known is None:
            visibility = compare_with_views(
                self.model, standing.transform, self.views, self._coarse, _GLANCE_VIEWS
            )
            known = self._glances[standing] = self._trial(standing, visibility)
        return known

    def refine(self, standing: Standing, *, is_close: bool = False) -> Refined:
        """The last centimetre; if it is close already, with what is no further off than the last.

        Args:
            standing: nearly the place.
            is_close: whether only what the last step lets vote may vote from the first on.
        """
        config = self.config.refinement
        if is_close:
            config = config.model_copy(update={"scale_first_m": config.scale_last_m})
        return refine(
            self.model, standing, self.views, self.config.visibility, config, self.heading
        )

    def misfit(self, standing: Standing) -> float:
        """How the pixels agree there, as it is: mean squared residual in variances."""
        config = self.config.refinement.model_copy(update={"steps": 1})
        once = refine(self.model, standing, self.views, self.config.visibility, config)
        return once.misfit

    def _trial(self, standing: Standing, visibility: Visibility) -> Trial:
        config = self.config.visibility
        closeness, gain, score = (
            f(config) for f in (visibility.closeness, visibility.gain, visibility.score)
        )
        return Trial(standing, visibility, closeness, gain, score)


def best_place(
    looker: Looker,
    starts: Sequence[Standing],
    reach_m: float = np.inf,
    known: Standing | None = None,
) -> tuple[Trial, Trial]:
    """The best place that ICP finds from any of the starts, or a start itself if that is better.

    Args:
        looker: at the model.
        starts: where it may stand.
        reach_m: a place further off than this from the likeliest start is another piece's.
        known: where earlier looks had found it; tried too, but no start.

    Returns:
        The likeliest of the starts before anything was aligned, and the best place.
    """
    config = looker.config
    if len(starts) > 1:
        glances = [(looker.glance(start), k) for k, start in enumerate(starts)]
        glances.sort(key=lambda pair: (-pair[0].gain, pair[1]))
        likeliest = starts[glances[0][1]]
        if len(starts) > config.starts_max:
            # Nothing near is like the model: ICP would not help.
            glances = [pair for pair in glances if not pair[0].is_hopeless]
        tried = [starts[k] for _, k in glances[: config.starts_max]]
    else:
        likeliest, tried = starts[0], starts
    initial = best = looker.look(likeliest)
    merit = _Merit(initial, starts, reach_m)
    for start in [*tried, *([] if known is None else [known])]:
        best = max([best, *_aligned(looker, start)], key=merit)
    if best.is_doubtful:
        return initial, best
    best = _refined(looker, best, merit)
    if any(_turn_rad(start, likeliest) > _TURNED_RAD for start in starts):
        other = _turned(looker, best)
        if other is not None:
            best = max(best, _refined(looker, other, merit), key=merit)
    if best.score < SETTLED_SCORE:
        searched = _searched(looker, best, merit)
        if searched is not best:
            best = _refined(looker, searched, merit)
    return initial, best


def _turn_rad(a: Standing, b: Standing) -> float:
    return abs(math.remainder(a.yaw_rad - b.yaw_rad, 2.0 * math.pi))


def _aligned(looker: Looker, start: Standing) -> list[Trial]:
    """Where ICP ends, and where it began."""
    points = _points_around(looker, start)
    aligned = align(points, looker.model, start, looker.config.alignment)
    return [looker.look(aligned), looker.look(start)]


def _turned(looker: Looker, best: Trial) -> Trial | None:
    """The likeliest other turn at the best place, aligned, if it is nearly as likely.

    Where little is seen of a seat, only the right start of many leads to the right place. From
    there the right turn is near, whichever start has led to it.
    """
    _, *others = (looker.glance(place) for place in quarter_turns(best.standing, looker.model))
    other = max(others, key=lambda trial: trial.gain, default=None)
    here = looker.glance(best.standing)
    if other is None or other.gain < here.gain - _NEARLY * abs(here.visibility.close):
        return None
    return max(_aligned(looker, other.standing), key=lambda trial: trial.gain)


class _Merit:
    """What speaks for a place, less if it is another one than planes and the first look had found.

    A little more of the surface explained is no reason to turn a chair around. And of two tables
    that touch, either explains some of the other if it slides onto it.

    Args:
        initial: the likeliest place before anything was aligned.
        starts: the turns that planes allow.
        reach_m: what is further off is another piece's place.
    """

    def __init__(self, initial: Trial, starts: Sequence[Standing], reach_m: float) -> None:
        self._initial = initial
        self._starts = starts
        self._reach_m = reach_m

    def __call__(self, trial: Trial) -> float:
        first, then = self._initial.standing, trial.standing
        turned = min(_turn_rad(then, start) for start in self._starts)
        moved = math.hypot(then.x - first.x, then.y - first.y)
        if moved > self._reach_m:
            return -math.inf
        doubt = _TURNED_DOUBT if turned > _TURNED_RAD else 0.0
        doubt += _MOVED_DOUBT if moved > _MOVED_M else 0.0
        return trial.gain - doubt * abs(self._initial.visibility.close)


def _refined(looker: Looker, best: Trial, merit: _Merit) -> Trial:
    """The place that the pixels agree on, unless the looks notice that it is a worse one.

    What speaks for a place is counted in whole pixels, so places that differ by less than one are
    told apart by the residuals of the pixels only. If a surface beside the piece has drawn it
    away, it is tried again with what is close alone.
    """
    for is_close in (False, True):
        refined = looker.refine(best.standing, is_close=is_close)
        trial = looker.look(refined.standing)
        unnoticed = _UNNOTICED * max(refined.n_pixels, 1) ** -0.75
        if merit(trial) >= merit(best) - unnoticed * abs(best.visibility.close):
            return trial
    return best


def _searched(looker: Looker, best: Trial, merit: _Merit) -> Trial:
    """A better place nearby, if there is one: ICP does not notice where a top ends unseen."""
    if best.is_hopeless:
        return best
    nearby = looker.glance(best.standing)
    here = nearby
    for step in _SEARCH_STEPS_M:
        for dx, dy in ((step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step)):
            trial = looker.glance(nearby.standing.moved(dx, dy, 0.0))
            if trial.gain > nearby.gain:
                nearby = trial
                break
    if nearby is here:
        return best
    return max(best, looker.look(nearby.standing), key=merit)


def _points_around(looker: Looker, standing: Standing) -> FloatArray:
    """`(n, 3)`; scene points in an oriented box around the model, without the floor."""
    config = looker.config
    low, high = looker.model.mesh.bounds
    margin = config.crop_margin_m
    middle = 0.5 * (low + high)
    half = 0.5 * (high - low) + margin
    floor = 0.04
    half[2] = 0.5 * (high[2] + margin - floor)
    middle[2] = floor + half[2]
    T_map_box = standing.transform @ Transform.from_parts(np.eye(3), middle)
    points = scene_points(looker.views, T_map_box, half, config.alignment.spacing_m)
    thin = max(1, -(-len(points) // config.alignment.points_max))
    return points[::thin]
