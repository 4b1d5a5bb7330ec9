"""Recognition by an external detector: its boxes and confidences, matched with the clusters.

A detector, such as a neural network in a process of its own, says for a frame where it saw what.
Each cluster takes over the confidences of the detection whose box agrees best with its own, all of
a frame matched at once; a cluster that no detection fits is left to another recogniser.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from fluentboard.model.detection import ImageBox, ObjectDetection
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.config import DetectionsConfig
from fluentboard_modules.anchoring.observation import Cluster, Recogniser
from fluentboard_modules.anchoring.overlaps import shared_volume
from fluentboard_modules.frames.sensor_frame import SensorFrame

logger = logging.getLogger(__name__)

DetectionSource = Callable[[float, str], Sequence[ObjectDetection]]
"""What was detected in the frame of a stamp in seconds and a sensor; it may wait for an answer."""


class DetectionRecogniser:
    """Rates clusters as an external detector does.

    Args:
        detections: asked for the detections of each frame that has clusters.
        fallback: rates clusters that no detection fits.
        config: classes and overlaps.
    """

    def __init__(
        self,
        detections: DetectionSource,
        fallback: Recogniser,
        config: DetectionsConfig | None = None,
    ) -> None:
        self._detections = detections
        self._fallback = fallback
        self._config = config or DetectionsConfig()
        named = {*self._config.classes, *self._config.names.values()}
        self._classes = (*fallback.classes, *sorted(named - set(fallback.classes)))
        self._index = {name: k for k, name in enumerate(self._classes)}
        self._strange: set[str] = set()

    @property
    def classes(self) -> tuple[str, ...]:
        """Those of the fallback, and those that the settings name."""
        return self._classes

    def recognise(self, cluster: Cluster) -> FloatArray:
        """`(k,)`; confidence of each class without a detection."""
        confidence = np.zeros(len(self._classes))
        known = self._fallback.recognise(cluster)
        confidence[: len(known)] = known
        return confidence

    def recognise_frame(
        self, clusters: Sequence[Cluster], frame: SensorFrame
    ) -> Sequence[FloatArray]:
        """Per cluster `(k,)`; confidence of each class, with the detections of the frame."""
        if not clusters:
            return []
        detections = self._detections(frame.stamp_s, frame.sensor)
        chosen = match_detections(clusters, detections, frame, self._config)
        return [
            self.recognise(cluster) if match is None else self._confidence(detections[match])
            for cluster, match in zip(clusters, chosen, strict=True)
        ]

    def _confidence(self, detection: ObjectDetection) -> FloatArray:
        confidence = np.zeros(len(self._classes))
        for name, value in detection.confidences.items():
            k = self._index.get(self._config.names.get(name, name))
            if k is not None:
                # Several of the detector's classes may be one of ours.
                confidence[k] = min(1.0, confidence[k] + value)
            elif name not in self._strange:
                self._strange.add(name)
                logger.warning(
                    "the detector knows %r, which is no class here; name its class in the setting "
                    "recognition.detections.names, or add it to recognition.detections.classes",
                    name,
                )
        return confidence


def match_detections(
    clusters: Sequence[Cluster],
    detections: Sequence[ObjectDetection],
    frame: SensorFrame,
    config: DetectionsConfig,
) -> list[int | None]:
    """Per cluster the index of its detection; None where none overlaps enough.

    No detection is given twice; the sum of the overlaps is the largest that can be had.

    Args:
        clusters: of the frame.
        detections: of the same frame.
        frame: its cameras.
        config: least overlaps.
    """
    if not clusters or not detections:
        return [None] * len(clusters)
    boxes = {
        image: [_image_box(cluster, frame, image) for cluster in clusters]
        for image in {d.box.image for d in detections if isinstance(d.box, ImageBox)}
    }
    gain = np.zeros((len(clusters), len(detections)))
    for j, detection in enumerate(detections):
        for i, cluster in enumerate(clusters):
            if isinstance(detection.box, ImageBox):
                seen = boxes[detection.box.image][i]
                overlap = 0.0 if seen is None else seen.overlap(detection.box)
                least = config.image_overlap_min
            else:
                overlap = shared_volume(cluster.box, detection.box)
                least = config.box_overlap_min
            gain[i, j] = overlap if overlap >= least else 0.0
    chosen: list[int | None] = [None] * len(clusters)
    for i, j in zip(*linear_sum_assignment(-gain), strict=True):
        if gain[i, j] > 0.0:
            chosen[int(i)] = int(j)
    return chosen


def _image_box(cluster: Cluster, frame: SensorFrame, image: str) -> ImageBox | None:
    """The rectangle around a cluster in the depth or the colour image."""
    pixels = cluster.pixels[:, ::-1].astype(np.float64)
    if image == "colour" and (frame.colour_camera is not None or frame.T_colour_depth is not None):
        points = frame.T_map_sensor.inverse().apply(cluster.points_map)
        if frame.T_colour_depth is not None:
            points = frame.T_colour_depth.apply(points)
        ahead = points[:, 2] > 1e-3
        if not ahead.any():
            return None
        pixels = (frame.colour_camera or frame.camera).project(points[ahead])
    elif image == "colour" and frame.colour is not None:
        # Registered images may differ in size.
        height, width = frame.depth_m.shape
        scale = np.array([frame.colour.shape[1] / width, frame.colour.shape[0] / height])
        pixels = (pixels + 0.5) * scale - 0.5
    low, high = pixels.min(axis=0) - 0.5, pixels.max(axis=0) + 0.5
    return ImageBox(float(low[0]), float(low[1]), float(high[0]), float(high[1]), image)
