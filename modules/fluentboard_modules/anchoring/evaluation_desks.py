"""The same CRF on real recordings: desks left out one by one, rooms in blocks, and sessions."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.crf_data import LabelledGraphs
from fluentboard_modules.anchoring.crf_training import TrainingConfig, train_crf
from fluentboard_modules.anchoring.datasets import LabelledScene, labelled_graphs
from fluentboard_modules.anchoring.evaluation_context import classify, cross_validated
from fluentboard_modules.anchoring.recogniser_sizes import SizeRecogniser
from fluentboard_modules.anchoring.scene_graph import SceneGraphConfig

PLACE_FEATURES = ("bias", "table_border_distance", "table_center_distance")
"""Of the unary features, those that local recognition by size knows nothing about."""


@dataclass(frozen=True, slots=True, eq=False)
class FoldResult:
    """Classification with each fold left out of the training.

    Attributes:
        graphs: what was classified.
        predicted: by variant, the class of every node.
        training_s: seconds per training.
    """

    graphs: LabelledGraphs
    predicted: dict[str, np.ndarray]
    training_s: list[float]

    def accuracy(self, variant: str) -> float:
        """Mean over the folds of the share of objects that the variant gets right."""
        return float(np.mean(self.fold_accuracies(variant)))

    def fold_accuracies(self, variant: str) -> list[float]:
        """Share of objects that the variant gets right, by fold."""
        fold = self.graphs.fold_of_node
        right = self.predicted[variant] == self.graphs.y
        return [float(right[fold == k].mean()) for k in np.unique(fold)]


def evaluate_folds(
    scenes: Sequence[LabelledScene],
    classes: Sequence[str],
    config: SceneGraphConfig,
    training: TrainingConfig | None = None,
) -> FoldResult:
    """Loc (by size), CRF and CRF+Loc with each place left out; nothing knows its true labels.

    Local recognition learns sizes on the other places. The confidences that the CRF is trained on
    come from recognisers that have seen neither the place left out nor the object's own, or the CRF
    would trust them blindly. With local recognition the size is not counted a second time.
    """
    training = training if training is not None else TrainingConfig(node_l2=1e-2, edge_l2=3e-2)
    graphs = labelled_graphs(scenes, classes, config)
    alone = TrainingConfig("none", training.node_l2, training.edge_l2)
    crf, seconds = cross_validated(graphs, alone, step=1)
    placed = SceneGraphConfig(
        config.context_range_m, config.neighbours_max, PLACE_FEATURES, config.edge_features
    )
    sizes = _Sizes(scenes, classes)
    with_local = labelled_graphs(scenes, classes, placed)
    local, both = np.zeros_like(graphs.y), np.zeros_like(graphs.y)
    for fold, place in enumerate(sorted({scene.place for scene in scenes})):
        data = with_local.with_confidence(sizes.confidences(place))
        own = data.fold_of_node == fold
        begin = time.perf_counter()
        model = train_crf(data.only(data.fold != fold), training).model
        seconds.append(time.perf_counter() - begin)
        local[own] = np.argmax(data.confidence[own], axis=1)
        for graph in np.flatnonzero(data.fold == fold):
            both[data.nodes_of(int(graph))] = classify(model, data, int(graph))
    return FoldResult(graphs, {"Loc": local, "CRF": crf, "CRF+Loc": both}, seconds)


class _Sizes:
    """Recognition by size that never knows the place it is asked about."""

    def __init__(self, scenes: Sequence[LabelledScene], classes: Sequence[str]) -> None:
        self._classes = classes
        self._known = [
            (scene.place, thing.box, label)
            for scene in scenes
            for thing, label in zip(scene.objects, scene.labels, strict=True)
            if label in classes
        ]

    def confidences(self, left_out: str) -> FloatArray:
        """`(nodes, classes)`; of recognisers that know neither the node's place nor this one."""
        recognisers = {
            place: self._trained_without({place, left_out})
            for place in {place for place, _, _ in self._known}
        }
        rows = [recognisers[place].rate(box) for place, box, _ in self._known]
        return np.array(rows).reshape(-1, len(self._classes))

    def _trained_without(self, places: set[str]) -> SizeRecogniser:
        kept = [one for one in self._known if one[0] not in places]
        return SizeRecogniser.of_boxes(
            [box for _, box, _ in kept], [label for _, _, label in kept], self._classes
        )


@dataclass(frozen=True, slots=True)
class SessionResult:
    """Objects of consecutive recordings of a desk, matched by class and distance.

    Attributes:
        pairs: same objects in consecutive recordings.
        found: of them, matched with each other.
        matched: all matches, right or wrong.
    """

    pairs: int
    found: int
    matched: int


def anchor_across_sessions(
    scenes: Sequence[LabelledScene], predicted: Sequence[Sequence[str]], reach_m: float = 0.45
) -> SessionResult:
    """Which object of a recording is which of the next one of the same desk?

    One optimal assignment by distance, with a penalty where the predicted classes differ; two
    objects with the same name on the same desk are the same.

    Args:
        scenes: in time order within every desk.
        predicted: class of every object of every scene, from `evaluate_folds` or elsewhere.
        reach_m: a match costs at most so much; the penalty for another class is half of it.
    """
    pairs = found = matched = 0
    for (before, was), (after, now) in zip(
        zip(scenes, predicted, strict=True),
        list(zip(scenes, predicted, strict=True))[1:],
        strict=False,
    ):
        if before.place != after.place:
            continue
        names = [o.name for o in before.objects], [o.name for o in after.objects]
        pairs += len(set(names[0]) & set(names[1]))
        centres = [
            np.array([[o.box.pose.x, o.box.pose.y] for o in scene.objects]).reshape(-1, 2)
            for scene in (before, after)
        ]
        cost = np.linalg.norm(centres[0][:, None] - centres[1], axis=2)
        cost = cost + 0.5 * reach_m * (np.array(was)[:, None] != np.array(now)[None])
        undecided = np.full((len(cost), len(cost)), reach_m)
        rows, columns = linear_sum_assignment(np.concatenate([cost, undecided], axis=1))
        for i, j in zip(rows, columns, strict=True):
            if j < len(names[1]):
                matched += 1
                found += names[0][i] == names[1][j]
    return SessionResult(pairs, found, matched)
