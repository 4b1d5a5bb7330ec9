"""From frames to anchors: all steps of Figure 4.3 in their order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fluentboard_modules.anchoring.config import AnchoringConfig
from fluentboard_modules.anchoring.observation import (
    ContextModel,
    Detection,
    FrameRecogniser,
    Recogniser,
    Recognition,
)
from fluentboard_modules.anchoring.organised import organise
from fluentboard_modules.anchoring.segmentation import Segmentation, segment
from fluentboard_modules.anchoring.similarity import MismatchModel
from fluentboard_modules.anchoring.supports import find_tops
from fluentboard_modules.anchoring.tables import TableMap
from fluentboard_modules.anchoring.tracking import Tracker
from fluentboard_modules.anchoring.world import Decision, World
from fluentboard_modules.frames.sensor_frame import SensorFrame


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """What one frame led to.

    Attributes:
        segmentation: tops and clusters of the frame; the clusters have their tracks.
        detections: the same clusters, recognised.
        decisions: what happened to the anchors.
    """

    segmentation: Segmentation
    detections: tuple[Detection, ...]
    decisions: tuple[Decision, ...]


class AnchoringPipeline:
    """Takes frames in time order and keeps the world model up to date.

    Args:
        recogniser: local object recognition.
        mismatch: rates pairs of object and anchor.
        config: of all steps.
        context: joint recognition; None leaves classes to local recognition.
        seed: of the random samples that support planes are found by.
    """

    def __init__(
        self,
        recogniser: Recogniser,
        mismatch: MismatchModel,
        config: AnchoringConfig | None = None,
        context: ContextModel | None = None,
        seed: int = 0,
    ) -> None:
        self._config = config or AnchoringConfig()
        self._recogniser = recogniser
        self._tracker = Tracker(self._config.tracking)
        self._rng = np.random.default_rng(seed)
        self.tables = TableMap(self._config.supports)
        self.world = World(recogniser.classes, mismatch, self._config.world, context)

    def observe(self, frame: SensorFrame) -> Segmentation:
        """Tops and tracked clusters of the next frame."""
        config = self._config
        points = organise(frame, config.segmentation.noise, config.supports.range_max_m)
        tops = self.tables.complete(find_tops(points, config.supports, self._rng))
        segmentation = segment(frame, points, tops, config.segmentation)
        tracked = self._tracker.update(segmentation.clusters, frame.stamp_s)
        return replace(segmentation, clusters=tuple(tracked))

    def update(self, frame: SensorFrame) -> Step:
        """Everything that the next frame leads to."""
        segmentation = self.observe(frame)
        detections = self.recognise(segmentation, frame)
        decisions = self.world.update(detections, frame)
        return Step(segmentation, tuple(detections), tuple(decisions))

    def recognise(self, segmentation: Segmentation, frame: SensorFrame) -> Sequence[Detection]:
        """The clusters of a frame with the confidence of each class."""
        recogniser, clusters = self._recogniser, segmentation.clusters
        if isinstance(recogniser, FrameRecogniser):
            confidences = recogniser.recognise_frame(clusters, frame)
        else:
            confidences = [recogniser.recognise(cluster) for cluster in clusters]
        return [
            Detection(cluster, Recognition(recogniser.classes, confidence))
            for cluster, confidence in zip(clusters, confidences, strict=True)
        ]
