"""Recognition by what an external detector says about the frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from fluentboard.errors import InvalidInput
from fluentboard.model.detection import ImageBox, ObjectDetection
from fluentboard.model.geometry import BoundingBox, FloatArray, Pose, Transform
from fluentboard_modules.anchoring.config import (
    AnchoringConfig,
    DetectionsConfig,
    RecognitionConfig,
)
from fluentboard_modules.anchoring.observation import Cluster
from fluentboard_modules.anchoring.overlaps import shared_volume
from fluentboard_modules.anchoring.pipeline import AnchoringPipeline
from fluentboard_modules.anchoring.recogniser_detections import DetectionRecogniser
from fluentboard_modules.anchoring.recognisers import recogniser_of
from fluentboard_modules.anchoring.similarity import load_mismatch
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame

TOP = (-0.6, 0.8, 0.68, 0.6, 1.8, 0.72)
LEFT, RIGHT = (-0.2, 1.25, 0.04, 0.72, 0.82), (0.2, 1.25, 0.04, 0.72, 0.82)


class Unsure:
    """A fallback that knows two classes and tells neither."""

    classes = ("Dish", "Mug")

    def recognise(self, cluster: Cluster) -> FloatArray:
        return np.array([0.5, 0.5])


def detector(*detections: ObjectDetection) -> Callable[[float, str], Sequence[ObjectDetection]]:
    return lambda stamp_s, sensor: detections


def recognised(
    frame: SensorFrame, config: DetectionsConfig, *detections: ObjectDetection
) -> dict[str, FloatArray]:
    """Confidences of the left and the right can."""
    recogniser = DetectionRecogniser(detector(*detections), Unsure(), config)
    pipeline = AnchoringPipeline(recogniser, load_mismatch(), AnchoringConfig())
    found = pipeline.recognise(pipeline.observe(frame), frame)
    return {
        "left" if d.cluster.box.pose.x < 0.0 else "right": d.recognition.confidence for d in found
    }


@pytest.fixture
def frame(render: Callable[..., SensorFrame]) -> SensorFrame:
    return render([TOP, LEFT, RIGHT])


def seen_at(frame: SensorFrame, label: int, by_px: float = 0.0, image: str = "depth") -> ImageBox:
    assert frame.labels is not None
    rows, columns = np.nonzero(frame.labels == label)
    low_x, high_x = float(columns.min()) + by_px, float(columns.max()) + by_px
    return ImageBox(low_x, float(rows.min()), high_x, float(rows.max()), image)


def test_a_cluster_takes_the_confidences_of_the_detection_around_it(frame: SensorFrame) -> None:
    mug = ObjectDetection({"Mug": 0.9, "Dish": 0.05}, seen_at(frame, 2, 3.0))
    told = recognised(frame, DetectionsConfig(), mug)
    assert told["left"] == pytest.approx([0.05, 0.9])
    assert told["right"] == pytest.approx([0.5, 0.5])


def test_a_detection_in_the_map_is_matched_by_volume(frame: SensorFrame) -> None:
    pipeline = AnchoringPipeline(Unsure(), load_mismatch())
    boxes = {c.box.pose.x > 0.0: c.box for c in pipeline.observe(frame).clusters}
    dish = ObjectDetection({"Dish": 0.8}, boxes[True])
    told = recognised(frame, DetectionsConfig(), dish)
    assert told["right"] == pytest.approx([0.8, 0.0])
    assert told["left"] == pytest.approx([0.5, 0.5])


def test_the_colour_camera_may_be_another_one(frame: SensorFrame) -> None:
    shifted = Transform(np.array([[1, 0, 0, 0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]))
    camera = Camera(640, 480, 500.0, 500.0, 320.0, 240.0)
    both = SensorFrame(
        frame.depth_m,
        frame.camera,
        frame.stamp_s,
        frame.T_map_sensor,
        colour=np.zeros((480, 640, 3), dtype=np.uint8),
        colour_camera=camera,
        T_colour_depth=shifted,
        labels=frame.labels,
    )
    assert frame.labels is not None
    rows, columns = np.nonzero(frame.labels == 3)
    rays = frame.camera.rays()[rows, columns] * frame.depth_m[rows, columns, None]
    places = camera.project(shifted.apply(rays))
    left, top = places.min(axis=0).tolist()
    right, bottom = places.max(axis=0).tolist()
    mug = ObjectDetection({"Mug": 1.0}, ImageBox(left, top, right, bottom, "colour"))
    told = recognised(both, DetectionsConfig(image_overlap_min=0.8), mug)
    assert told["right"] == pytest.approx([0.0, 1.0])
    assert told["left"] == pytest.approx([0.5, 0.5])


def test_no_detection_is_given_twice(frame: SensorFrame) -> None:
    whole = seen_at(frame, 2)
    right = seen_at(frame, 3)
    wide = ImageBox(whole.left, whole.top, right.right, whole.bottom, "depth")
    told = recognised(
        frame, DetectionsConfig(image_overlap_min=0.05), ObjectDetection({"Mug": 1.0}, wide)
    )
    assert sorted(float(c[1]) for c in told.values()) == [0.5, 1.0]


def test_names_of_the_detector_are_translated(
    frame: SensorFrame, caplog: pytest.LogCaptureFixture
) -> None:
    config = DetectionsConfig(names={"cup": "Mug", "wine glass": "Glass", "beaker": "Mug"})
    seen = ObjectDetection(
        {"cup": 0.5, "beaker": 0.3, "wine glass": 0.1, "cat": 0.1}, seen_at(frame, 2)
    )
    told = recognised(frame, config, seen)
    assert told["left"] == pytest.approx([0.0, 0.8, 0.1])  # Dish, Mug, Glass
    assert told["right"] == pytest.approx([0.5, 0.5, 0.0])
    assert "'cat'" in caplog.text


def test_detections_need_a_board() -> None:
    with pytest.raises(InvalidInput, match="board"):
        recogniser_of(RecognitionConfig(recogniser="detections"))


def test_the_fallback_cannot_be_the_detections_again() -> None:
    config = RecognitionConfig(
        recogniser="detections", detections=DetectionsConfig(fallback="detections")
    )
    with pytest.raises(InvalidInput, match="fallback"):
        recogniser_of(config, detector())


def test_shared_volume_of_two_boxes() -> None:
    first = BoundingBox(Pose(0.0, 0.0, 0.5), 1.0, 1.0, 1.0)
    assert shared_volume(first, first) == pytest.approx(1.0)
    half = BoundingBox(Pose(0.5, 0.0, 0.5), 1.0, 1.0, 1.0)
    assert shared_volume(first, half) == pytest.approx(1.0 / 3.0)
    above = BoundingBox(Pose(0.0, 0.0, 1.6), 1.0, 1.0, 1.0)
    assert shared_volume(first, above) == 0.0
