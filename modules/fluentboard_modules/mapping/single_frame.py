"""Furniture of one frame, or of one registered scene, without any memory (Section 3.3.1)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fluentboard.model.geometry import Plane
from fluentboard_modules.mapping.alignment import Standing
from fluentboard_modules.mapping.cad_library import CadLibrary
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.candidates import (
    Candidate,
    case_of,
    choose,
    explains,
    place_candidate,
    with_verdicts,
)
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.depth_views import DepthView, best_views
from fluentboard_modules.mapping.furniture_item import box_overlap
from fluentboard_modules.mapping.level_strips import boxed, common_headings, level_strips
from fluentboard_modules.mapping.neighbours import stands_in_rows, with_neighbours
from fluentboard_modules.mapping.planar_region import PlanarRegion, parts_of
from fluentboard_modules.mapping.remainder import Memory, Remainder
from fluentboard_modules.mapping.room_walls import is_in_wall, room_walls, without_walls
from fluentboard_modules.mapping.row_splitting import best_pair
from fluentboard_modules.mapping.rule_language import FurnitureClass
from fluentboard_modules.mapping.rules import (
    Classification,
    FurnitureHypothesis,
    FurnitureRules,
    PlaneInRole,
    partial_hypotheses,
)
from fluentboard_modules.mapping.side_fronts import fronts_beside
from fluentboard_modules.mapping.verify import Verdict, verify, verify_at
from fluentboard_modules.mapping.work_ahead import worked_ahead

_MANY_FRAMES = 1000  # a single look is all there is: belief by support plays no part
_TOUCHING = 0.15  # of the footprint
_SURE = 0.5  # in the mean of two that take the place of one
_PART_SURE, _STRIP_SURE = 0.6, 0.6  # of what no rule has told, the images must say more
_HALF_SURE = 0.35  # of each of two that explain the images better than one that was believed
_LEVEL = 0.9
_SMALL_M2 = 0.3  # the outline of so little of a top does not say how it is turned


@dataclass(frozen=True, eq=False)
class Judged:
    """A hypothesis and what verification made of it, for curves over the score."""

    candidate: Candidate
    verdict: Verdict


@dataclass(frozen=True, eq=False)
class SceneFindings:
    """What one look at a scene found.

    Attributes:
        furniture: the pieces, one per place.
        judged: all hypotheses that were verified, accepted or not.
    """

    furniture: tuple[Candidate, ...]
    judged: tuple[Judged, ...]


def find_furniture(
    regions: Sequence[PlanarRegion],
    views: Sequence[DepthView],
    rules: FurnitureRules,
    library: CadLibrary,
    config: MappingConfig,
    floor: Plane | None = None,
) -> SceneFindings:
    """Classifies planes once and verifies every hypothesis.

    Whole definitions come first. Then single planes are tried with the class's CAD models, as far
    as nothing that was found explains them; and then the places beside what was found. Each step
    has to explain what those before it left over of the images.

    Args:
        regions: planar regions of a frame or of a registered scene, map frame.
        views: the frame itself, or depth images of the scene.
        rules: the furniture ontology.
        library: CAD models.
        config: of all steps.
        floor: from where heights count; by default from z = 0.
    """
    search = _Search(regions, views, rules, library, config, floor)
    classification = rules.classify(regions, floor=floor, explain=False)
    whole = search.judge(classification.hypotheses)
    parts = search.parts(classification, whole)
    partial = search.judge_parts(parts, choose(whole, set(), config.furniture))
    chosen = choose([*whole, *partial], set(), config.furniture)
    chosen = search.fill_rows(search.split_rows(chosen))
    strips = search.judge_parts(search.strips(chosen), chosen, _STRIP_SURE)
    if strips:
        more = search.split_rows(choose([*chosen, *strips], set(), config.furniture))
        chosen = search.fill_rows(more)
    return SceneFindings(tuple(choose(chosen, set(), config.furniture)), tuple(search.judged))


class _Search:
    """The steps of a search for furniture, and what was judged in them."""

    def __init__(
        self,
        regions: Sequence[PlanarRegion],
        views: Sequence[DepthView],
        rules: FurnitureRules,
        library: CadLibrary,
        config: MappingConfig,
        floor: Plane | None,
    ) -> None:
        self._floor = floor
        self._regions = list(regions)
        self._walls = room_walls(regions, views)
        self._views = without_walls(views, self._walls)
        self._rules, self._library, self._config = rules, library, config
        self._explained: Memory = {}
        self.judged: list[Judged] = []

    def judge(self, hypotheses: Sequence[FurnitureHypothesis]) -> list[Candidate]:
        """The hypotheses that the images agree with, each by itself."""
        placed = map(self._placed, hypotheses)
        return [
            found
            for candidate, verdicts in self._verdicts(placed, self._views)
            for found in self._accepted(candidate, verdicts)
        ]

    def parts(
        self, classification: Classification, held: Sequence[Candidate]
    ) -> list[FurnitureHypothesis]:
        """What single planes say, the largest first: planes, parts of planes, and sides.

        Args:
            classification: of the planes.
            held: the whole definitions that the images agree with.
        """
        planes = list(self._regions)
        found: list[FurnitureHypothesis] = []
        islands = [part for region in planes for part in parts_of(region)]
        self._regions += islands
        labels = self._rules.classify(islands, floor=self._floor, explain=False)
        for furniture in self._rules.furniture_classes:
            models = self._library.of_class(furniture.name)
            if not models:
                continue
            settled = {one.main_plane for one in held if one.furniture.name == furniture.name}
            found += partial_hypotheses(classification, furniture, planes, models, settled)
            # None of them was part of a definition that was judged: each is tried by itself.
            of_islands = partial_hypotheses(labels, furniture, islands, models, ())
            found += [_moved_by(len(planes), one) for one in of_islands]
            for region, names in zip(planes, classification.labels, strict=True):
                side = next((n for n in furniture.side_planes if n in names), None)
                if side is None:
                    continue
                for front in (f for model in models for f in fronts_beside(region, model)):
                    found.append(self._about(front, furniture, furniture.front_planes[0]))
        found.sort(key=lambda part: -self._regions[part.main_plane].area_m2)
        return [one for part in found for one in (*self._turned(part, held), part)]

    def _turned(
        self, part: FurnitureHypothesis, held: Sequence[Candidate]
    ) -> list[FurnitureHypothesis]:
        """The same small top or seat, if it is turned as others of its class, or as the room."""
        furniture = self._rules.rules.furniture[part.class_name]
        region = self._regions[part.main_plane]
        is_level = abs(float(region.normal[2])) > _LEVEL
        if furniture.front_planes or not is_level or region.area_m2 > _SMALL_M2:
            return []
        alike = [one.fit for one in held if one.fit and one.furniture.name == furniture.name]
        best = max(alike, key=lambda fit: fit.score, default=None)
        headings = [best.pose.yaw_rad] if best else common_headings(self._regions)
        return [
            self._about(boxed(region, heading), furniture, part.main_label) for heading in headings
        ]

    def strips(self, found: Sequence[Candidate]) -> list[FurnitureHypothesis]:
        """What may be the top of a model that is in sight as a sliver only."""
        rest = self._rest_of(found)
        headings = common_headings(self._regions)
        hypotheses: list[FurnitureHypothesis] = []
        for furniture in self._rules.furniture_classes:
            if furniture.back_planes or furniture.front_planes:
                continue
            own = [
                p.fit.pose.yaw_rad for p in found if p.fit and p.furniture.name == furniture.name
            ]
            tops = {
                round(float(m.mesh.bounds[1, 2]), 2) for m in self._library.of_class(furniture.name)
            }
            for top_m in sorted(tops):
                hypotheses += [
                    self._about(strip, furniture, furniture.main_planes[0])
                    for strip in level_strips(rest.views, top_m, own[:1] or headings)
                ]
        return hypotheses

    def _about(
        self, region: PlanarRegion, furniture: FurnitureClass, label: str
    ) -> FurnitureHypothesis:
        """A hypothesis about a region that no rule has labelled."""
        self._regions.append(region)
        plane = len(self._regions) - 1
        return FurnitureHypothesis(
            furniture.name, plane, (PlaneInRole(plane, label),), (), furniture.priority, label
        )

    def judge_parts(
        self,
        hypotheses: Sequence[FurnitureHypothesis],
        found: Sequence[Candidate],
        least: float = 0.0,
    ) -> list[Candidate]:
        """Those that explain a plane which no other piece does.

        Args:
            hypotheses: about single planes.
            found: the pieces known before.
            least: score from which they are believed.
        """
        rest = self._rest_of(found)
        candidates: list[Candidate] = []

        def is_explained(candidate: Candidate) -> bool:
            pieces = (*found, *candidates)
            return any(explains(piece, candidate, self._model_of(piece)) for piece in pieces)

        placed = (one for one in map(self._placed, hypotheses) if not is_explained(one))
        for candidate, verdicts in self._verdicts(placed, rest.views):
            if is_explained(candidate):  # by one that was found meanwhile
                continue
            furniture, label = candidate.furniture, candidate.hypothesis.main_label
            is_told = label in (*furniture.main_planes, *furniture.back_planes)
            needed = least if is_told else max(least, _PART_SURE)
            candidates += [
                one
                for one in self._accepted(candidate, verdicts)
                if one.fit is not None and one.fit.score >= needed
            ]
        return candidates

    def split_rows(self, pieces: Sequence[Candidate]) -> list[Candidate]:
        """The pieces, two instead of one where that explains the images better."""
        kept = list(pieces)
        for piece in pieces:
            model = self._model_of(piece)
            if model is None or piece.fit is None or not stands_in_rows(model, piece):
                continue
            others = [other for other in kept if other is not piece]
            box = piece.geometry.box
            centre = np.array([box.pose.x, box.pose.y, box.pose.z])
            radius = float(np.linalg.norm(box.sizes[:2]))
            views = best_views(self._views, centre, radius, self._config.verification.views_max)
            rest = self._rest_of(others, views)
            pose = piece.fit.pose
            pair = best_pair(
                model,
                Standing(pose.x, pose.y, pose.yaw_rad),
                rest.views,
                self._config.verification.visibility,
                is_deep=not piece.furniture.front_planes,
            )
            if pair is None:
                continue
            two: list[Candidate] = []
            for k, standing in enumerate(pair):
                alone = self._rest_of(others, views)
                alone.take(model, pair[1 - k], is_filled=_is_filled(piece))
                verdict = self._look(model, standing, piece, alone.views)
                if verdict is not None and verdict.score >= _HALF_SURE:
                    two += with_verdicts(piece, (replace(verdict, is_accepted=True),))
            if (
                len(two) == 2
                and _mean_score(two) >= _SURE
                and not any(
                    _touch(a, b)
                    for a in two
                    for b in others
                    if b.furniture.name == a.furniture.name
                )
            ):
                kept = [*others, *(replace(one, is_in_row=True) for one in two)]
        return kept

    def fill_rows(self, pieces: Sequence[Candidate]) -> list[Candidate]:
        """The pieces and those that stand beside them."""
        rest = self._rest_of(pieces)
        row = with_neighbours(
            pieces,
            self._library.named,
            lambda model, standing, piece: self._look(model, standing, piece, rest.views),
            lambda piece: self._take(rest, piece),
        )
        return [piece for piece in row if not self._is_in_wall(piece)]

    def _placed(self, hypothesis: FurnitureHypothesis) -> Candidate:
        n_regions = len(self._regions)
        return place_candidate(
            hypothesis,
            self._rules.rules.furniture[hypothesis.class_name],
            range(n_regions),
            self._regions,
            dict.fromkeys(range(n_regions), _MANY_FRAMES),
            dict.fromkeys(range(n_regions), 1.0),
            self._config.furniture,
        )

    def _verdicts(
        self, candidates: Iterable[Candidate], views: Sequence[DepthView]
    ) -> Iterator[tuple[Candidate, tuple[Verdict, ...]]]:
        """What the images say about each of them; several are looked at at a time."""

        def verified(candidate: Candidate) -> tuple[Verdict, ...]:
            case = case_of(candidate)
            return verify(
                case.class_name,
                case.geometry,
                case.parts,
                views,
                self._library,
                self._config.verification,
            )

        return worked_ahead(verified, candidates, self._config.verification.threads)

    def _accepted(self, candidate: Candidate, verdicts: tuple[Verdict, ...]) -> list[Candidate]:
        self.judged.extend(Judged(candidate, verdict) for verdict in verdicts)
        return [one for one in with_verdicts(candidate, verdicts) if not self._is_in_wall(one)]

    def _is_in_wall(self, piece: Candidate) -> bool:
        return is_in_wall(piece.geometry.box, self._walls, may_touch=_is_filled(piece))

    def _look(
        self, model: CadModel, standing: Standing, piece: Candidate, views: Sequence[DepthView]
    ) -> Verdict | None:
        """Judges a model at a place that a piece suggests."""
        geometry = piece.geometry
        if piece.furniture.front_planes:  # a front is only known by its relief
            geometry = replace(geometry, main_side="front")
        verdict = verify_at(model, standing, geometry, views, self._config.verification)
        if verdict is not None:
            self.judged.append(Judged(piece, verdict))
        return verdict

    def _rest_of(
        self, pieces: Sequence[Candidate], views: Sequence[DepthView] | None = None
    ) -> Remainder:
        """What pieces leave unexplained of some views, by default of all."""
        rest = Remainder(
            self._views if views is None else views,
            self._config.verification.visibility,
            self._explained,
        )
        for piece in pieces:
            self._take(rest, piece)
        return rest

    def _take(self, rest: Remainder, piece: Candidate) -> None:
        model = self._model_of(piece)
        if model is not None and piece.fit is not None:
            pose = piece.fit.pose
            standing = Standing(pose.x, pose.y, pose.yaw_rad)
            rest.take(model, standing, is_filled=_is_filled(piece))

    def _model_of(self, piece: Candidate) -> CadModel | None:
        return None if piece.fit is None else self._library.named(piece.fit.model)


def _moved_by(first: int, hypothesis: FurnitureHypothesis) -> FurnitureHypothesis:
    """The same hypothesis if its planes come behind so many others."""
    planes = tuple(PlaneInRole(part.plane + first, part.label) for part in hypothesis.planes)
    return replace(hypothesis, main_plane=hypothesis.main_plane + first, planes=planes)


def _mean_score(pieces: Sequence[Candidate]) -> float:
    return float(np.mean([0.0 if piece.fit is None else piece.fit.score for piece in pieces]))


def _is_filled(piece: Candidate) -> bool:
    """Whether what is within its box belongs to it: the books in a shelf do."""
    return bool(piece.furniture.front_planes)


def _touch(a: Candidate, b: Candidate) -> bool:
    return box_overlap(a.geometry.box, b.geometry.box) > _TOUCHING
