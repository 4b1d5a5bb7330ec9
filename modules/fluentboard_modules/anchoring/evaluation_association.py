"""Tables 4.4 to 4.6: is a new track this anchor? The SVM alone, and the whole association."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring import anchors as functionality
from fluentboard_modules.anchoring.anchors import Anchor
from fluentboard_modules.anchoring.association import assign_objects, gated_mismatch
from fluentboard_modules.anchoring.config import AssociationConfig, FilterConfig
from fluentboard_modules.anchoring.crf_data import IntArray
from fluentboard_modules.anchoring.evaluation_records import FrameRecord, SceneRecord, Seen
from fluentboard_modules.anchoring.similarity import (
    FEATURE_SETS,
    Appearance,
    MismatchModel,
    pair_features,
    train_mismatch,
)


@dataclass(frozen=True, slots=True)
class Counts:
    """A two by two table of "different object" and "same object".

    Attributes:
        table: `(2, 2)`; true relation by row, decision by column; 0 is different, 1 is same.
    """

    table: IntArray

    @property
    def accuracy(self) -> float:
        """Share of right decisions."""
        return float(np.trace(self.table) / max(self.table.sum(), 1))

    def precision(self, kind: int) -> float:
        """Of the decisions for that kind, the share that is right."""
        return float(self.table[kind, kind] / max(self.table[:, kind].sum(), 1))

    def recall(self, kind: int) -> float:
        """Of the cases of that kind, the share that is decided so."""
        return float(self.table[kind, kind] / max(self.table[kind].sum(), 1))

    def f1(self, kind: int) -> float:
        """Harmonic mean of precision and recall."""
        both = self.precision(kind) + self.recall(kind)
        return 2.0 * self.precision(kind) * self.recall(kind) / both if both else 0.0

    def average(self, measure: str) -> float:
        """Mean of `precision`, `recall` or `f1` over both kinds, weighted by their numbers."""
        weights = self.table.sum(axis=1)
        values = [getattr(self, measure)(kind) for kind in (0, 1)]
        return float(np.average(values, weights=weights)) if weights.sum() else float("nan")


@dataclass(frozen=True, slots=True)
class AssociationResult:
    """How one method associates.

    Attributes:
        counts: Table 4.5; Table 4.6 follows from it.
        right: share of the decisions that are right, strictly.
    """

    counts: Counts
    right: float


@dataclass(slots=True)
class _Memory:
    """Anchors of a run, with the true object each was made of."""

    config: FilterConfig
    anchors: dict[int, Anchor] = field(default_factory=dict)
    instance: dict[int, str] = field(default_factory=dict)
    issued: int = 0

    def follow(self, frame: FrameRecord) -> list[Seen]:
        """Tracks and loses anchors, and gives the objects whose track is new."""
        by_track = {a.track_id: key for key, a in self.anchors.items() if a.is_tracked}
        new: list[Seen] = []
        present = set()
        for one in frame.seen:
            track = one.detection.track_id
            if not one.instance or track is None:
                continue
            present.add(track)
            key = by_track.get(track)
            if key is None:
                new.append(one)
            else:
                self.anchors[key] = functionality.track(
                    self.anchors[key], one.detection, self.config
                )
        for key, anchor in self.anchors.items():
            if anchor.is_tracked and anchor.track_id not in present:
                self.anchors[key] = functionality.lose(anchor)
        return new

    def untracked(self) -> list[int]:
        return [key for key in sorted(self.anchors) if not self.anchors[key].is_tracked]

    def bind(self, one: Seen, key: int | None) -> None:
        """Reacquires an anchor, or makes a new one."""
        if key is not None:
            self.anchors[key] = functionality.reacquire(
                self.anchors[key], one.detection, self.config
            )
            return
        self.issued += 1
        self.anchors[self.issued] = functionality.discover(self.issued, one.detection, self.config)
        self.instance[self.issued] = one.instance


@dataclass(frozen=True, slots=True, eq=False)
class LabelledPairs:
    """Pairs of a new track and an untracked anchor under perfect association (Section 4.3.3.1).

    Attributes:
        objects: the new tracks.
        anchors: the anchors, as many.
        is_same: `(n,)`; whether they are one object.
        scene: `(n,)`; number of the scene.
    """

    objects: tuple[Appearance, ...]
    anchors: tuple[Appearance, ...]
    is_same: np.ndarray
    scene: np.ndarray

    def features(self, names: Sequence[str]) -> FloatArray:
        """`(n, f)`; features of Table 4.1."""
        rows = [
            pair_features([a], [b], names)[0, 0]
            for a, b in zip(self.objects, self.anchors, strict=True)
        ]
        return np.array(rows).reshape(len(self.objects), -1)


def labelled_pairs(
    scenes: Sequence[SceneRecord], config: FilterConfig | None = None
) -> LabelledPairs:
    """All pairs that occur when every new track is given to its true anchor."""
    objects: list[Appearance] = []
    partners: list[Appearance] = []
    same: list[bool] = []
    number: list[int] = []
    for scene in scenes:
        memory = _Memory(config or FilterConfig())
        for frame in scene.frames:
            new, untracked = memory.follow(frame), memory.untracked()
            # All pairs of the frame, before any of its tracks is bound.
            before = dict(memory.anchors)
            for one in new:
                true = None
                for key in untracked:
                    is_same = memory.instance[key] == one.instance
                    objects.append(_appearance(one))
                    anchor = before[key]
                    partners.append(Appearance(anchor.box, anchor.confidence))
                    same.append(is_same)
                    number.append(scene.number)
                    true = key if is_same else true
                # A second piece of the object in one frame finds its anchor taken.
                is_free = true is not None and not memory.anchors[true].is_tracked
                memory.bind(one, true if is_free else None)
    return LabelledPairs(tuple(objects), tuple(partners), np.array(same), np.array(number))


def evaluate_similarity(pairs: LabelledPairs) -> dict[str, Counts]:
    """Table 4.4: the SVM on every feature set, each scene judged by the others."""
    result: dict[str, Counts] = {}
    for letter, names in FEATURE_SETS.items():
        features = pairs.features(names)
        table = np.zeros((2, 2), dtype=np.int64)
        for train, test in _left_out(pairs.scene):
            model = train_mismatch(features[train], pairs.is_same[train], names)
            decided = model.rate(features[test]) < 0.0
            np.add.at(table, (pairs.is_same[test].astype(int), decided.astype(int)), 1)
        result[letter] = Counts(table)
    return result


def evaluate_association(
    scenes: Sequence[SceneRecord],
    pairs: LabelledPairs,
    methods: Sequence[str] = ("gnn", "thesis", "nn", "murty"),
    config: FilterConfig | None = None,
    model: MismatchModel | None = None,
) -> dict[str, AssociationResult]:
    """Tables 4.5 and 4.6 for several methods.

    A decision is made for every new track when untracked anchors exist. As in the thesis, the row
    says whether the anchor in question is the object: the one that the track was given to, or the
    nearest by mismatch where it was made a new one. The column says what was decided. Stricter, a
    decision is right if the track was given to its own anchor, or made a new one where it has
    none.

    Args:
        scenes: recorded runs.
        pairs: of the same runs.
        methods: of association.
        config: of anchors.
        model: trained on other runs; by default the SVM (a) of the pairs of all other scenes, as
            in the thesis.
    """
    names = FEATURE_SETS["a"]
    models: dict[int, MismatchModel] = {}
    if model is not None:
        models = {int(number): model for number in np.unique(pairs.scene)}
    else:
        features = pairs.features(names)
        for train, test in _left_out(pairs.scene):
            number = int(pairs.scene[test][0])
            models[number] = train_mismatch(features[train], pairs.is_same[train], names)
    result: dict[str, AssociationResult] = {}
    for method in methods:
        association = AssociationConfig(method=method)  # type: ignore[arg-type]
        table, right = np.zeros((2, 2), dtype=np.int64), 0
        for scene in scenes:
            if scene.number in models:
                own, own_right = decisions(scene, models[scene.number], association, config)
                table, right = table + own, right + own_right
        result[method] = AssociationResult(Counts(table), right / max(int(table.sum()), 1))
    return result


def decisions(
    scene: SceneRecord,
    model: MismatchModel,
    association: AssociationConfig,
    config: FilterConfig | None = None,
) -> tuple[IntArray, int]:
    """How a run's new tracks are associated: Table 4.5, and how many are strictly right."""
    memory = _Memory(config or FilterConfig())
    table, right = np.zeros((2, 2), dtype=np.int64), 0
    for frame in scene.frames:
        new = memory.follow(frame)
        candidates = memory.untracked()
        cost = gated_mismatch(
            [_appearance(one) for one in new],
            [Appearance(memory.anchors[k].box, memory.anchors[k].confidence) for k in candidates],
            model,
            association.gate_m,
        )
        matches = assign_objects(cost, association)
        known = {memory.instance[key] for key in candidates}
        for one, match in zip(new, matches, strict=True):
            if match.is_left_over or not match.is_decided:
                continue  # it comes again with the next frame
            key = None if match.anchor is None else candidates[match.anchor]
            if candidates:
                asked = match.anchor if match.anchor is not None else match.runner_up
                is_same = asked is not None and memory.instance[candidates[asked]] == one.instance
                table[int(is_same), int(key is not None)] += 1
                exists = one.instance in known
                right += is_same if key is not None else not exists
            memory.bind(one, key)
    return table, right


def _appearance(one: Seen) -> Appearance:
    cluster = one.detection.cluster
    return Appearance(
        cluster.box,
        one.detection.recognition.confidence,
        cluster.is_cut_off or cluster.is_occluded,
    )


def _left_out(scene: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    for number in np.unique(scene):
        yield scene != number, scene == number


def duplicates(scenes: Sequence[SceneRecord]) -> Mapping[str, int]:
    """What the whole pipeline made of the objects: anchors, duplicates, misses and inventions."""
    totals = {"objects": 0, "anchored": 0, "duplicates": 0, "missed": 0, "inventions": 0}
    for scene in scenes:
        last = {a.name for a in scene.frames[-1].anchors} if scene.frames else set()
        truth = {n: t for n, t in scene.truth_of_anchors().items() if n in last}
        found = [instance for instance, _ in truth.values() if instance]
        totals["objects"] += len(scene.objects)
        totals["anchored"] += len(set(found))
        totals["duplicates"] += len(found) - len(set(found))
        totals["missed"] += len(set(scene.objects) - set(found))
        totals["inventions"] += sum(not instance for instance, _ in truth.values())
    return totals
