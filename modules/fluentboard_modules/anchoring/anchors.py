"""Anchors: what the world model holds of an object, and how it changes (Section 4.2.2, Figure 4.4).

An anchor is untracked or tracked. Six functionalities create it, move it between the two states and
destroy it; anything else is a mistake of the program and refused:

    Find:      nothing   -> untracked    a fluent of another author appeared on the board
    Discover:  nothing   -> tracked      an object that is no known anchor is seen
    Reacquire: untracked -> tracked      an object is recognised as this anchor
    Track:     tracked   -> tracked      its track goes on
    Lose:      tracked   -> untracked    its track has ended
    Destroy:   untracked -> nothing      its place has been seen empty
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from fluentboard.model.geometry import BoundingBox, FloatArray
from fluentboard_modules.anchoring.config import FilterConfig
from fluentboard_modules.anchoring.estimate import BoxEstimate
from fluentboard_modules.anchoring.observation import (
    ContextBelief,
    Detection,
    SceneObject,
    SupportPlane,
)


class AnchorState(Enum):
    """Whether the object is seen at present."""

    UNTRACKED = "untracked"
    TRACKED = "tracked"


class Functionality(Enum):
    """What changes an anchor (Figure 4.4)."""

    FIND = "Find"
    DISCOVER = "Discover"
    REACQUIRE = "Reacquire"
    TRACK = "Track"
    LOSE = "Lose"
    DESTROY = "Destroy"


TRANSITIONS = {
    Functionality.FIND: (None, AnchorState.UNTRACKED),
    Functionality.DISCOVER: (None, AnchorState.TRACKED),
    Functionality.REACQUIRE: (AnchorState.UNTRACKED, AnchorState.TRACKED),
    Functionality.TRACK: (AnchorState.TRACKED, AnchorState.TRACKED),
    Functionality.LOSE: (AnchorState.TRACKED, AnchorState.UNTRACKED),
    Functionality.DESTROY: (AnchorState.UNTRACKED, None),
}
"""State before and after each functionality; None is no anchor."""


class IllegalTransition(ValueError):
    """A functionality was applied to an anchor in the wrong state."""


@dataclass(frozen=True, slots=True, eq=False)
class Anchor:
    """An object as the world model knows it.

    Attributes:
        identifier: number within this world model; it never changes and is never used again.
        state: untracked or tracked.
        estimate: its upright box, filtered over observations, with covariance.
        confidence: `(k,)`; of local recognition, averaged over observations.
        last_confidence: `(k,)`; as reported last (the vector c of Section 4.2.2).
        first_seen_s: when it was seen first, in seconds; None if never yet.
        last_seen_s: when it was seen last, in seconds; None if never yet.
        observations: how many frames have shown it.
        track_id: of its track; None if untracked.
        name: of its fluent; empty before it is written.
        class_name: of its fluent; empty before it is written.
        support: what it stands on.
        belief: of the context model; None without one.
        empty_looks: frames in a row that saw its place empty.
        is_held: whether a gripper holds it: its place on the table says nothing then.
        is_adrift: whether a gripper has put it down, nobody knows where.
        is_external: whether another author introduced it (Find).
    """

    identifier: int
    state: AnchorState
    estimate: BoxEstimate
    confidence: FloatArray
    last_confidence: FloatArray
    first_seen_s: float | None = None
    last_seen_s: float | None = None
    observations: int = 0
    track_id: int | None = None
    name: str = ""
    class_name: str = ""
    support: SupportPlane | None = None
    belief: ContextBelief | None = None
    empty_looks: int = 0
    is_held: bool = False
    is_adrift: bool = False
    is_external: bool = False

    @property
    def is_tracked(self) -> bool:
        """Whether it is seen at present."""
        return self.state is AnchorState.TRACKED

    @property
    def box(self) -> BoundingBox:
        """Its bounding box in the map frame."""
        return self.estimate.box

    @property
    def centroid_map(self) -> FloatArray:
        """`(3,)`; centre of its box."""
        return self.estimate.centre_map

    def scene_object(self) -> SceneObject:
        """The same for a context model."""
        name = str(self.identifier)
        return SceneObject(name, self.box, self.confidence, self.support, self.is_tracked)


def find(identifier: int, name: str, class_name: str, box: BoundingBox, classes: int) -> Anchor:
    """A new untracked anchor for an object that another author put on the board.

    Args:
        identifier: a number that no other anchor has had.
        name: of the object fluent.
        class_name: of the object fluent.
        box: upright box in the map frame.
        classes: how many classes local recognition knows.
    """
    state = _after(Functionality.FIND, None)
    unsure = np.full(classes, 1.0 / max(1, classes))
    return Anchor(
        identifier,
        state,
        BoxEstimate.of_box(box),
        unsure,
        unsure,
        name=name,
        class_name=class_name,
        is_external=True,
    )


def discover(identifier: int, detection: Detection, config: FilterConfig) -> Anchor:
    """A new tracked anchor for an object that is no known one."""
    state = _after(Functionality.DISCOVER, None)
    cluster, confidence = detection.cluster, detection.recognition.confidence
    return Anchor(
        identifier,
        state,
        BoxEstimate.of_cluster(cluster, config),
        confidence,
        confidence,
        first_seen_s=cluster.stamp_s,
        last_seen_s=cluster.stamp_s,
        observations=1,
        track_id=cluster.track_id,
        support=cluster.support,
    )


def reacquire(anchor: Anchor, detection: Detection, config: FilterConfig) -> Anchor:
    """The anchor bound to an object that was recognised as it."""
    state = _after(Functionality.REACQUIRE, anchor.state)
    return _observed(replace(anchor, state=state), detection, config)


def track(anchor: Anchor, detection: Detection, config: FilterConfig) -> Anchor:
    """The anchor with one more observation of its track."""
    state = _after(Functionality.TRACK, anchor.state)
    return _observed(replace(anchor, state=state), detection, config)


def lose(anchor: Anchor) -> Anchor:
    """The anchor of an object that is not seen any more."""
    return replace(anchor, state=_after(Functionality.LOSE, anchor.state), track_id=None)


def destroy(anchor: Anchor) -> None:
    """Nothing, if the anchor may be destroyed.

    Raises:
        IllegalTransition: it is being seen.
    """
    _leave(Functionality.DESTROY, anchor.state)


def _after(functionality: Functionality, state: AnchorState | None) -> AnchorState:
    after = _leave(functionality, state)
    if after is None:
        raise IllegalTransition(f"{functionality.value} leaves no anchor")
    return after


def _leave(functionality: Functionality, state: AnchorState | None) -> AnchorState | None:
    before, after = TRANSITIONS[functionality]
    if state is not before:
        raise IllegalTransition(
            f"{functionality.value} applies to {_word(before)}, not to {_word(state)}"
        )
    return after


def _word(state: AnchorState | None) -> str:
    return "no anchor" if state is None else f"an anchor that is {state.value}"


def _observed(anchor: Anchor, detection: Detection, config: FilterConfig) -> Anchor:
    cluster, confidence = detection.cluster, detection.recognition.confidence
    elapsed_s = 0.0
    if anchor.last_seen_s is not None:
        elapsed_s = max(0.0, cluster.stamp_s - anchor.last_seen_s)
    seen = anchor.observations
    # The mean of all observations at first, a sliding one later.
    weight = min(config.confidence_decay, seen / (seen + 1.0))
    # Of a part, less can be told.
    if (cluster.is_cut_off or cluster.is_occluded) and seen:
        weight = 0.5 * (1.0 + weight)
    return replace(
        anchor,
        estimate=anchor.estimate.updated(cluster, elapsed_s, config),
        confidence=weight * anchor.confidence + (1.0 - weight) * confidence,
        last_confidence=confidence,
        first_seen_s=cluster.stamp_s if anchor.first_seen_s is None else anchor.first_seen_s,
        last_seen_s=max(cluster.stamp_s, anchor.last_seen_s or cluster.stamp_s),
        observations=seen + 1,
        track_id=cluster.track_id,
        support=cluster.support or anchor.support,
        empty_looks=0,
        is_adrift=False,
    )
