"""The protocol of Section 3.3.1: detections against true poses, the columns of Table 3.1 (pure).

A detection is a true positive if a true object of its model is within 15 cm (chairs), 25 cm
(shelves) or 45 cm (all else) of it, each object at most once, the nearest first. The errors are
those of the true positives: where the planes alone had put them, and after verification.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fluentboard.model.geometry import FloatArray, Pose
from fluentboard_modules.mapping.evaluation import TOLERANCE_M

_OTHER_TOLERANCE_M = 0.45


@dataclass(frozen=True, slots=True)
class Detection:
    """A piece that was found.

    Attributes:
        model: name of its CAD model.
        pose: of the model's frame in the map.
        initial_pose: before verification.
        score: of the verification, in [0, 1].
    """

    model: str
    pose: Pose
    initial_pose: Pose
    score: float


@dataclass(frozen=True, slots=True)
class TrueObject:
    """A piece that is there.

    Attributes:
        name: unique.
        class_name: of the furniture ontology.
        model: name of its CAD model.
        pose: of the model's frame in the map.
        symmetry_order: turns that look alike; 0 if all do.
    """

    name: str
    class_name: str
    model: str
    pose: Pose
    symmetry_order: int = 1

    @property
    def tolerance_m(self) -> float:
        """How far a detection of it may be off."""
        return TOLERANCE_M.get(self.class_name, _OTHER_TOLERANCE_M)


@dataclass(slots=True)
class Row:
    """A row of Table 3.1: counts, and the errors of the true positives (metres, radians)."""

    true_positives: int = 0
    false_positives: int = 0
    false_negatives: int = 0
    initial_m: list[float] = field(default_factory=list[float])
    initial_rad: list[float] = field(default_factory=list[float])
    final_m: list[float] = field(default_factory=list[float])
    final_rad: list[float] = field(default_factory=list[float])

    @property
    def precision(self) -> float:
        """Share of the detections that are true; 1 if there are none."""
        found = self.true_positives + self.false_positives
        return self.true_positives / found if found else 1.0

    @property
    def recall(self) -> float:
        """Share of the objects that were found; 1 if there are none."""
        there = self.true_positives + self.false_negatives
        return self.true_positives / there if there else 1.0

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall; 1 for nothing found where nothing is."""
        wrong = self.false_positives + self.false_negatives
        total = 2 * self.true_positives + wrong
        return 2 * self.true_positives / total if total else 1.0

    def add(self, other: Row) -> None:
        """Takes in the counts and errors of another row."""
        self.true_positives += other.true_positives
        self.false_positives += other.false_positives
        self.false_negatives += other.false_negatives
        self.initial_m += other.initial_m
        self.initial_rad += other.initial_rad
        self.final_m += other.final_m
        self.final_rad += other.final_rad


def rate(
    detections: Sequence[Detection],
    present: Sequence[TrueObject],
    expected: Collection[str],
) -> dict[str, Row]:
    """One look, by CAD model.

    An object that need not be found is no true positive either if it is: its detection is ignored,
    and so is a second one of it.

    Args:
        detections: what was found.
        present: the objects of which anything is to be seen.
        expected: names of those that count as missed if they are not found.
    """
    pairs = sorted(
        (distance_m, i, k)
        for i, found in enumerate(detections)
        for k, true in enumerate(present)
        if found.model == true.model
        and (distance_m := _apart_m(found.pose, true.pose)) <= true.tolerance_m
    )
    rows: dict[str, Row] = {}
    used: set[int] = set()
    hit: set[int] = set()
    for distance_m, i, k in pairs:
        if i in used or k in hit:
            continue
        used.add(i)
        hit.add(k)
        found, true = detections[i], present[k]
        if true.name not in expected:
            continue
        row = rows.setdefault(true.model, Row())
        row.true_positives += 1
        row.final_m.append(distance_m)
        row.final_rad.append(_turned_rad(found.pose, true))
        row.initial_m.append(_apart_m(found.initial_pose, true.pose))
        row.initial_rad.append(_turned_rad(found.initial_pose, true))
    for i, found in enumerate(detections):
        if i not in used:
            rows.setdefault(found.model, Row()).false_positives += 1
    for k, true in enumerate(present):
        if k not in hit and true.name in expected:
            rows.setdefault(true.model, Row()).false_negatives += 1
    return rows


def totals(looks: Iterable[Mapping[str, Row]]) -> dict[str, Row]:
    """The rows of many looks, and their `total`."""
    rows: dict[str, Row] = {}
    everything = Row()
    for look in looks:
        for model, row in look.items():
            rows.setdefault(model, Row()).add(row)
            everything.add(row)
    return {**dict(sorted(rows.items())), "total": everything}


def table_lines(rows: Mapping[str, Row], names: Mapping[str, str]) -> list[str]:
    """Rows with the columns of Table 3.1, as Markdown.

    Args:
        rows: by model.
        names: what to call each model.
    """
    lines = [
        "| | true pos. | false pos. | false neg. | initial error | final error | precision | "
        "recall | F1 |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for model, row in rows.items():
        cells = (
            names.get(model, model),
            str(row.true_positives),
            str(row.false_positives),
            str(row.false_negatives),
            _error(row.initial_m, row.initial_rad),
            _error(row.final_m, row.final_rad),
            f"{100.0 * row.precision:.1f} %",
            f"{100.0 * row.recall:.1f} %",
            f"{100.0 * row.f1:.1f} %",
        )
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def area_under_curve(scores: Sequence[tuple[float, bool]]) -> float:
    """Area under the ROC curve of a score: the chance that a true one scores higher than a false.

    Args:
        scores: of hypotheses, each with whether it was true.

    Returns:
        0.5 is chance, 1 is perfect; NaN without true or without false ones.
    """
    true = np.array([score for score, is_true in scores if is_true])
    false = np.array([score for score, is_true in scores if not is_true])
    if true.size == 0 or false.size == 0:
        return math.nan
    higher = (true[:, None] > false[None, :]).mean()
    equal = (true[:, None] == false[None, :]).mean()
    return float(higher + 0.5 * equal)


def roc_curve(scores: Sequence[tuple[float, bool]]) -> FloatArray:
    """`(n, 3)`; threshold, share of the false that pass it, share of the true that do.

    Args:
        scores: of hypotheses, each with whether it was true.
    """
    true = np.array([score for score, is_true in scores if is_true])
    false = np.array([score for score, is_true in scores if not is_true])
    levels = np.unique([1.0, 0.0, *true.tolist(), *false.tolist()])[::-1]
    return np.array(
        [
            (
                level,
                (false >= level).mean() if false.size else 0.0,
                (true >= level).mean() if true.size else 0.0,
            )
            for level in levels.tolist()
        ]
    )


def _apart_m(a: Pose, b: Pose) -> float:
    return math.hypot(a.x - b.x, a.y - b.y)


def _turned_rad(pose: Pose, true: TrueObject) -> float:
    if true.symmetry_order == 0:
        return 0.0
    period = 2.0 * math.pi / true.symmetry_order
    return abs(math.remainder(pose.yaw_rad - true.pose.yaw_rad, period))


def _error(metres: Sequence[float], radians: Sequence[float]) -> str:
    if not metres:
        return ""
    return f"{100.0 * float(np.mean(metres)):.1f} cm, {math.degrees(float(np.mean(radians))):.1f}°"
