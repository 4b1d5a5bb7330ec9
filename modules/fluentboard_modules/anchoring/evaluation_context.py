"""Table 4.7: how much context, anchoring and local recognition each add to classification."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fluentboard_modules.anchoring.crf import Crf
from fluentboard_modules.anchoring.crf_data import IntArray, LabelledGraphs
from fluentboard_modules.anchoring.crf_training import TrainingConfig, train_crf
from fluentboard_modules.anchoring.evaluation_records import (
    GraphSet,
    SceneRecord,
    anchored_graphs,
    seen_graphs,
)
from fluentboard_modules.anchoring.map_inference import MapMethod, most_probable
from fluentboard_modules.anchoring.scene_graph import SceneGraphConfig

SMALL_CLASSES = ("Fork", "Knife", "Spoon")
"""The small objects of Section 4.3.4."""

_TRAINING_STEP = 4
"""Every so many graphs of a scene are trained on: those in between are nearly the same."""

TrackKey = tuple[int, int]
"""Number of the scene and identifier of the track."""


@dataclass(frozen=True, slots=True)
class ContextResult:
    """Classes of tracks under every variant of Table 4.7.

    Attributes:
        truth: true class by track.
        predicted: by variant, the class of each track.
        training_s: seconds per fold, of all training runs.
        graphs: by variant, the graphs that were classified, with the class of every node.
    """

    truth: Mapping[TrackKey, str]
    predicted: Mapping[str, Mapping[TrackKey, str]]
    training_s: Sequence[float]
    graphs: Mapping[str, tuple[LabelledGraphs, IntArray]]

    def accuracy(self, variant: str, classes: Sequence[str] | None = None) -> float:
        """Share of the tracks of these classes (default: all) that the variant gets right."""
        keys = [k for k, cls in self.truth.items() if classes is None or cls in classes]
        right = sum(self.predicted[variant].get(k) == self.truth[k] for k in keys)
        return right / len(keys) if keys else float("nan")

    def confusion(self, variant: str, classes: Sequence[str]) -> IntArray:
        """`(k, k)`; counts of tracks, true class by row, predicted class by column."""
        table = np.zeros((len(classes), len(classes)), dtype=np.int64)
        for key, true in self.truth.items():
            found = self.predicted[variant].get(key)
            if found in classes:
                table[list(classes).index(true), list(classes).index(found)] += 1
        return table


def evaluate_context(
    scenes: Sequence[SceneRecord],
    classes: Sequence[str],
    config: SceneGraphConfig | None = None,
    training: TrainingConfig | None = None,
    map_method: MapMethod = "exact",
    advance: Callable[[str], None] | None = None,
) -> ContextResult:
    """Classifies every track with models trained on all other scenes.

    The class of a track is the one reported most often while it was tracked (Section 4.3.4). Tracks
    that never became an anchor, and artefacts, do not count.

    Args:
        scenes: recorded runs.
        classes: of the recogniser.
        config: scene graphs.
        training: priors and limits; the form of local recognition is set per variant.
        map_method: exact, or ICM as in the thesis.
        advance: called after every trained model.
    """
    config = config if config is not None else SceneGraphConfig()
    training = training if training is not None else TrainingConfig()
    with_anchors = anchored_graphs(scenes, classes, config)
    alone = seen_graphs(scenes, classes, config)
    truth = _scored_tracks(scenes, classes)
    no_local = TrainingConfig(
        "none",
        training.node_l2,
        training.edge_l2,
        training.confidence_floor,
        training.iterations_max,
        training.gradient_tolerance,
    )
    predicted = {"Loc": _local_votes(scenes, classes, truth)}
    graphs: dict[str, tuple[LabelledGraphs, IntArray]] = {}
    seconds: list[float] = []
    for name, data, how in (
        ("CRF+A", with_anchors, no_local),
        ("CRF+Loc", alone, training),
        ("CRF+A+Loc", with_anchors, training),
    ):
        labels, spent = cross_validated(data.graphs, how, map_method, advance)
        seconds += spent
        predicted[name] = _node_votes(data, labels, classes, truth)
        graphs[name] = (data.graphs, labels)
    return ContextResult(truth, predicted, seconds, graphs)


def cross_validated(
    data: LabelledGraphs,
    training: TrainingConfig,
    map_method: MapMethod = "exact",
    advance: Callable[[str], None] | None = None,
    step: int = _TRAINING_STEP,
) -> tuple[IntArray, list[float]]:
    """`(nodes,)` classes with each fold left out of its own training, and seconds per training.

    Args:
        data: labelled graphs.
        training: how to train.
        map_method: how to infer.
        advance: called after every fold.
        step: every so many graphs of the other folds are trained on.
    """
    labels = np.zeros(len(data.y), dtype=np.int64)
    seconds: list[float] = []
    every = np.arange(len(data)) % step == 0
    for fold in np.unique(data.fold):
        begin = time.perf_counter()
        model = train_crf(data.only((data.fold != fold) & every), training).model
        seconds.append(time.perf_counter() - begin)
        for graph in np.flatnonzero(data.fold == fold):
            labels[data.nodes_of(int(graph))] = classify(model, data, int(graph), map_method)
        if advance is not None:
            advance(f"fold {fold}")
    return labels, seconds


def classify(model: Crf, data: LabelledGraphs, graph: int, method: MapMethod = "exact") -> IntArray:
    """`(n,)`; the most probable classes of the nodes of one graph."""
    nodes, edges = data.nodes_of(graph), data.edges_of(graph)
    potentials = model.potentials(
        data.x[nodes], data.confidence[nodes], data.edges[edges] - nodes.start, data.e[edges]
    )
    return most_probable(potentials, method).labels


def _scored_tracks(scenes: Sequence[SceneRecord], classes: Sequence[str]) -> dict[TrackKey, str]:
    found: dict[TrackKey, str] = {}
    for scene in scenes:
        anchored = {track for frame in scene.frames for track in frame.tracks.values()}
        for track, (_, cls) in scene.truth_of_tracks().items():
            if track in anchored and cls in classes:
                found[scene.number, track] = cls
    return found


def _local_votes(
    scenes: Sequence[SceneRecord], classes: Sequence[str], truth: Mapping[TrackKey, str]
) -> dict[TrackKey, str]:
    votes: dict[TrackKey, Counter[str]] = {}
    for scene in scenes:
        for frame in scene.frames:
            for one in frame.seen:
                track = one.detection.track_id
                key = (scene.number, -1 if track is None else track)
                if key in truth:
                    votes.setdefault(key, Counter())[one.detection.recognition.best] += 1
    return {key: counted.most_common(1)[0][0] for key, counted in votes.items()}


def _node_votes(
    data: GraphSet, labels: IntArray, classes: Sequence[str], truth: Mapping[TrackKey, str]
) -> dict[TrackKey, str]:
    votes: dict[TrackKey, Counter[str]] = {}
    for track, scene, label in zip(data.tracks, data.scene, labels, strict=True):
        key = (int(scene), int(track))
        if key in truth:
            votes.setdefault(key, Counter())[classes[label]] += 1
    return {key: counted.most_common(1)[0][0] for key, counted in votes.items()}
