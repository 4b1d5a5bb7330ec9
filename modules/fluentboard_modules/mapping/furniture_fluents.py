"""Furniture to fluents: the statements that bring the board up to what was seen (pure).

Every piece of furniture is a fluent of its class with poses and bounding boxes as fluents of their
own (Listing 4.1). When a piece has moved, or more of it has been seen, the old pose and box are
ended and new ones begin (Listing 4.2). Tops on which things can be put are placing areas.

What the intervals say. A piece that is first seen at time t stands there at t and may have stood
there before, for all anybody knows: its start is [unknown, t], so it certainly holds from t on and
possibly at any time before. A wholly unknown start would say that it certainly stood there before
the record began, which nobody has seen. A change between two looks at s and t happened at some time
in [s, t]: the old pose ends within that interval, and the new one starts within it.

A piece whose place was seen empty is missing: pose, box, planes and areas end, the piece does not.
If a piece of its class and size turns up elsewhere soon, that is it, and it gets a new pose;
otherwise it ends as well, when it was seen to be gone.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_modules.mapping.area_fluents import area_fluents, floor_areas
from fluentboard_modules.mapping.config import ExistenceConfig
from fluentboard_modules.mapping.existence import combined_belief
from fluentboard_modules.mapping.furniture_item import FurnitureItem, box_overlap
from fluentboard_modules.mapping.piece_fluents import (
    evidence_of,
    fit_properties,
    geometry,
    last_planes,
    later,
    names_of,
    place_endings,
    placed,
    plane_name,
    rule_properties,
)
from fluentboard_modules.mapping.plane_fluents import plane_fluents
from fluentboard_modules.mapping.written_furniture import (
    Departed,
    Estimate,
    UpdateConfig,
    Written,
)
from fluentboard_modules.statements import Ending, Statement


@dataclass(frozen=True, slots=True)
class FurnitureFluents:
    """What the board has been told so far; `update` gives the next state and what to write.

    Attributes:
        written: by the identifier that the furniture map gave the piece.
        remembered: what the board knew before, and nobody has seen again yet.
        missing: what has gone from its place, and may turn up elsewhere.
        names: names of furniture that are taken.
        moved: names of what turned up at another place, in the order of their finding.
        gone: names of what was ended.
        config: thresholds.
        existence: how beliefs of several runs add up.
        symmetry_order: per class, how many turns within a full circle look alike.
    """

    written: Mapping[str, Written] = field(default_factory=dict[str, Written])
    remembered: tuple[Written, ...] = ()
    missing: tuple[Departed, ...] = ()
    names: frozenset[str] = frozenset()
    moved: tuple[str, ...] = ()
    gone: tuple[str, ...] = ()
    config: UpdateConfig = field(default_factory=UpdateConfig)
    existence: ExistenceConfig = field(default_factory=ExistenceConfig)
    symmetry_order: Mapping[str, int] = field(default_factory=dict[str, int])

    def update(
        self,
        items: Sequence[FurnitureItem],
        now_s: float,
        *,
        final: bool = False,
        gone: Collection[str] = (),
        doubts: Mapping[str, float] | None = None,
    ) -> tuple[FurnitureFluents, list[Statement]]:
        """The statements that a look leads to, and what the board has been told after them.

        Args:
            items: all furniture that is believed in at present.
            now_s: time of the look.
            final: whether it is the last one; then small improvements are written too, and what is
                missing is given up.
            gone: names of remembered pieces whose places were seen empty.
            doubts: what is left of the belief in remembered pieces whose places were seen empty,
                but not often enough; written with the last look, for the run after this one.
        """
        written = dict(self.written)
        remembered = list(self.remembered)
        names = set(self.names)
        missing = list(self.missing)
        moved = list(self.moved)
        statements: list[Statement] = []
        believed = {item.identifier for item in items}
        lost = [written.pop(identifier) for identifier in [*written] if identifier not in believed]
        lost += [known for known in remembered if known.name in gone]
        remembered = [known for known in remembered if known.name not in gone]
        for known in lost:
            departed, endings = _departure(known, now_s)
            missing += departed
            statements += endings
        for item in items:
            known = written.get(item.identifier)
            if known is None:
                known = self._recalled(item, remembered)
            back = self._found_again(item, missing) if known is None else None
            if back is not None:
                known, new = self._arrival(back.known, item)
                moved += [known.name] if known.name not in moved else []
            elif known is None:
                name = _free_name(item.class_name, names)
                names.add(name)
                known, new = self._introduction(name, item)
            else:
                known, new = self._revision(known, item, final)
            statements += new
            if final:
                known, new = last_planes(known, item)
                statements += new
            belief = combined_belief(known.belief_before, item.score, self.existence)
            is_due = final or abs(belief - known.belief) >= self.config.belief
            known, new = evidence_of(known, item.frames_s, belief, now_s, is_due=is_due)
            statements += new
            written[item.identifier] = known
        if final and doubts:
            for k, known in enumerate(remembered):
                if known.name in doubts:
                    remembered[k], new = evidence_of(
                        known, (), doubts[known.name], now_s, is_due=True
                    )
                    statements += new
        given_up = [
            departed
            for departed in missing
            if final or now_s - later(departed.since.latest, -math.inf) > self.config.missing_s
        ]
        statements += [Ending(departed.known.name, departed.since) for departed in given_up]
        state = replace(
            self,
            written=written,
            remembered=tuple(remembered),
            missing=tuple(departed for departed in missing if departed not in given_up),
            names=frozenset(names),
            moved=tuple(moved),
            gone=(*self.gone, *(departed.known.name for departed in given_up)),
        )
        return state, statements

    def _estimate(self, item: FurnitureItem) -> Estimate:
        order = self.symmetry_order.get(item.class_name, 1)
        return Estimate(item.class_name, item.pose, item.box, order)

    def _recalled(self, item: FurnitureItem, remembered: list[Written]) -> Written | None:
        """The piece that the board knows from before, taken off the list, or None."""
        rated = [
            (box_overlap(known.estimate.box, item.box), known)
            for known in remembered
            if known.estimate.class_name == item.class_name
        ]
        best = max(rated, key=lambda pair: pair[0], default=None)
        if best is None or best[0] < self.config.same_place_overlap:
            return None
        remembered.remove(best[1])
        return best[1]

    def _found_again(self, item: FurnitureItem, missing: list[Departed]) -> Departed | None:
        """The piece that was missing and stands here now, taken off the list, or None."""
        estimate = self._estimate(item)
        possible = [
            departed
            for departed in missing
            if departed.may_be(estimate, item.first_seen_s, self.config)
        ]
        if not possible:
            return None
        here = np.array([item.box.pose.x, item.box.pose.y])

        def distance_m(departed: Departed) -> float:
            pose = departed.known.estimate.box.pose
            return float(np.linalg.norm(here - (pose.x, pose.y)))

        nearest = min(possible, key=distance_m)
        missing.remove(nearest)
        return nearest

    def _introduction(self, name: str, item: FurnitureItem) -> tuple[Written, list[Statement]]:
        start = Interval(None, item.first_seen_s)
        known = Written(
            name,
            self._estimate(item),
            item.last_seen_s,
            generation=0,
            parts=(),
            belief_before=self.existence.prior,
        )
        return self._standing(known, item, start, start)

    def _arrival(self, known: Written, item: FurnitureItem) -> tuple[Written, list[Statement]]:
        """A piece at a new place: it came there after it was last seen at the old one."""
        since = Interval(known.confirmed_s, item.first_seen_s)
        known = replace(
            known,
            estimate=self._estimate(item),
            confirmed_s=later(known.confirmed_s, item.last_seen_s),
            generation=known.generation + 1,
            plane_number=known.plane_number + 1,
        )
        return self._standing(known, item, UNKNOWN, since)

    def _standing(
        self, known: Written, item: FurnitureItem, start: Interval, since: Interval
    ) -> tuple[Written, list[Statement]]:
        """A piece with everything that says where it stands.

        Args:
            known: the piece without its parts.
            item: the same as it was seen.
            start: of the piece; unknown if the board knows it.
            since: since when it stands there.
        """
        parts, links = geometry(known.name, item, known.generation, since)
        stem = plane_name(known.name, known.plane_number)
        planes, plane_links = plane_fluents(stem, item, since)
        new_rules = tuple(rule for rule in item.rules if rule not in known.rules)
        fit = fit_properties(item, known.model)
        properties = (*links, *plane_links, *rule_properties(new_rules), *fit)
        thing = Fluent(known.name, item.class_name, start, UNKNOWN, properties)
        known = replace(
            known,
            parts=names_of(parts),
            planes=names_of(planes),
            plane_frames=item.n_frames,
            rules=(*known.rules, *new_rules),
            written_s=item.last_seen_s,
            model=item.cad.model if item.cad is not None else known.model,
        )
        known, area = placed(known, item, since)
        known, on_floor = self._on_the_floor(known, item, since)
        return known, [thing, *parts, *planes, *area, *on_floor]

    def _revision(
        self, known: Written, item: FurnitureItem, final: bool
    ) -> tuple[Written, list[Statement]]:
        estimate = self._estimate(item)
        new_rules = tuple(rule for rule in item.rules if rule not in known.rules)
        share = self.config.final_share if final else 1.0
        # A recording may be played again: what the board knows from later times stays.
        is_past = known.confirmed_s is not None and item.last_seen_s < known.confirmed_s
        if is_past or not known.estimate.differs(estimate, self.config, share):
            known = replace(
                known,
                confirmed_s=later(known.confirmed_s, item.last_seen_s),
                rules=(*known.rules, *new_rules),
            )
            if not new_rules:
                return known, []
            return known, [
                Fluent(known.name, item.class_name, properties=rule_properties(new_rules))
            ]
        if not final and self._is_resting(known, estimate, item.last_seen_s):
            return known, []
        change = Interval(known.confirmed_s, item.last_seen_s)
        generation = known.generation + 1
        fit = fit_properties(item, known.model)
        parts, links = geometry(known.name, item, generation, change)
        statements: list[Statement] = [
            *parts,
            Fluent(
                known.name, item.class_name, properties=(*links, *rule_properties(new_rules), *fit)
            ),
            *(Ending(part, change) for part in known.parts),
        ]
        known = replace(
            known,
            estimate=estimate,
            confirmed_s=later(known.confirmed_s, item.last_seen_s),
            generation=generation,
            parts=names_of(parts),
            rules=(*known.rules, *new_rules),
            model=item.cad.model if item.cad is not None else known.model,
            written_s=item.last_seen_s,
        )
        known, area = placed(known, item, change)
        known, on_floor = self._on_the_floor(known, item, change)
        return known, [*statements, *area, *on_floor]

    def _on_the_floor(
        self, known: Written, item: FurnitureItem, since: Interval
    ) -> tuple[Written, list[Statement]]:
        """The areas on the floor at a piece, new or with new boxes."""
        areas = floor_areas(item, self.symmetry_order.get(item.class_name, 1))
        written, fluents, ended = area_fluents(
            known.name, item, areas, known.areas, known.generation, since
        )
        endings = [Ending(name, since) for name in ended]
        return replace(known, areas=written), [*fluents, *endings]

    def _is_resting(self, known: Written, estimate: Estimate, now_s: float) -> bool:
        """Whether it was written a moment ago and has not changed much since."""
        if known.written_s is None or now_s - known.written_s >= self.config.rest_s:
            return False
        return not known.estimate.differs(estimate, self.config, self.config.urgent)


def _departure(known: Written, now_s: float) -> tuple[list[Departed], list[Statement]]:
    """What is left of a piece that is not where it was, and what ends with its place."""
    if (
        known.confirmed_s is not None and now_s < known.confirmed_s
    ):  # a recording is played again, and this is before its time
        return [], []
    since = Interval(known.confirmed_s, now_s)
    known, endings = place_endings(known, since)
    return [Departed(known, since)], endings


def _free_name(class_name: str, taken: set[str]) -> str:
    stem = class_name[0].lower() + class_name[1:]
    number = 1
    while f"{stem}{number}" in taken:
        number += 1
    return f"{stem}{number}"
