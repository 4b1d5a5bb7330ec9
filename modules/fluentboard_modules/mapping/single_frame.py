"""Furniture of one frame, or of one registered scene, without any memory (Section 3.3.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

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
from fluentboard_modules.mapping.depth_views import DepthView
from fluentboard_modules.mapping.neighbours import with_neighbours
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.rules import (
    FurnitureHypothesis,
    FurnitureRules,
    partial_hypotheses,
)
from fluentboard_modules.mapping.verify import Verdict, verify, verify_at

_MANY_FRAMES = 1000  # a single look is all there is: belief by support plays no part


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
    as nothing that was found explains them; and then the places beside what was found.

    Args:
        regions: planar regions of a frame or of a registered scene, map frame.
        views: the frame itself, or depth images of the scene.
        rules: the furniture ontology.
        library: CAD models.
        config: of all steps.
        floor: from where heights count; by default from z = 0.
    """
    classification = rules.classify(regions, floor=floor, explain=False)
    judged: list[Judged] = []

    def judge(
        hypotheses: Sequence[FurnitureHypothesis],
        found: Sequence[Candidate] = (),
        is_partial: bool = False,
    ) -> list[Candidate]:
        candidates: list[Candidate] = []
        for hypothesis in hypotheses:
            candidate = place_candidate(
                hypothesis,
                rules.rules.furniture[hypothesis.class_name],
                range(len(regions)),
                regions,
                dict.fromkeys(range(len(regions)), _MANY_FRAMES),
                1.0,
                config.furniture,
            )
            if is_partial and any(explains(piece, candidate) for piece in (*found, *candidates)):
                continue
            case = case_of(candidate)
            verdicts = verify(
                case.class_name, case.geometry, case.parts, views, library, config.verification
            )
            judged.extend(Judged(candidate, verdict) for verdict in verdicts)
            candidates += with_verdicts(candidate, verdicts)
        return candidates

    whole = judge(classification.hypotheses)
    parts = [
        hypothesis
        for furniture in rules.furniture_classes
        if library.of_class(furniture.name)
        for hypothesis in partial_hypotheses(
            classification, furniture, regions, library.of_class(furniture.name)
        )
    ]
    parts.sort(key=lambda part: -regions[part.main_plane].area_m2)
    partial = judge(parts, choose(whole, set(), config.furniture), is_partial=True)

    def look(model: CadModel, standing: Standing, piece: Candidate) -> Verdict | None:
        geometry = piece.geometry
        if piece.furniture.front_planes:  # a front is only known by its relief
            geometry = replace(geometry, main_side="front")
        verdict = verify_at(model, standing, geometry, views, config.verification)
        if verdict is not None:
            judged.append(Judged(piece, verdict))
        return verdict

    chosen = choose([*whole, *partial], set(), config.furniture)
    rows = with_neighbours(chosen, library.named, look)
    return SceneFindings(tuple(choose(rows, set(), config.furniture)), tuple(judged))
