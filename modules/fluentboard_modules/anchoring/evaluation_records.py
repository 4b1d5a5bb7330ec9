"""What a run past a labelled table leaves to be evaluated: detections, anchors and their truth."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.crf_data import GraphCollector, LabelledGraphs
from fluentboard_modules.anchoring.observation import Detection, SceneObject
from fluentboard_modules.anchoring.pipeline import AnchoringPipeline
from fluentboard_modules.anchoring.scene_graph import SceneGraphConfig, build_scene_graph
from fluentboard_modules.frames.sensor_frame import SensorFrame

_PURE = 0.6
"""A cluster is the object that has this share of its points; else it is an artefact."""


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """A detection with the true object it shows.

    Attributes:
        detection: its cluster is kept without points.
        instance: name of the true object; empty for an artefact.
        cls: its class; empty for an artefact.
    """

    detection: Detection
    instance: str
    cls: str


@dataclass(frozen=True, slots=True, eq=False)
class FrameRecord:
    """One frame: what was detected, and all anchors after it.

    Attributes:
        stamp_s: of the frame.
        seen: detections.
        anchors: all anchors as a context model sees them; tracked ones have their track in
            `tracks`.
        tracks: track identifier by the name of the anchor.
    """

    stamp_s: float
    seen: tuple[Seen, ...]
    anchors: tuple[SceneObject, ...]
    tracks: Mapping[str, int]


@dataclass(frozen=True, slots=True, eq=False)
class SceneRecord:
    """One scene.

    Attributes:
        number: of the scene.
        objects: class by name of everything that stands on the table.
        frames: in time order.
    """

    number: int
    objects: Mapping[str, str]
    frames: tuple[FrameRecord, ...]

    def truth_of_tracks(self) -> dict[int, tuple[str, str]]:
        """True object and class by track identifier; artefacts have empty names."""
        votes: dict[int, Counter[tuple[str, str]]] = {}
        for frame in self.frames:
            for one in frame.seen:
                track = one.detection.track_id
                if track is not None:
                    votes.setdefault(track, Counter())[one.instance, one.cls] += 1
        return {track: counted.most_common(1)[0][0] for track, counted in votes.items()}

    def truth_of_anchors(self) -> dict[str, tuple[str, str]]:
        """True object and class by the name of the anchor."""
        of_track = self.truth_of_tracks()
        votes: dict[str, Counter[tuple[str, str]]] = {}
        for frame in self.frames:
            for name, track in frame.tracks.items():
                votes.setdefault(name, Counter())[of_track.get(track, ("", ""))] += 1
        return {name: counted.most_common(1)[0][0] for name, counted in votes.items()}


def record_scene(
    number: int,
    frames: Iterable[SensorFrame],
    truth: Mapping[int, tuple[str, str]],
    pipeline: AnchoringPipeline,
) -> SceneRecord:
    """Runs anchoring over the frames of a scene and keeps what is needed to evaluate it.

    Args:
        number: of the scene.
        frames: with label images.
        truth: name and class of what stands on the table, by label; everything else is an artefact.
        pipeline: fresh.
    """
    records: list[FrameRecord] = []
    for frame in frames:
        step = pipeline.update(frame)
        seen = tuple(_with_truth(detection, frame, truth) for detection in step.detections)
        anchors = pipeline.world.anchors
        records.append(
            FrameRecord(
                frame.stamp_s,
                seen,
                tuple(anchor.scene_object() for anchor in anchors),
                {
                    str(a.identifier): a.track_id
                    for a in anchors
                    if a.is_tracked and a.track_id is not None
                },
            )
        )
    return SceneRecord(number, dict(truth.values()), tuple(records))


def _with_truth(
    detection: Detection, frame: SensorFrame, truth: Mapping[int, tuple[str, str]]
) -> Seen:
    cluster = detection.cluster
    assert frame.labels is not None
    values, counts = np.unique(frame.labels[tuple(cluster.pixels.T)], return_counts=True)
    best = int(np.argmax(counts))
    instance, cls = truth.get(int(values[best]), ("", ""))
    if counts[best] < _PURE * counts.sum():
        instance, cls = "", ""
    light = replace(
        cluster, points_map=cluster.points_map[:0], pixels=cluster.pixels[:0], colours=None
    )
    return Seen(replace(detection, cluster=light), instance, cls)


@dataclass(frozen=True, slots=True, eq=False)
class GraphSet:
    """Labelled scene graphs, and the track that each node shows.

    Attributes:
        graphs: one per frame.
        tracks: `(nodes,)`; track identifier; -1 for objects out of view.
        scene: `(nodes,)`; number of the scene.
    """

    graphs: LabelledGraphs
    tracks: np.ndarray
    scene: np.ndarray


def anchored_graphs(
    scenes: Sequence[SceneRecord], classes: Sequence[str], config: SceneGraphConfig
) -> GraphSet:
    """Scene graphs of everything anchored, in view or not: one per frame with an object in view."""
    return _graphs(scenes, classes, config, with_anchors=True)


def seen_graphs(
    scenes: Sequence[SceneRecord], classes: Sequence[str], config: SceneGraphConfig
) -> GraphSet:
    """Scene graphs of what each frame alone shows, without any memory."""
    return _graphs(scenes, classes, config, with_anchors=False)


def _graphs(
    scenes: Sequence[SceneRecord],
    classes: Sequence[str],
    config: SceneGraphConfig,
    *,
    with_anchors: bool,
) -> GraphSet:
    collector = GraphCollector(tuple(classes), config.node_features, config.edge_features)
    number = {name: k for k, name in enumerate(classes)}
    tracks: list[int] = []
    of_scene: list[int] = []
    for scene in scenes:
        of_anchor = scene.truth_of_anchors()
        of_track = scene.truth_of_tracks()
        for frame in scene.frames:
            # (object, true class, track) of what takes part; artefacts are left out, as in the
            # thesis, which removed them by hand.
            if with_anchors:
                parts = [
                    (
                        thing,
                        of_anchor.get(thing.name, ("", ""))[1],
                        frame.tracks.get(thing.name, -1),
                    )
                    for thing in frame.anchors
                ]
            else:
                parts = [
                    (_as_scene_object(one.detection), of_track[track][1], track)
                    for one in frame.seen
                    if (track := one.detection.track_id) is not None
                ]
            parts = [part for part in parts if part[1] in number]
            graph = build_scene_graph([part[0] for part in parts], config)
            if not len(graph.members):
                continue
            members = [parts[k] for k in graph.members]
            confidence = np.array([part[0].confidence for part in members])
            labels = [number[part[1]] for part in members]
            collector.add(graph.x, labels, confidence, graph.edges, graph.e, scene.number)
            tracks += [part[2] for part in members]
            of_scene += [scene.number] * len(members)
    return GraphSet(collector.graphs(), np.array(tracks), np.array(of_scene))


def _as_scene_object(detection: Detection) -> SceneObject:
    cluster = detection.cluster
    confidence: FloatArray = detection.recognition.confidence
    return SceneObject(str(cluster.track_id), cluster.box, confidence, cluster.support)
