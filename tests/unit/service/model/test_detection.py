"""Detections of external detectors as fluents, and back."""

from __future__ import annotations

import pytest

from fluentboard.errors import InvalidInput
from fluentboard.model.detection import (
    ImageBox,
    ObjectDetection,
    detection_fluents,
    read_detections,
)
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard.model.interval import Interval

MUG = ObjectDetection({"Mug": 0.8, "Dish": 0.1}, ImageBox(10.0, 20.0, 50.0, 70.0))
BOX = ObjectDetection(
    {"Box": 0.7}, BoundingBox(Pose.from_rpy(1.0, 2.0, 0.8, yaw=0.5), 0.3, 0.2, 0.1)
)


def test_detections_are_read_as_they_were_written() -> None:
    fluents = detection_fluents([MUG, BOX], 1690000000.25, "head")
    named = {fluent.name: fluent for fluent in fluents}
    told = [fluent for fluent in fluents if fluent.class_name == "ObjectDetection"]
    mug, box = read_detections(told, named, "head")
    assert mug == MUG
    assert box.confidences == {"Box": 0.7}
    assert isinstance(box.box, BoundingBox)
    assert box.box.pose.yaw_rad == pytest.approx(0.5)
    assert box.box.sizes == pytest.approx([0.3, 0.2, 0.1])


def test_all_fluents_of_a_detection_hold_while_the_frame_was_exposed() -> None:
    for fluent in detection_fluents([MUG, BOX], 100.0):
        assert fluent.start == Interval.at(100.0)
        assert fluent.finish.latest is not None
        assert 100.0 < fluent.finish.latest < 100.01


def test_detections_of_another_sensor_are_not_read() -> None:
    assert read_detections(detection_fluents([MUG], 100.0, "head"), {}, "wrist") == []


def test_a_detection_that_says_too_little_is_left_out(caplog: pytest.LogCaptureFixture) -> None:
    at = Interval.at(5.0)
    confidences = Property("hasConfidences", "xsd:string", '{"Mug": 0.8}')
    nowhere = Fluent("a", "ObjectDetection", at, at, (confidences,))
    garbled = Fluent(
        "b", "ObjectDetection", at, at, (Property("hasConfidences", "xsd:string", "Mug 0.8"),)
    )
    assert read_detections([nowhere, garbled], {}) == []
    assert "no box" in caplog.text
    assert "JSON" in caplog.text


@pytest.mark.parametrize(
    "sides", [(5.0, 0.0, 5.0, 9.0), (0.0, 9.0, 5.0, 1.0), (0.0, 0.0, 1e400, 1)]
)
def test_an_empty_or_endless_image_box_is_refused(sides: tuple[float, float, float, float]) -> None:
    with pytest.raises(InvalidInput):
        ImageBox(*sides)


@pytest.mark.parametrize("confidences", [{}, {"Mug": 1.2}, {"Mug": float("nan")}])
def test_what_is_no_confidence_is_refused(confidences: dict[str, float]) -> None:
    with pytest.raises(InvalidInput):
        ObjectDetection(confidences, ImageBox(0.0, 0.0, 1.0, 1.0))


def test_overlap_is_the_common_area_over_the_whole() -> None:
    first, second = ImageBox(0.0, 0.0, 2.0, 2.0), ImageBox(1.0, 0.0, 3.0, 2.0)
    assert first.overlap(second) == pytest.approx(1.0 / 3.0)
    assert first.overlap(ImageBox(2.0, 0.0, 3.0, 2.0)) == 0.0
