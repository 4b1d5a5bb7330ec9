"""Hypotheses to verified furniture: which CAD model stands where, and does what was seen say so.

Section 3.2.3, with its stated failures mended: measured points look for their place on the model
instead of the other way round, several starts make up for partial views, and a visibility score
decides whether a pose is better than the one before and whether the piece is there at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.mapping.alignment import Standing, align
from fluentboard_modules.mapping.cad_library import CadLibrary
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.config import VerificationConfig
from fluentboard_modules.mapping.depth_views import DepthView, best_views
from fluentboard_modules.mapping.generic_models import generic_model
from fluentboard_modules.mapping.hypotheses import FurnitureGeometry
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.starts import possible_rows, possible_starts
from fluentboard_modules.mapping.visibility import (
    Visibility,
    compare_with_views,
    front_relief_m,
    scene_points,
)

_SEARCH_STEPS_M = (0.2, 0.1, 0.05)  # of the search along what ICP cannot see
# Metres along either axis, radians: the backs of four chairs of the 7-Scenes red kitchen were off
# by 1.3 cm and 1.1 degrees (root mean square); twice that, since four are few.
_GENERIC_SIGMA = (0.026, 0.026, 0.04)
_PLAY_STEPS_M = (0.025, 0.05, 0.1, 0.2, 0.4)  # how far a model is moved to see if it shows
_NOTICED = 0.03  # of what speaks for it
_HOPELESS = 0.2  # nothing is aligned below this closeness
_SETTLED_SCORE = 0.9  # nothing is searched from here on
_BESIDE_REACH_M = 0.15  # a piece beside another stands so near to where it would touch it


@dataclass(frozen=True, eq=False)
class Verdict:
    """What verification made of a hypothesis.

    Attributes:
        model: the CAD model that fits best.
        standing: where it stands.
        initial: where the hypothesis had put it.
        score: share of what was seen of it that it explains, in [0, 1].
        initial_score: the same where the hypothesis had put it.
        visibility: what the score is made of.
        covariance: `(3, 3)`; of x, y and yaw in the map, metres and radians.
        is_accepted: whether the score says that it is there.
        n_views: views that were compared.
    """

    model: CadModel
    standing: Standing
    initial: Standing
    score: float
    initial_score: float
    visibility: Visibility
    covariance: FloatArray
    is_accepted: bool
    n_views: int


@dataclass(frozen=True, slots=True)
class _Trial:
    """A model somewhere, and how that looks."""

    standing: Standing
    visibility: Visibility
    closeness: float
    gain: float


def verify(
    class_name: str,
    geometry: FurnitureGeometry,
    parts: Sequence[PlanarRegion],
    views: Sequence[DepthView],
    library: CadLibrary,
    config: VerificationConfig,
    prior: Verdict | None = None,
) -> tuple[Verdict, ...]:
    """The best model for a hypothesis, its pose, and whether it holds.

    Planes that are longer than the model are explained by several of them side by side.

    Args:
        class_name: what the hypothesis says.
        geometry: where it puts the piece.
        parts: its planes in the map frame, the main plane first.
        views: depth images that may show it.
        library: CAD models; a class without any is tried with a generic model.
        config: of the comparison.
        prior: what an earlier look found for the same hypothesis; if that fitted well, only its
            model and its place are tried again.

    Returns:
        One verdict, or several of models side by side; none if there is nothing to compare: no
        view, nothing known about the class, or no model that has such a plane.
    """
    centre = np.array([geometry.box.pose.x, geometry.box.pose.y, geometry.box.pose.z])
    radius = 0.5 * float(np.linalg.norm(geometry.box.sizes[:2])) + 0.1
    chosen = best_views(views, centre, radius, config.views_max)
    if not chosen:
        return ()
    models = library.of_class(class_name)
    if not models and not config.generic_models:
        return ()
    if not models:
        generic = generic_model(class_name, geometry, parts)
        return () if generic is None else (_judge_generic(generic, geometry, chosen, config),)
    if prior is not None and prior.model.is_exact and prior.score >= _SETTLED_SCORE:
        again = possible_starts(prior.model, geometry, parts, config)[:1]
        verdict = _best_of(
            prior.model, [*again, prior.standing], chosen, config, geometry, reach_m=0.3
        )
        if verdict.is_accepted and again:
            return (verdict,)
    tried = [_try_model(model, geometry, parts, chosen, config) for model in models]
    return max(tried, key=lambda verdicts: _goodness(verdicts, config), default=())


def verify_at(
    model: CadModel,
    standing: Standing,
    geometry: FurnitureGeometry,
    views: Sequence[DepthView],
    config: VerificationConfig,
) -> Verdict | None:
    """Whether a model stands at a place that no plane has hinted at, or near it.

    Args:
        model: what may be there.
        standing: where.
        geometry: of the hypothesis that led there; says how the model is to be judged.
        views: depth images that may show it.
        config: of the comparison.

    Returns:
        None if no view shows the place.
    """
    low, high = model.mesh.bounds
    centre = standing.transform.apply(0.5 * (low + high))
    radius = 0.5 * float(np.linalg.norm((high - low)[:2])) + 0.1
    chosen = best_views(views, centre, radius, config.views_max)
    if not chosen:
        return None
    first = _look(model, standing, chosen[:3], _coarse(config))
    if first.closeness < _HOPELESS:
        return None
    return _best_of(model, [standing], chosen, config, geometry, reach_m=_BESIDE_REACH_M)


def _goodness(verdicts: tuple[Verdict, ...], config: VerificationConfig) -> tuple[bool, float]:
    """Models that hold come before those that do not; then what speaks for them decides."""
    if not verdicts:
        return False, -np.inf
    seen = sum((verdict.visibility for verdict in verdicts), Visibility())
    return any(verdict.is_accepted for verdict in verdicts), seen.gain(config.visibility)


def _judge_generic(
    model: CadModel,
    geometry: FurnitureGeometry,
    views: Sequence[DepthView],
    config: VerificationConfig,
) -> Verdict:
    pose = geometry.pose
    standing = Standing(pose.x, pose.y, pose.yaw_rad)
    visibility = compare_with_views(model, standing.transform, views, config.visibility)
    score = visibility.score(config.visibility)
    # Nothing was aligned: the pose is as uncertain as the planes' edges are.
    covariance = np.diag(_GENERIC_SIGMA) ** 2
    return Verdict(
        model,
        standing,
        standing,
        score,
        score,
        visibility,
        covariance,
        score >= config.accept_score,
        len(views),
    )


def _try_model(
    model: CadModel,
    geometry: FurnitureGeometry,
    parts: Sequence[PlanarRegion],
    views: Sequence[DepthView],
    config: VerificationConfig,
) -> tuple[Verdict, ...]:
    starts = possible_starts(model, geometry, parts, config)
    if starts:
        verdict = _best_of(model, starts, views, config, geometry)
        if (
            not verdict.is_accepted
            and geometry.main_side == "top"
            and geometry.back_plane is not None
        ):
            # The backrest may have been that of the chair beside it.
            reseated = replace(geometry, back_plane=None)
            starts = possible_starts(model, reseated, parts, config)
            other = _best_of(model, starts, views, config, geometry)
            if other.is_accepted:
                return (replace(other, initial=verdict.initial),)
        return (verdict,)
    rows = possible_rows(model, geometry, parts, config)
    if not rows:
        return ()
    quick, coarse = views[:3], _coarse(config)

    def gain(row: Sequence[Standing]) -> float:
        looks = (compare_with_views(model, s.transform, quick, coarse.visibility) for s in row)
        return sum(looks, Visibility()).gain(config.visibility)

    best = max(rows, key=gain)
    for step in _SEARCH_STEPS_M:
        shifts = [(0.0, 0.0), (step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step)]
        shifted = [[one.moved(dx, dy, 0.0) for one in best] for dx, dy in shifts]
        best = max(shifted, key=gain)
    return tuple(
        _best_of(model, [standing], views, config, geometry, reach_m=0.2) for standing in best
    )


def _best_of(
    model: CadModel,
    starts: Sequence[Standing],
    views: Sequence[DepthView],
    config: VerificationConfig,
    geometry: FurnitureGeometry,
    reach_m: float = np.inf,
) -> Verdict:
    """The best place that ICP finds from any of the starts, or a start itself if that is better."""
    initial = _look(model, starts[0], views, config)
    best: _Trial = initial
    covariance: FloatArray | None = None
    if len(starts) > config.starts_max:
        quick, coarse = views[:3], _coarse(config)
        looks = [(_look(model, start, quick, coarse), k) for k, start in enumerate(starts)]
        looks.sort(key=lambda look: (-look[0].gain, look[1]))
        # Nothing near is like the model: ICP would not help.
        starts = [starts[k] for look, k in looks if look.closeness >= _HOPELESS]
    for start in starts[: config.starts_max]:
        points = _points_around(model, start, views, config)
        aligned = align(points, model, start, config.alignment)
        moved = float(np.hypot(aligned.standing.x - start.x, aligned.standing.y - start.y))
        for standing in (aligned.standing, start):
            if standing is aligned.standing and moved > reach_m:
                continue
            trial = _look(model, standing, views, config)
            if trial.gain > best.gain:
                best, covariance = trial, aligned.covariance
    if covariance is None:
        points = _points_around(model, initial.standing, views, config)
        covariance = align(points, model, initial.standing, config.alignment).covariance
    if best.visibility.score(config.visibility) < _SETTLED_SCORE:
        best = _searched(model, best, views, config)
    score, initial_score = (t.visibility.score(config.visibility) for t in (best, initial))
    if geometry.main_side == "front":
        # All that is measured lies in one plane: whether it is a front shows in its relief.
        relief = front_relief_m(model, best.standing.transform, views, config.visibility)
        share = float(np.clip(relief / config.relief_m, 0.0, 1.0))
        score, initial_score = share * score, share * initial_score
    is_accepted = score >= (config.accept_exact_score if model.is_exact else config.accept_score)
    if is_accepted:
        covariance = covariance + _play(model, best, views, config)
    return Verdict(
        model,
        best.standing,
        initial.standing,
        score,
        initial_score,
        best.visibility,
        covariance,
        is_accepted,
        len(views),
    )


def _coarse(config: VerificationConfig) -> VerificationConfig:
    """For first looks: every other pixel in both directions."""
    visibility = config.visibility.model_copy(update={"pixel_step": 2})
    return config.model_copy(update={"visibility": visibility})


def _searched(
    model: CadModel, best: _Trial, views: Sequence[DepthView], config: VerificationConfig
) -> _Trial:
    """A better place nearby, if there is one: ICP does not notice where a top ends unseen."""
    if best.closeness < _HOPELESS:
        return best
    for step in _SEARCH_STEPS_M:
        for dx, dy in ((step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step)):
            trial = _look(model, best.standing.moved(dx, dy, 0.0), views, config)
            if trial.gain > best.gain:
                best = trial
                break
    return best


def _play(
    model: CadModel, best: _Trial, views: Sequence[DepthView], config: VerificationConfig
) -> FloatArray:
    """`(3, 3)`; variance of the directions in which a model can be moved unnoticed, map axes.

    The Hessian of the ICP does not know of it: where no end of a top was seen, the points bind the
    model to itself. What can be moved by s either way without a loss may be anywhere in between,
    which has the variance s^2 / 3.
    """
    quick, coarse = views[:3], _coarse(config)
    reference = _look(model, best.standing, quick, coarse)
    least = reference.gain - _NOTICED * abs(reference.visibility.close)
    variance = np.zeros(2)
    for axis in range(2):
        for step in _PLAY_STEPS_M:
            shift = step * np.eye(2)[axis]
            trials = (
                _look(model, best.standing.moved(*(side * shift), 0.0), quick, coarse)
                for side in (1.0, -1.0)
            )
            if not any(trial.gain >= least for trial in trials):
                break
            variance[axis] = step**2 / 3.0
    c, s = np.cos(best.standing.yaw_rad), np.sin(best.standing.yaw_rad)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return turn @ np.diag([*variance, 0.0]) @ turn.T


def _look(
    model: CadModel, standing: Standing, views: Sequence[DepthView], config: VerificationConfig
) -> _Trial:
    visibility = compare_with_views(model, standing.transform, views, config.visibility)
    closeness, gain = (f(config.visibility) for f in (visibility.closeness, visibility.gain))
    return _Trial(standing, visibility, closeness, gain)


def _points_around(
    model: CadModel,
    standing: Standing,
    views: Sequence[DepthView],
    config: VerificationConfig,
) -> FloatArray:
    """`(n, 3)`; scene points in an oriented box around the model, without the floor."""
    low, high = model.mesh.bounds
    margin = config.crop_margin_m
    middle = 0.5 * (low + high)
    half = 0.5 * (high - low) + margin
    floor = 0.04
    half[2] = 0.5 * (high[2] + margin - floor)
    middle[2] = floor + half[2]
    T_map_box = standing.transform @ Transform.from_parts(np.eye(3), middle)
    points = scene_points(views, T_map_box, half, config.alignment.spacing_m)
    thin = max(1, -(-len(points) // config.alignment.points_max))
    return points[::thin]
