"""Hypotheses to verified furniture: which CAD model stands where, and does what was seen say so.

Section 3.2.3, with its stated failures mended: measured points look for their place on the model
instead of the other way round, several starts make up for partial views, and a visibility score
decides whether a pose is better than the one before and whether the piece is there at all.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.alignment import Standing
from fluentboard_modules.mapping.cad_library import CadLibrary
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.config import VerificationConfig
from fluentboard_modules.mapping.depth_views import DepthView, best_views
from fluentboard_modules.mapping.evidence import Evidence, gather_evidence, rough_evidence
from fluentboard_modules.mapping.generic_models import generic_model
from fluentboard_modules.mapping.hypotheses import FurnitureGeometry
from fluentboard_modules.mapping.placement import SETTLED_SCORE, Looker, best_place
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.pose_covariance import UNKNOWN_POSE, pose_covariance
from fluentboard_modules.mapping.starts import (
    covered_share,
    heading_of,
    possible_rows,
    possible_starts,
    quarter_turns,
)
from fluentboard_modules.mapping.view_stack import ViewStack
from fluentboard_modules.mapping.visibility import Visibility, compare_with_views

# Metres along either axis, radians: the backs of four chairs of the 7-Scenes red kitchen were off
# by 1.3 cm and 1.1 degrees (root mean square); twice that, since four are few.
_GENERIC_SIGMA = (0.026, 0.026, 0.04)
_ROW_STEPS_M = (0.2, 0.1, 0.05, 0.025)  # by which a row is shifted
_IN_ROW_REACH_M = 0.03  # two that touch come no nearer to each other
_TURNS = 4  # that seats in one plane say nothing about
_COVERED = 0.2  # of a top in a row, the plane covers as much
_CLEAR_M2 = 0.02  # seen through, before a space that has to be empty is believed to be
_BESIDE_REACH_M = 0.15  # a piece beside another stands so near to where it would touch it


@dataclass(frozen=True, eq=False)
class Verdict:
    """What verification made of a hypothesis.

    Attributes:
        model: the CAD model that fits best.
        standing: where it stands.
        initial: where the hypothesis had put it.
        score: how likely a model from a CAD file is there by all evidence; of a made-up one, the
            share of what was seen of it that it explains. In [0, 1].
        initial_score: the same where the hypothesis had put it; 0 unless it is accepted.
        visibility: what the score is made of.
        covariance: `(3, 3)`; of x, y and yaw in the map, metres and radians; `UNKNOWN_POSE` unless
            it is accepted.
        is_accepted: whether the score says that it is there.
        n_views: views that were compared.
        evidence: what the score of a CAD file is made of, None for a made-up model.
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
    evidence: Evidence | None = None


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
    chosen = ViewStack(best_views(views, centre, radius, config.views_max))
    if not chosen:
        return ()
    models = library.of_class(class_name)
    if not models and not config.generic_models:
        return ()
    if not models:
        generic = generic_model(class_name, geometry, parts)
        return () if generic is None else (_judge_generic(generic, geometry, chosen, config),)
    if prior is not None and prior.model.is_exact and prior.score >= SETTLED_SCORE:
        starts = possible_starts(prior.model, geometry, parts, config)
        looker = Looker(prior.model, chosen, config, heading_of(geometry, parts))
        before = prior.standing
        again = [min(starts, key=lambda start: _difference(start, before))] if starts else [before]
        verdict = _best_of(looker, again, geometry, reach_m=0.3, known=before)
        if verdict.is_accepted and starts:
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
    chosen = ViewStack(best_views(views, centre, radius, config.views_max))
    if not chosen:
        return None
    looker = Looker(model, chosen, config)
    if looker.glance(standing).is_hopeless:
        return None
    return _best_of(looker, [standing], geometry, reach_m=_BESIDE_REACH_M)


def _difference(a: Standing, b: Standing) -> float:
    """How unlike two places of a model are, metres or radians, whichever is more."""
    return max(_apart_m(a, b), abs(math.remainder(a.yaw_rad - b.yaw_rad, 2.0 * math.pi)))


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
        score >= config.accept_score and _is_clear(model, visibility),
        len(views),
    )


def _is_clear(model: CadModel, visibility: Visibility) -> bool:
    """Whether the spaces that have to be seen empty were."""
    if not any(void.must_be_seen for void in model.voids):
        return True
    return visibility.empty > max(visibility.filled, _CLEAR_M2)


def _try_model(
    model: CadModel,
    geometry: FurnitureGeometry,
    parts: Sequence[PlanarRegion],
    views: Sequence[DepthView],
    config: VerificationConfig,
) -> tuple[Verdict, ...]:
    looker = Looker(model, views, config, heading_of(geometry, parts))
    starts = possible_starts(model, geometry, parts, config)
    if starts:
        verdict = _best_of(looker, starts, geometry)
        if (
            not verdict.is_accepted
            and geometry.main_side == "top"
            and geometry.back_plane is not None
        ):
            # The backrest may have been that of the chair beside it.
            reseated = replace(geometry, back_plane=None)
            starts = possible_starts(model, reseated, parts, config)
            other = _best_of(Looker(model, views, config), starts, geometry)
            if other.is_accepted:
                return (replace(other, initial=verdict.initial),)
        return (verdict,)
    rows = possible_rows(model, geometry, parts, config)
    if not rows:
        return ()

    best = _shifted(looker, max(rows, key=lambda row: _row_gain(looker, row)))
    if geometry.main_side == "top":
        best = [one for one in best if covered_share(model, one, parts[0]) >= _COVERED]
    return _verify_row(looker, best, geometry)


def _row_gain(looker: Looker, row: Sequence[Standing]) -> float:
    return sum(looker.glance(standing).gain for standing in row)


def _shifted(looker: Looker, row: list[Standing]) -> list[Standing]:
    """The row as a whole where the images like it best, nearby."""
    best = row
    for step in _ROW_STEPS_M:
        shifts = [(0.0, 0.0), (step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step)]
        shifted = [[one.moved(dx, dy, 0.0) for one in best] for dx, dy in shifts]
        best = max(shifted, key=lambda moved: _row_gain(looker, moved))
    return best


def _verify_row(
    looker: Looker, row: Sequence[Standing], geometry: FurnitureGeometry
) -> tuple[Verdict, ...]:
    """Verdicts on models side by side.

    Tables and shelves that touch hold each other in place: where one has slid onto another, both
    stay near where the row had put them. The seats of chairs are one plane although each stands
    for itself, and may be turned otherwise.
    """
    model = looker.model
    touching = model.fills_its_footprint or geometry.main_side == "front"
    if not touching:
        config = looker.config.model_copy(update={"starts_max": _TURNS})
        alone = Looker(model, looker.views, config)
        return tuple(
            _best_of(alone, quarter_turns(place, model), geometry, reach_m=_BESIDE_REACH_M)
            for one in row
            for place in _shifted(alone, [one])
        )
    verdicts = [_best_of(looker, [one], geometry, reach_m=_BESIDE_REACH_M) for one in row]
    for i, j in itertools.combinations(range(len(row)), 2):
        if (
            verdicts[i].is_accepted
            and verdicts[j].is_accepted
            and _apart_m(row[i], row[j]) - _apart_m(verdicts[i].standing, verdicts[j].standing)
            > _IN_ROW_REACH_M
        ):
            for k in (i, j):
                verdicts[k] = _best_of(looker, [row[k]], geometry, reach_m=_IN_ROW_REACH_M)
    return tuple(verdicts)


def _apart_m(a: Standing, b: Standing) -> float:
    return math.hypot(a.x - b.x, a.y - b.y)


def _best_of(
    looker: Looker,
    starts: Sequence[Standing],
    geometry: FurnitureGeometry,
    reach_m: float = np.inf,
    known: Standing | None = None,
) -> Verdict:
    """The verdict on the best place that is found from any of the starts, or from where it was."""
    model, views, config = looker.model, looker.views, looker.config
    initial, best = best_place(looker, starts, reach_m, known)
    is_front = geometry.main_side == "front"
    score = initial_score = 0.0
    covariance, is_accepted = UNKNOWN_POSE, False
    if best.is_doubtful:  # the rest would change nothing
        evidence = rough_evidence(best, is_front=is_front)
        score = evidence.probability(config.evidence)
    else:
        refined = looker.refine(best.standing)
        evidence = gather_evidence(looker, best, refined.misfit, is_front=is_front)
        score = evidence.probability(config.evidence)
        is_accepted = score >= config.accept_exact_score and best.score >= config.accept_score
        if is_accepted:
            covariance = pose_covariance(looker, best, refined, config.covariance)
            misfit = looker.misfit(initial.standing)
            first = gather_evidence(looker, initial, misfit, is_front=is_front)
            initial_score = first.probability(config.evidence)
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
        evidence,
    )
