"""The world model: anchors over time, one step per frame (Section 4.2.2).

The steps are those of the thesis: objects whose track has an anchor update it (Track), anchors
whose track has ended become untracked (Lose), new objects are matched with untracked anchors nearby
(Reacquire) or become anchors (Discover), untracked anchors whose place is seen to be empty go
(Destroy), and a context model rates all classes together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fluentboard.model.geometry import BoundingBox
from fluentboard_modules.anchoring import anchors as functionality
from fluentboard_modules.anchoring.anchors import Anchor, Functionality
from fluentboard_modules.anchoring.association import Match, assign_objects, gated_mismatch
from fluentboard_modules.anchoring.config import WorldConfig
from fluentboard_modules.anchoring.observation import ContextModel, Detection
from fluentboard_modules.anchoring.overlaps import shared_footprint
from fluentboard_modules.anchoring.removal import Look, Presence, look_at
from fluentboard_modules.anchoring.similarity import Appearance, MismatchModel
from fluentboard_modules.frames.sensor_frame import SensorFrame

_PENDING_S = 3.0  # what has not been seen again for so long was nothing


@dataclass(frozen=True, slots=True)
class Decision:
    """One step of an anchor, with what it rests on.

    Attributes:
        functionality: what happened.
        anchor: identifier of the anchor.
        stamp_s: when.
        track_id: of the object; None where no object was seen.
        mismatch: of object and anchor at Reacquire; 0 at Discover.
        runner_up: identifier of the anchor that was the next best match, if any.
        runner_up_mismatch: mismatch with it.
        look: at its place, at Destroy.
    """

    functionality: Functionality
    anchor: int
    stamp_s: float
    track_id: int | None = None
    mismatch: float | None = None
    runner_up: int | None = None
    runner_up_mismatch: float | None = None
    look: Look | None = None


@dataclass(slots=True)
class _Pending:
    """A track that is not an anchor yet."""

    detections: list[Detection] = field(default_factory=list)
    waits: int = 0

    @property
    def latest(self) -> Detection:
        return self.detections[-1]

    def weight(self, config: WorldConfig) -> float:
        """How many frames have shown it; those that cut it off count less."""
        return sum(
            config.cut_off_weight if detection.cluster.is_cut_off else 1.0
            for detection in self.detections
        )


class World:
    """Anchors and what happens to them.

    Args:
        classes: of the recogniser.
        mismatch: rates pairs of object and anchor.
        config: of filter, association and removal.
        context: rates classes together; None leaves them to local recognition.
    """

    def __init__(
        self,
        classes: Sequence[str],
        mismatch: MismatchModel,
        config: WorldConfig | None = None,
        context: ContextModel | None = None,
    ) -> None:
        self._config = config or WorldConfig()
        mismatch.check_classes(classes)
        self._classes = tuple(classes)
        self._mismatch = mismatch
        self._context = context
        self._anchors: dict[int, Anchor] = {}
        self._pending: dict[int, _Pending] = {}
        self._looks: dict[int, Look] = {}
        self._issued = 0

    @property
    def anchors(self) -> list[Anchor]:
        """All anchors, in the order of their identifiers."""
        return [self._anchors[key] for key in sorted(self._anchors)]

    @property
    def classes(self) -> tuple[str, ...]:
        """The classes of local recognition, in the order of confidences."""
        return self._classes

    @property
    def looks(self) -> dict[int, Look]:
        """The last look at the place of each untracked anchor, by identifier."""
        return dict(self._looks)

    def anchor(self, identifier: int) -> Anchor | None:
        """The anchor of an identifier; None if there is none any more."""
        return self._anchors.get(identifier)

    def find(self, name: str, class_name: str, box: BoundingBox) -> Anchor:
        """A new untracked anchor for an object that the board knows (Find)."""
        anchor = functionality.find(
            self._next_identifier(), name, class_name, box, len(self._classes)
        )
        if class_name in self._classes:
            told = np.full(len(self._classes), 0.0)
            told[self._classes.index(class_name)] = 1.0
            anchor = replace(anchor, confidence=told, last_confidence=told)
        self._anchors[anchor.identifier] = anchor
        return anchor

    def change(self, anchor: Anchor) -> None:
        """Takes over a new state of an anchor, as the board or a user has it."""
        if anchor.identifier in self._anchors:
            self._anchors[anchor.identifier] = anchor

    def remove(self, identifier: int) -> None:
        """Drops an anchor that somebody else has ended."""
        self._anchors.pop(identifier, None)
        self._looks.pop(identifier, None)

    def update(self, detections: Sequence[Detection], frame: SensorFrame) -> list[Decision]:
        """One frame: what it did to the anchors, in order.

        Args:
            detections: objects of the frame. Without track identifiers all anchors are lost and
                reacquired in every frame, as Section 4.2.2 says.
            frame: its depth image, for looks at anchors that were not seen.
        """
        now_s = frame.stamp_s
        decisions = self._track(detections)
        decisions += self._lose(detections, now_s)
        decisions += self._associate(detections, now_s)
        decisions += self._destroy(frame)
        self._rate_classes()
        return decisions

    def _track(self, detections: Sequence[Detection]) -> list[Decision]:
        by_track = {a.track_id: a for a in self._anchors.values() if a.is_tracked}
        decisions: list[Decision] = []
        for detection in detections:
            anchor = by_track.get(detection.track_id)
            if anchor is None or detection.track_id is None:
                continue
            tracked = functionality.track(anchor, detection, self._config.filter)
            self._anchors[anchor.identifier] = tracked
            decisions.append(
                Decision(
                    Functionality.TRACK,
                    anchor.identifier,
                    detection.cluster.stamp_s,
                    detection.track_id,
                )
            )
        return decisions

    def _lose(self, detections: Sequence[Detection], now_s: float) -> list[Decision]:
        seen = {d.track_id for d in detections if d.track_id is not None}
        decisions: list[Decision] = []
        for anchor in self.anchors:
            if anchor.is_tracked and anchor.track_id not in seen:
                self._anchors[anchor.identifier] = functionality.lose(anchor)
                decisions.append(
                    Decision(Functionality.LOSE, anchor.identifier, now_s, anchor.track_id)
                )
        return decisions

    def _associate(self, detections: Sequence[Detection], now_s: float) -> list[Decision]:
        tracks = {a.track_id for a in self._anchors.values() if a.is_tracked}
        new = [d for d in detections if d.track_id is None or d.track_id not in tracks]
        candidates = [a for a in self.anchors if not a.is_tracked and not a.is_held]
        cost = gated_mismatch(
            [_appearance_of(d) for d in new],
            [Appearance(a.box, a.confidence, is_adrift=a.is_adrift) for a in candidates],
            self._mismatch,
            self._config.association.gate_m,
        )
        decisions: list[Decision] = []
        for detection, match in zip(
            new, assign_objects(cost, self._config.association), strict=True
        ):
            decision = self._settle(detection, match, candidates, now_s)
            if decision is not None:
                decisions.append(decision)
        self._pending = {
            track: pending
            for track, pending in self._pending.items()
            if now_s - pending.latest.cluster.stamp_s <= _PENDING_S
        }
        return decisions

    def _settle(
        self, detection: Detection, match: Match, candidates: Sequence[Anchor], now_s: float
    ) -> Decision | None:
        """Reacquires, discovers, or waits for more observations."""
        track = -1 if detection.track_id is None else detection.track_id
        runner_up = None if match.runner_up is None else candidates[match.runner_up].identifier
        if match.anchor is not None and match.is_decided:
            anchor = candidates[match.anchor]
            self._anchors[anchor.identifier] = functionality.reacquire(
                anchor, detection, self._config.filter
            )
            self._pending.pop(track, None)
            self._looks.pop(anchor.identifier, None)
            return Decision(
                Functionality.REACQUIRE,
                anchor.identifier,
                now_s,
                detection.track_id,
                match.cost,
                runner_up,
                match.runner_up_cost,
            )
        if match.is_left_over:
            return None
        pending = self._pending.setdefault(track, _Pending())
        pending.detections.append(detection)
        if not match.is_decided:
            pending.waits += 1
            if pending.waits <= self._config.confirm_frames:
                return None
        needed = 1 if detection.track_id is None else self._config.confirm_frames
        if pending.weight(self._config) < needed or self._is_part_of_tracked(detection):
            return None
        anchor = self._discovered(pending.detections)
        del self._pending[track]
        return Decision(
            Functionality.DISCOVER,
            anchor.identifier,
            now_s,
            detection.track_id,
            0.0,
            runner_up,
            match.runner_up_cost,
        )

    def _discovered(self, detections: Sequence[Detection]) -> Anchor:
        anchor = functionality.discover(self._next_identifier(), detections[0], self._config.filter)
        for detection in detections[1:]:
            anchor = functionality.track(anchor, detection, self._config.filter)
        self._anchors[anchor.identifier] = anchor
        return anchor

    def _is_part_of_tracked(self, detection: Detection) -> bool:
        """Whether it lies where an anchor is that is being seen: one object in two pieces."""
        return any(
            shared_footprint(detection.cluster.box, anchor.box) > self._config.overlap_same
            for anchor in self._anchors.values()
            if anchor.is_tracked
        )

    def _destroy(self, frame: SensorFrame) -> list[Decision]:
        config = self._config.removal
        decisions: list[Decision] = []
        tracked = [a for a in self._anchors.values() if a.is_tracked]
        for anchor in self.anchors:
            if anchor.is_tracked or anchor.is_held or anchor.is_adrift:
                self._looks.pop(anchor.identifier, None)
                continue
            look = look_at(anchor.box, frame.depth_m, frame.camera, frame.T_map_sensor, config)
            self._looks[anchor.identifier] = look
            # Two objects cannot be in one place: what is seen there has replaced it.
            is_replaced = look.presence is Presence.PRESENT and any(
                shared_footprint(anchor.box, other.box) > self._config.overlap_replaced
                and shared_footprint(other.box, anchor.box, of_first=True)
                > self._config.overlap_replaced
                for other in tracked
            )
            if look.presence is Presence.ABSENT or is_replaced:
                looks = anchor.empty_looks + 1
            elif look.presence is Presence.PRESENT:
                looks = 0
            else:
                looks = anchor.empty_looks
            self._anchors[anchor.identifier] = replace(anchor, empty_looks=looks)
            if looks >= config.confirm_frames:
                functionality.destroy(anchor)
                del self._anchors[anchor.identifier]
                del self._looks[anchor.identifier]
                decisions.append(
                    Decision(Functionality.DESTROY, anchor.identifier, frame.stamp_s, look=look)
                )
        return decisions

    def _rate_classes(self) -> None:
        if self._context is None or not self._anchors:
            return
        beliefs = self._context.infer([anchor.scene_object() for anchor in self.anchors])
        for name, belief in beliefs.items():
            anchor = self._anchors[int(name)]
            self._anchors[anchor.identifier] = replace(anchor, belief=belief)

    def _next_identifier(self) -> int:
        self._issued += 1
        return self._issued


def _appearance_of(detection: Detection) -> Appearance:
    cluster = detection.cluster
    is_part = cluster.is_cut_off or cluster.is_occluded
    return Appearance(cluster.box, detection.recognition.confidence, is_part)
