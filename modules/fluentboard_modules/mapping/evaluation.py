"""Furniture found against furniture that is there: who is whom, and how good that is (pure)."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

from fluentboard.model.geometry import BoundingBox

if TYPE_CHECKING:
    from fluentboard_modules.simulation.scene import Scene

# A detection counts if it is this near to a true piece of its class (Section 3.3.1), in metres.
TOLERANCE_M: Mapping[str, float] = {"Chair": 0.15, "Shelf": 0.25, "Cabinet": 0.25}
_OTHER_TOLERANCE_M = 0.45


def tolerance_m(class_name: str) -> float:
    """How far a detection of a class may be off, in metres."""
    return TOLERANCE_M.get(class_name, _OTHER_TOLERANCE_M)


class Placed(Protocol):
    """Anything with a class and a bounding box in the map frame."""

    @property
    def class_name(self) -> str:
        """Its class in the furniture ontology."""
        ...

    @property
    def box(self) -> BoundingBox:
        """Its bounding box."""
        ...


Found = TypeVar("Found", bound=Placed)


@dataclass(frozen=True, slots=True)
class TruePiece:
    """A piece of furniture as it really stands: name, class, and box in the map frame."""

    name: str
    class_name: str
    box: BoundingBox


@dataclass(frozen=True, slots=True)
class Match(Generic[Found]):
    """Something found with the true piece that it is; either is None if it has no partner.

    Attributes:
        found: what was found.
        true: what is there.
        distance_m: between the centres of the two boxes, seen from above.
    """

    found: Found | None
    true: TruePiece | None
    distance_m: float = math.nan


@dataclass(frozen=True, slots=True)
class Score:
    """How good a set of matches is, as in Table 3.1.

    Attributes:
        true_positives: found and there.
        false_positives: found but not there.
        false_negatives: there but not found.
        mean_distance_m: of the true positives; NaN if there are none.
    """

    true_positives: int
    false_positives: int
    false_negatives: int
    mean_distance_m: float

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall; 1 for nothing found where nothing is."""
        wrong = self.false_positives + self.false_negatives
        total = 2 * self.true_positives + wrong
        return 2 * self.true_positives / total if total else 1.0


def true_furniture(scene: Scene, classes: Collection[str]) -> list[TruePiece]:
    """The furniture of a simulated scene, as far as it is of one of the classes."""
    return [
        TruePiece(instance.name, instance.cls, instance.box)
        for instance in scene.objects
        if instance.cls in classes
    ]


def compare(found: Sequence[Found], true: Sequence[TruePiece]) -> list[Match[Found]]:
    """Finds and true pieces of the same class, nearest pairs first; each is used once.

    Pieces further apart than the tolerance of their class have no partner.
    """
    pairs = sorted(
        (_distance_m(one.box, piece.box), i, k)
        for i, one in enumerate(found)
        for k, piece in enumerate(true)
        if one.class_name == piece.class_name
    )
    partner_of: dict[int, tuple[int, float]] = {}
    taken: set[int] = set()
    for distance_m, i, k in pairs:
        is_near = distance_m <= tolerance_m(found[i].class_name)
        if i not in partner_of and k not in taken and is_near:
            partner_of[i] = (k, distance_m)
            taken.add(k)
    matches: list[Match[Found]] = []
    for i, one in enumerate(found):
        if i in partner_of:
            k, distance_m = partner_of[i]
            matches.append(Match(one, true[k], distance_m))
        else:
            matches.append(Match(one, None))
    return matches + [Match(None, piece) for k, piece in enumerate(true) if k not in taken]


def score(matches: Sequence[Match[Found]]) -> Score:
    """Counts of hits, inventions and misses, and how far off the hits are."""
    hits = [match for match in matches if match.found is not None and match.true is not None]
    return Score(
        len(hits),
        sum(match.true is None for match in matches),
        sum(match.found is None for match in matches),
        sum(match.distance_m for match in hits) / len(hits) if hits else math.nan,
    )


def _distance_m(a: BoundingBox, b: BoundingBox) -> float:
    return math.hypot(a.pose.x - b.pose.x, a.pose.y - b.pose.y)
