"""Anchors to fluents: the statements that bring the board up to the world model (Section 4.2.4).

A discovered object is written at once, a destroyed one ended at once. Poses and boxes are fluents
of their own; when an object has moved, the present ones end and new ones begin (Listing 4.2), but
only above a threshold or, for smaller changes, after a time-out. An object that stands on a placing
area of the board has an `On` fluent. What the intervals say is as in the furniture map: an object
first seen at t may have stood there before, and a change between two looks happened between them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_modules.anchoring.anchors import Anchor, Functionality
from fluentboard_modules.anchoring.areas import PlacingAreas
from fluentboard_modules.anchoring.config import UpdateConfig
from fluentboard_modules.anchoring.evidence import (
    Rating,
    association_evidence,
    class_evidence,
    differs,
    presence_evidence,
    rate,
)
from fluentboard_modules.anchoring.removal import Look
from fluentboard_modules.anchoring.world import Decision
from fluentboard_modules.anchoring.written import Written, box_differs
from fluentboard_modules.geometry_fluents import box_fluents, pose_fluent
from fluentboard_modules.statements import Ending, Statement


@dataclass(frozen=True, slots=True)
class Scene:
    """What the world model says after a frame.

    Attributes:
        anchors: all of them.
        decisions: of this frame.
        looks: at the places of untracked anchors, by identifier.
        now_s: time of the frame.
    """

    anchors: Sequence[Anchor]
    decisions: Sequence[Decision]
    looks: Mapping[int, Look]
    now_s: float


class ObjectFluents:
    """What the board has been told about anchors.

    Args:
        classes: of the recogniser, in the order of confidences.
        context_classes: of the context model, in the order of marginals.
        config: when the board is told.
    """

    def __init__(
        self,
        classes: Sequence[str],
        context_classes: Sequence[str] = (),
        config: UpdateConfig | None = None,
    ) -> None:
        self._classes = tuple(classes)
        self._context_classes = tuple(context_classes)
        self._config = config or UpdateConfig()
        self._written: dict[int, Written] = {}
        self._names: set[str] = set()
        self.areas = PlacingAreas()

    def take_names(self, names: Iterable[str]) -> None:
        """Names that are used on the board, by whomever."""
        self._names.update(names)

    def adopt(self, identifier: int, written: Written) -> None:
        """An anchor whose fluents are on the board already."""
        self._written[identifier] = written
        self._names.add(written.name)

    def forget(self, identifier: int) -> None:
        """An anchor whose fluent somebody else has ended."""
        self._written.pop(identifier, None)

    def written(self, identifier: int) -> Written | None:
        """What the board has been told about an anchor; None if nothing."""
        return self._written.get(identifier)

    def identifier_of(self, name: str) -> int | None:
        """The anchor of an object fluent; None if it has none."""
        return next((key for key, told in self._written.items() if told.name == name), None)

    def update(self, scene: Scene, *, final: bool = False) -> list[Statement]:
        """The statements that a frame leads to.

        Args:
            scene: what the world model says.
            final: whether it is the last frame; then small improvements are written too.
        """
        statements: list[Statement] = []
        alive = {anchor.identifier for anchor in scene.anchors}
        absent = {
            decision.anchor: decision
            for decision in scene.decisions
            if decision.functionality is Functionality.DESTROY
        }
        for identifier in [known for known in self._written if known not in alive]:
            told = self._written.pop(identifier)
            statements += self._retraction(told, absent.get(identifier), scene.now_s)
        for anchor in scene.anchors:
            told = self._written.get(anchor.identifier)
            if told is None:
                told, new = self._introduction(anchor)
                statements += new
            elif not anchor.is_held:
                told, new = self._revision(told, anchor, scene, final)
                statements += new
            self._written[anchor.identifier] = told
        for anchor in scene.anchors:
            if not self._is_past(self._written[anchor.identifier], scene.now_s):
                statements += self._evidence(anchor, scene, final)
        return statements

    def _introduction(self, anchor: Anchor) -> tuple[Written, list[Statement]]:
        rating = self._rating(anchor)
        class_name = anchor.class_name or self._class_name(rating)
        name = anchor.name or free_name(class_name, self._names)
        self._names.add(name)
        start = Interval(None, anchor.first_seen_s)
        told = Written(
            name, class_name, anchor.box, anchor.last_seen_s, written_s=anchor.last_seen_s
        )
        told, parts, links = self._geometry(told, anchor, start)
        told, on = self._placed(told, anchor, start)
        thing = Fluent(name, class_name, start, UNKNOWN, links)
        return told, [thing, *parts, *on]

    def _revision(
        self, told: Written, anchor: Anchor, scene: Scene, final: bool
    ) -> tuple[Written, list[Statement]]:
        seen_s = anchor.last_seen_s
        if seen_s is None or self._is_past(told, seen_s) or (not anchor.is_tracked and not final):
            return told, []
        rating = self._rating(anchor)
        told, wrong = self._doubted(told, anchor, rating)
        if wrong:
            return self._reclassified(told, anchor, rating)
        config = self._config
        since_s = float("inf") if told.written_s is None else seen_s - told.written_s
        share = 1.0
        if final or since_s >= config.timeout_s:
            share = config.timeout_share
        elif since_s < config.rest_s:
            share = float("inf")
        if not box_differs(told.box, anchor.box, config, share):
            return replace(told, confirmed_s=seen_s), []
        change = Interval(told.confirmed_s, seen_s)
        old = told.parts
        told = replace(told, box=anchor.box, generation=told.generation + 1, written_s=seen_s)
        told, parts, links = self._geometry(told, anchor, change)
        told, on = self._placed(told, anchor, change)
        told = replace(told, confirmed_s=seen_s)
        thing = Fluent(told.name, told.class_name, properties=links)
        return told, [*parts, thing, *(Ending(part, change) for part in old), *on]

    def _geometry(
        self, told: Written, anchor: Anchor, start: Interval
    ) -> tuple[Written, list[Fluent], tuple[Property, ...]]:
        """Pose, box and box-pose fluents of Listing 4.1, and the properties that refer to them.

        The object has no frame of its own, so that its pose is that of its box.
        """
        stem = f"{capitalised(told.name)}_{told.generation}"
        pose = pose_fluent(f"pose{stem}", anchor.box.pose, start)
        sigma_m = anchor.estimate.largest_sigma_m
        pose = replace(
            pose,
            properties=(
                *pose.properties,
                Property("hasPositionSigma", "xsd:double", round(sigma_m, 4)),
            ),
        )
        fluents = [pose, *box_fluents(f"bBox{stem}", f"poseBB{stem}", anchor.box, start)]
        links = (
            Property("hasPose", "Pose", f"pose{stem}"),
            Property("hasBoundingBox", "BBox", f"bBox{stem}"),
        )
        return replace(told, parts=tuple(f.name for f in fluents)), fluents, links

    def _placed(
        self, told: Written, anchor: Anchor, since: Interval
    ) -> tuple[Written, list[Statement]]:
        """The relation to the placing area that the object stands on, if that is another one."""
        area = self.areas.under(anchor.box)
        if area is not None and area.name == told.area:
            return told, []
        statements: list[Statement] = []
        if told.on:
            statements.append(Ending(told.on, since))
        if area is None:
            return replace(told, on="", area=""), statements
        name = free_name(f"On{capitalised(told.name)}", self._names)
        self._names.add(name)
        properties = (
            Property("hasPhysicalEntity", told.class_name, told.name),
            Property("hasArea", area.class_name, area.name),
        )
        statements.append(Fluent(name, "On", since, UNKNOWN, properties))
        return replace(told, on=name, area=area.name), statements

    def prune(self, open_names: frozenset[str]) -> None:
        """Forgets fluents that somebody else has ended."""
        for identifier, told in self._written.items():
            kept = {
                slot: name if name in open_names else ""
                for slot, name in (
                    ("on", told.on),
                    ("class_evidence", told.class_evidence),
                    ("presence_evidence", told.presence_evidence),
                )
            }
            parts = tuple(part for part in told.parts if part in open_names)
            area = told.area if kept["on"] else ""
            self._written[identifier] = replace(told, parts=parts, area=area, **kept)

    def settle(self, anchors: Iterable[Anchor]) -> list[Statement]:
        """The relations to placing areas that the board has learnt of since."""
        statements: list[Statement] = []
        for anchor in anchors:
            told = self._written.get(anchor.identifier)
            if told is None or anchor.last_seen_s is None or told.area or anchor.is_held:
                continue
            if self._is_past(told, anchor.last_seen_s):
                continue
            since = Interval(None, anchor.first_seen_s)
            self._written[anchor.identifier], new = self._placed(told, anchor, since)
            statements += new
        return statements

    def lifted(self, identifier: int, since: Interval) -> list[Statement]:
        """A gripper holds the object: it stands on nothing, and its place ends."""
        told = self._written.get(identifier)
        if told is None or not told.on:
            return []
        self._written[identifier] = replace(told, on="", area="")
        return [Ending(told.on, since)]

    def _retraction(
        self, told: Written, decision: Decision | None, now_s: float
    ) -> list[Statement]:
        """Everything about an object that has gone ends."""
        if self._is_past(told, now_s):
            return []
        finish = Interval(told.confirmed_s, now_s)
        names = (told.name, *told.parts, told.on, told.class_evidence, told.presence_evidence)
        statements: list[Statement] = [Ending(name, finish) for name in names if name]
        if decision is not None and decision.look is not None:
            statements.append(presence_evidence(told, decision.look, finish, Interval.at(now_s)))
        return statements

    def _reclassified(
        self, told: Written, anchor: Anchor, rating: Rating
    ) -> tuple[Written, list[Statement]]:
        """A fluent cannot change its class: it ends, and one of the right class continues it."""
        seen_s = anchor.last_seen_s
        ended = self._retraction(told, None, seen_s if seen_s is not None else 0.0)
        renamed, begun = self._introduction(replace(anchor, name="", class_name=rating.best))
        thing = begun[0]
        if isinstance(thing, Fluent):
            link = Property("continues", told.class_name, told.name)
            begun[0] = replace(thing, properties=(*thing.properties, link))
        return renamed, [*ended, *begun]

    def _doubted(self, told: Written, anchor: Anchor, rating: Rating) -> tuple[Written, bool]:
        """Counts looks that contradict the written class; whether they are enough."""
        config = self._config
        contradicts = (
            not anchor.is_external
            and rating.best != told.class_name
            and rating.probability >= config.reclassify_probability
        )
        doubts = told.doubts + 1 if contradicts else 0
        enough = config.reclassify_frames > 0 and doubts >= config.reclassify_frames
        return replace(told, doubts=doubts), enough

    def _evidence(self, anchor: Anchor, scene: Scene, final: bool) -> list[Statement]:
        told = self._written[anchor.identifier]
        statements: list[Statement] = []
        for decision in scene.decisions:
            is_match = decision.functionality in (Functionality.DISCOVER, Functionality.REACQUIRE)
            if decision.anchor == anchor.identifier and is_match:
                rival = self._written.get(decision.runner_up or 0)
                statements.append(association_evidence(told, decision, rival))
        told, new = self._class_told(told, anchor, scene.now_s, final)
        statements += new
        told, new = self._presence_told(told, scene.looks.get(anchor.identifier), scene.now_s)
        self._written[anchor.identifier] = told
        return statements + new

    def _class_told(
        self, told: Written, anchor: Anchor, now_s: float, final: bool
    ) -> tuple[Written, list[Statement]]:
        rating = self._rating(anchor)
        if anchor.last_seen_s is None or not differs(told.rating, rating):
            return told, []
        rested = told.rated_s is None or now_s - told.rated_s >= self._config.evidence_s
        if told.rating is not None and not rested and not final:
            return told, []
        since = Interval.at(now_s)
        statements: list[Statement] = []
        if told.class_evidence:
            statements.append(Ending(told.class_evidence, since))
        fluent = class_evidence(told, rating, anchor.observations, now_s)
        statements.append(fluent)
        return (
            replace(told, class_evidence=fluent.name, rating=rating, rated_s=now_s),
            statements,
        )

    def _presence_told(
        self, told: Written, look: Look | None, now_s: float
    ) -> tuple[Written, list[Statement]]:
        """What looks at the place of an unseen object say, once two in a row agree."""
        presence = "" if look is None else look.presence.value
        if presence == told.presence:
            return replace(told, presence_next=presence), []
        if presence != told.presence_next:
            return replace(told, presence_next=presence), []
        since = Interval.at(now_s)
        statements: list[Statement] = []
        if told.presence_evidence:
            statements.append(Ending(told.presence_evidence, since))
        name = ""
        if look is not None:
            fluent = presence_evidence(told, look, since)
            statements.append(fluent)
            name = fluent.name
        return replace(told, presence=presence, presence_evidence=name), statements

    def _rating(self, anchor: Anchor) -> Rating:
        return rate(anchor, self._classes, self._context_classes)

    def _class_name(self, rating: Rating) -> str:
        is_sure = rating.probability >= self._config.class_probability
        return rating.best if is_sure and rating.best else self._config.unknown_class

    def _is_past(self, told: Written, now_s: float) -> bool:
        """Whether the board knows from later times: a recording is being played again."""
        return told.confirmed_s is not None and now_s < told.confirmed_s


def free_name(stem: str, taken: set[str]) -> str:
    """The stem with a small first letter and the lowest number that makes it a new name."""
    small = stem[:1].lower() + stem[1:]
    number = 1
    while f"{small}{number}" in taken:
        number += 1
    return f"{small}{number}"


def capitalised(name: str) -> str:
    """The name with a capital first letter, as part of another name."""
    return name[:1].upper() + name[1:]
