"""Evidence fluents: what each decision about an object rests on (pure)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.geometry import FloatArray
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_modules.anchoring.anchors import Anchor
from fluentboard_modules.anchoring.removal import Look
from fluentboard_modules.anchoring.world import Decision

_DIGITS = 4
_CHANGED = 0.1  # smaller changes of a probability are not worth a fluent


class Named(Protocol):
    """An object fluent."""

    @property
    def name(self) -> str:
        """Of the fluent."""
        ...

    @property
    def class_name(self) -> str:
        """Of the fluent."""
        ...


@dataclass(frozen=True, slots=True)
class Rating:
    """How probable the classes of an object are.

    Attributes:
        best: the most probable class, given the context if there is a context model.
        probability: of that class.
        marginals: of the context model, by class; empty without one.
        local: confidences of local recognition, by class.
    """

    best: str
    probability: float
    marginals: dict[str, float] = field(default_factory=dict[str, float])
    local: dict[str, float] = field(default_factory=dict[str, float])


def rate(anchor: Anchor, classes: Sequence[str], context_classes: Sequence[str]) -> Rating:
    """What is believed about the class of an anchor."""
    local = _by_class(classes, anchor.confidence)
    belief = anchor.belief
    if belief is not None:
        marginals = _by_class(context_classes, belief.marginals)
        return Rating(belief.best, marginals.get(belief.best, 0.0), marginals, local)
    best = max(local, key=lambda name: local[name], default="")
    return Rating(best, local.get(best, 0.0), {}, local)


def differs(told: Rating | None, now: Rating) -> bool:
    """Whether the board should hear of a rating."""
    if told is None:
        return bool(now.local)
    if told.best != now.best:
        return True
    names = {*told.marginals, *now.marginals, *told.local, *now.local}
    return any(
        abs(before.get(name, 0.0) - after.get(name, 0.0)) > _CHANGED
        for before, after in ((told.marginals, now.marginals), (told.local, now.local))
        for name in names
    )


def association_evidence(thing: Named, decision: Decision, rival: Named | None) -> Fluent:
    """Why a seen object was taken for this one, or for a new one."""
    properties = [
        Property("isEvidenceFor", thing.class_name, thing.name),
        Property("hasFunctionality", "xsd:string", decision.functionality.value),
    ]
    if decision.mismatch is not None:
        properties.append(_number("hasMismatch", decision.mismatch))
    if rival is not None and decision.runner_up_mismatch is not None:
        properties += [
            Property("hasRunnerUp", rival.class_name, rival.name),
            _number("hasRunnerUpMismatch", decision.runner_up_mismatch),
        ]
    at = Interval.at(decision.stamp_s)
    name = _evidence_name("association", thing, decision.stamp_s)
    return Fluent(name, "AssociationEvidence", at, at, tuple(properties))


def class_evidence(thing: Named, rating: Rating, observations: int, now_s: float) -> Fluent:
    """How probable each class is, from now until further notice."""
    properties = [
        Property("isEvidenceFor", thing.class_name, thing.name),
        Property("hasBestClass", "xsd:string", rating.best),
        _number("hasConfidence", rating.probability),
        Property("hasLocalConfidences", "xsd:string", _json(rating.local)),
        Property("hasObservationCount", "xsd:integer", observations),
    ]
    if rating.marginals:
        properties.append(Property("hasMarginals", "xsd:string", _json(rating.marginals)))
    name = _evidence_name("classEvidence", thing, now_s)
    return Fluent(name, "ClassEvidence", Interval.at(now_s), UNKNOWN, tuple(properties))


def presence_evidence(
    thing: Named, look: Look, since: Interval, until: Interval = UNKNOWN
) -> Fluent:
    """What a look at the place of an object says."""
    properties = [
        Property("isEvidenceFor", thing.class_name, thing.name),
        Property("hasPresence", "xsd:string", look.presence.value),
    ]
    if look.pixels:
        properties.append(_number("hasSeenThroughShare", look.behind / look.pixels))
    stamp_s = next(time for time in (since.latest, since.earliest, 0.0) if time is not None)
    word = "".join(part.capitalize() for part in look.presence.value.split())
    name = _evidence_name(f"presence{word}", thing, stamp_s)
    return Fluent(name, "PresenceEvidence", since, until, tuple(properties))


def read_ratings(text: str, classes: Sequence[str]) -> FloatArray | None:
    """`(k,)`; confidences from the JSON of an evidence fluent; None if the classes differ."""
    try:
        told = json.loads(text)
        if not isinstance(told, dict) or not set(told) <= set(classes):
            return None
        return np.array([min(1.0, max(0.0, float(told.get(name, 0.0)))) for name in classes])
    except (ValueError, TypeError):
        return None


def _by_class(classes: Sequence[str], values: FloatArray) -> dict[str, float]:
    return dict(zip(classes, (round(float(value), _DIGITS) for value in values), strict=True))


def _json(values: dict[str, float]) -> str:
    return json.dumps({name: value for name, value in values.items() if value > 0.0})


def _number(name: str, value: float) -> Property:
    return Property(name, "xsd:double", round(float(value), _DIGITS))


def _evidence_name(stem: str, thing: Named, stamp_s: float) -> str:
    """Unique, since no object has two pieces of evidence of a kind in one frame."""
    return f"{stem}{thing.name[:1].upper()}{thing.name[1:]}_{round(stamp_s * 1000.0)}"
