"""Detections that an external detector posts to the board, read frame by frame."""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence

from fluentboard.model.detection import DETECTION_CLASS, ObjectDetection, read_detections
from fluentboard.model.fluent import Fluent
from fluentboard_client import Client
from fluentboard_modules.anchoring.config import DetectionsConfig

logger = logging.getLogger(__name__)

_MISSES_MAX = 10  # frames in a row without a detection, after which no frame waits for any
_DETECTION_POLL_S = 0.02


class PostedDetections:
    """What an external detector has posted for a frame; the frame waits for it a while.

    Args:
        config: tolerance and time to wait.

    Attributes:
        board: where it is posted; None before the worker has begun.
    """

    def __init__(self, config: DetectionsConfig) -> None:
        self._config = config
        self._missed = 0
        self.board: Client | None = None

    def __call__(self, stamp_s: float, sensor: str) -> Sequence[ObjectDetection]:
        """The detections of a frame, empty if none came in time."""
        if self.board is None:
            return []
        # A detector that is away, or sees nothing for long, does not hold up every frame.
        patience_s = self._config.wait_s if self._missed < _MISSES_MAX else 0.0
        until_s = time.monotonic() + patience_s
        while not (found := self._posted(self.board, stamp_s, sensor)):
            if time.monotonic() >= until_s:
                break
            time.sleep(_DETECTION_POLL_S)
        self._missed = 0 if found else self._missed + 1
        if self._missed == _MISSES_MAX:
            logger.warning(
                "no detections for %d frames, the last at %.3f s of sensor %r: is the detector "
                "running, and does it post the stamps of the frames?",
                _MISSES_MAX,
                stamp_s,
                sensor,
            )
        return found

    def _posted(self, board: Client, stamp_s: float, sensor: str) -> list[ObjectDetection]:
        window = (stamp_s - self._config.tolerance_s, stamp_s + self._config.tolerance_s + 1e-6)
        fluents = list(board.fluents(DETECTION_CLASS, during=window))
        geometry: dict[str, Fluent] = {}
        if any(fluent.values("hasBoundingBox") for fluent in fluents):
            geometry = {
                fluent.name: fluent
                for class_name in ("Pose", "BBox")
                for fluent in board.fluents(class_name, during=window, is_open=False)
            }
        return read_detections(fluents, geometry, sensor)
