"""A piece of furniture in the making, and how the hypothesis of a look describes it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fluentboard_modules.mapping.candidates import Candidate, placing_area
from fluentboard_modules.mapping.config import HypothesisConfig
from fluentboard_modules.mapping.furniture_item import FurnitureItem


@dataclass(slots=True)
class Track:
    """A piece of furniture in the making, or one already reported.

    Attributes:
        item: as it is believed to be.
        main_plane: identifier of its main plane when it last had a hypothesis.
        n_direct: frames that showed its whole definition at once.
        n_without: views in a row of its main plane without a hypothesis.
        is_accepted: whether it has been believed in.
        is_pending: whether its present hypothesis has still to be verified.
        reported: as it was last reported.
    """

    item: FurnitureItem
    main_plane: int
    n_direct: int = 0
    n_without: int = 0
    is_accepted: bool = False
    is_pending: bool = False
    reported: FurnitureItem | None = None


def described(
    candidate: Candidate,
    candidates: Sequence[Candidate],
    track: Track | None,
    stamp_s: float,
    frames_s: tuple[float, ...],
    config: HypothesisConfig,
    *,
    is_seen: bool,
) -> FurnitureItem:
    """A piece as a hypothesis has it.

    Args:
        candidate: the hypothesis.
        candidates: all hypotheses of the look.
        track: what is known of the piece; None if it is new.
        stamp_s: time of the look.
        frames_s: stamps of the frames that saw one of its planes.
        config: of placing areas.
        is_seen: whether the look shows its main plane.
    """
    return FurnitureItem(
        identifier="" if track is None else track.item.identifier,
        class_name=candidate.hypothesis.class_name,
        pose=candidate.geometry.pose,
        box=candidate.geometry.box,
        placing_area=placing_area(candidate, config),
        score=candidate.score,
        n_frames=candidate.n_frames,
        n_direct=0 if track is None else track.n_direct,
        planes=candidate.planes,
        rules=candidate.hypothesis.rules,
        alternatives=tuple(
            other.hypothesis.class_name
            for other in candidates
            if other.main_plane == candidate.main_plane
            and other.hypothesis.class_name != candidate.hypothesis.class_name
        ),
        first_seen_s=stamp_s if track is None else track.item.first_seen_s,
        last_seen_s=stamp_s if track is None or is_seen else track.item.last_seen_s,
        cad=candidate.fit,
        frames_s=frames_s,
    )
