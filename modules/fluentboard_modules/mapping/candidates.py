"""Candidates: hypotheses about planes of the map, placed and verified; the choice among them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.config import (
    ExistenceConfig,
    FurnitureMapConfig,
    HypothesisConfig,
)
from fluentboard_modules.mapping.existence import verified_belief
from fluentboard_modules.mapping.furniture_item import CadFit, FurniturePlane, box_overlap
from fluentboard_modules.mapping.hypotheses import (
    FurnitureGeometry,
    place_hypothesis,
    placing_box,
    space_above,
)
from fluentboard_modules.mapping.judge import Case, verified_geometry
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.rule_language import FurnitureClass
from fluentboard_modules.mapping.rules import FurnitureHypothesis
from fluentboard_modules.mapping.verify import Verdict

_Value = TypeVar("_Value", int, float)

_LEVEL = 0.7  # of a normal's z
_INSIDE_M = 0.05
_SURFACE_M = 0.02  # between the points that stand for a model's surface
# A backrest alone or a front alone says less than a seat or a board with what belongs to it.
_ONE_SIDE_MALUS = {"top": 0.0, "front": 15.0, "back": 10.0}
_EXACT_BONUS = 200.0  # a CAD file that fits says more than the order of the classes
_PER_M2 = 100.0  # and of two of them the one that explains more says more


@dataclass(frozen=True, slots=True)
class Stand:
    """A class of furniture somewhere, and the CAD model that says so, if one does."""

    furniture: FurnitureClass
    box: BoundingBox
    fit: CadFit | None


@dataclass(frozen=True, slots=True)
class Candidate:
    """A hypothesis about planes of the map, placed and scored.

    Attributes:
        hypothesis: what the ontology says.
        furniture: the class.
        geometry: where it is.
        main_plane: identifier of its main plane in the map.
        planes: what explains it, the main plane first.
        score: belief in the least believed of its planes, in [0, 1].
        n_frames: that saw the least seen of its planes.
        fit: the CAD model that explains it, None before verification.
        is_pending: whether it has still to be verified.
        is_in_row: whether it is one of several side by side that share a plane.
    """

    hypothesis: FurnitureHypothesis
    furniture: FurnitureClass
    geometry: FurnitureGeometry
    main_plane: int
    planes: tuple[FurniturePlane, ...]
    score: float
    n_frames: int
    fit: CadFit | None = None
    is_pending: bool = False
    is_in_row: bool = False

    @property
    def key(self) -> tuple[str, int]:
        """The same for the same hypothesis in later frames."""
        return self.furniture.name, self.main_plane

    @property
    def stand(self) -> Stand:
        """Where it stands."""
        return Stand(self.furniture, self.geometry.box, self.fit)

    @property
    def preference(self) -> float:
        """The class's priority, less for a single upright side; for a CAD file what it explains.

        The larger of two models that fit explains what the smaller leaves over: a desk of two
        boards is no table with a board beside it.
        """
        if self.fit is None or not self.fit.is_exact:
            return self.hypothesis.priority - _ONE_SIDE_MALUS[self.geometry.main_side]
        return _EXACT_BONUS + _PER_M2 * self.fit.score**4 * self.fit.explained_m2


def place_candidate(
    hypothesis: FurnitureHypothesis,
    furniture: FurnitureClass,
    identifiers: Sequence[int],
    regions: Sequence[PlanarRegion],
    frames_of: Mapping[int, int],
    belief_in: Mapping[int, float],
    config: FurnitureMapConfig,
) -> Candidate:
    """A hypothesis with its place and the support of its planes.

    Args:
        hypothesis: about some of the regions.
        furniture: its class.
        identifiers: of the regions' planes in the map.
        regions: planes of the map.
        frames_of: per plane identifier the frames that saw it.
        belief_in: per plane identifier the belief that it is there.
        config: of first poses.
    """
    geometry = place_hypothesis(hypothesis, furniture, regions, config.hypotheses)
    parts = tuple(
        FurniturePlane(
            identifiers[part.plane],
            part.label,
            regions[part.plane],
            frames_of[identifiers[part.plane]],
        )
        for part in hypothesis.planes
        # Of several backrests only the one that gave the direction explains the chair.
        if part.label not in furniture.back_planes or geometry.back_plane in (None, part.plane)
    )
    return Candidate(
        hypothesis,
        furniture,
        geometry,
        identifiers[hypothesis.main_plane],
        parts,
        # It is there if its main plane is, and what it is said to be if all of its parts are.
        min(
            belief_in[identifiers[hypothesis.main_plane]],
            _of_least_kind((part.label, belief_in[part.identifier]) for part in parts),
        ),
        _of_least_kind((part.label, part.n_frames) for part in parts),
    )


def case_of(candidate: Candidate, since_s: float | None = None) -> Case:
    """A candidate as the judge wants it: only the planes that are the piece's own.

    Args:
        candidate: the hypothesis.
        since_s: when its main plane was first seen.
    """
    own = [
        plane
        for k, plane in enumerate(candidate.planes)
        # A table that a chair stands at is evidence, but no part of the chair.
        if k == 0
        or plane.label in candidate.furniture.back_planes
        or not candidate.furniture.back_planes
    ]
    return Case(
        candidate.key,
        candidate.furniture.name,
        candidate.geometry,
        tuple(plane.region for plane in own),
        candidate.n_frames,
        since_s,
    )


def placing_area(candidate: Candidate, config: HypothesisConfig) -> BoundingBox | None:
    """Where things are put: of a piece known by its front, on its largest board or on its top.

    None for seats.
    """
    if candidate.furniture.back_planes:
        return None
    top, geometry = candidate.planes[0].region, candidate.geometry
    if abs(top.normal[2]) <= _LEVEL:
        boards = [p.region for p in candidate.planes if abs(p.region.normal[2]) > _LEVEL]
        if not boards:
            return space_above(geometry.box, config)
        top = max(boards, key=lambda board: board.area_m2)
    return placing_box(top, geometry.pose.yaw_rad, config)


def with_verdicts(candidate: Candidate, verdicts: tuple[Verdict, ...] | None) -> list[Candidate]:
    """What verification made of a candidate: nothing, one piece, or several side by side."""
    if verdicts is None:
        return [replace(candidate, is_pending=True)]
    kept: list[Candidate] = []
    for verdict in verdicts:
        if not verdict.is_accepted:
            continue
        fit = CadFit(
            verdict.model.name,
            verdict.model.is_exact,
            verdict.standing.pose,
            verdict.score,
            verdict.initial.pose,
            verdict.initial_score,
            verdict.covariance,
            verdict.n_views,
            verdict.visibility.close / max(verdict.n_views, 1),
        )
        geometry = candidate.geometry
        if verdict.model.is_exact:
            geometry = verified_geometry(verdict, candidate.planes[0].region)
        kept.append(replace(candidate, fit=fit, geometry=geometry, is_in_row=len(verdicts) > 1))
    return kept


def believed(candidate: Candidate, config: ExistenceConfig) -> Candidate:
    """A candidate, believed also for what its CAD file says: two frames may say all there is.

    What was seen through more often than seen is not.
    """
    fit = candidate.fit
    if fit is None or not fit.is_exact or candidate.score < config.prior:
        return candidate
    return replace(candidate, score=verified_belief(candidate.score, fit.score, config))


def choose(
    candidates: Sequence[Candidate],
    followed: set[tuple[str, int | None]],
    config: FurnitureMapConfig,
) -> list[Candidate]:
    """One hypothesis per place: by what fits, the ontology's priority, then planes, then support.

    Args:
        candidates: to choose from.
        followed: class and main plane of the pieces that are already believed in.
        config: when two are at the same place.
    """
    ranked = sorted(
        candidates,
        key=lambda c: (
            # Weak evidence for a preferred class does not push out strong evidence.
            c.score < config.drop_score,
            -c.preference,
            # A seat says more than the backrest alone.
            c.hypothesis.main_label in c.furniture.back_planes,
            # Of two fronts of one shelf the larger: the other is its side.
            -c.planes[0].region.area_m2 if c.geometry.main_side == "front" else 0.0,
            -len(c.planes),
            (c.furniture.name, c.main_plane) not in followed,
            -c.n_frames,
            c.main_plane,
        ),
    )
    chosen: list[Candidate] = []
    for candidate in ranked:
        if not any(_excludes(better, candidate, config) for better in chosen):
            chosen.append(candidate)
    return chosen


def explains(piece: Candidate, other: Candidate, model: CadModel | None) -> bool:
    """Whether a CAD model that fits already accounts for another hypothesis's main plane.

    Args:
        piece: that was found.
        other: the hypothesis.
        model: the model of the piece, None if it was made up.
    """
    region = other.planes[0].region
    if piece.fit is None or not piece.fit.is_exact or len(other.planes) > 1:
        return False
    if not is_inside(region, piece.geometry.box):
        return False
    if model is None or not piece.furniture.has_room_below:
        return True
    # Below a top there is room for what is no part of it: chairs, and desks stand around them.
    return lies_on(region, model, piece.fit.pose)


def lies_on(region: PlanarRegion, model: CadModel, pose: Pose) -> bool:
    """Whether most of a plane's outline is on the surface of a model that stands somewhere."""
    outline = pose.to_transform().inverse().apply(region.outline_map())
    distance, _ = model.tree.query(outline)
    return bool(np.mean(distance <= _INSIDE_M + _SURFACE_M) > 0.5)


def is_inside(region: PlanarRegion, box: BoundingBox) -> bool:
    """Whether a plane has its middle inside a box."""
    local = box.pose.to_transform().inverse().apply(region.centroid[None])[0]
    return bool((abs(local) <= 0.5 * box.sizes + _INSIDE_M).all())


def share_a_place(better: Stand, other: Stand, config: FurnitureMapConfig) -> bool:
    """Whether two pieces are where only one can be; a chair may stand below a top."""
    if not _share_heights(better.box, other.box):
        return False
    overlap = box_overlap(better.box, other.box)
    are_exact = all(one.fit is not None and one.fit.is_exact for one in (better, other))
    if better.furniture.name == other.furniture.name:
        return overlap >= (config.exact_overlap if are_exact else config.same_place_overlap)
    for seat, top in ((better, other), (other, better)):
        if seat.furniture.back_planes and top.furniture.has_room_below:
            return False
    return overlap >= (config.exact_overlap if are_exact else config.other_place_overlap)


def _excludes(better: Candidate, other: Candidate, config: FurnitureMapConfig) -> bool:
    """Whether two hypotheses cannot both be true.

    They may share a plane if both take it for the same thing: a chair stands at a table, and the
    table is a table. Two things are not in one place, but a chair may stand below a top.
    """
    same_class = better.furniture.name == other.furniture.name
    is_row = better.is_in_row and other.is_in_row and better.key == other.key
    if not is_row:
        for plane in better.planes:
            if plane.identifier == other.main_plane and (
                same_class or plane.label != other.hypothesis.main_label
            ):
                return True
    if not same_class and (better.is_pending or better.fit is None):
        return False
    return share_a_place(better.stand, other.stand, config)


def takes_the_place(piece: Candidate, other: Stand, config: FurnitureMapConfig) -> bool:
    """Whether a piece that is believed shows that one of another class is not there."""
    is_believed = not piece.is_pending and piece.score >= config.accept_score
    is_another = piece.furniture.name != other.furniture.name
    return is_believed and is_another and share_a_place(piece.stand, other, config)


def _share_heights(a: BoundingBox, b: BoundingBox) -> bool:
    """Whether one of two upright boxes is not wholly above the other."""
    return abs(a.pose.z - b.pose.z) < 0.5 * (a.z_size + b.z_size)


def _of_least_kind(values: Iterable[tuple[str, _Value]]) -> _Value:
    """The value of the least seen kind of plane; of several for one label the best counts."""
    best: dict[str, _Value] = {}
    for label, value in values:
        best[label] = max(best.get(label, value), value)
    return min(best.values())
