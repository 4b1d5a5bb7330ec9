"""The contract between segmentation, recognition and context."""

from __future__ import annotations

import numpy as np
import pytest

from fluentboard.errors import InvalidInput
from fluentboard_modules.anchoring.observation import Recognition, SupportPlane


def test_the_best_class_is_the_most_confident_one() -> None:
    recognition = Recognition(("Fork", "Mug", "Plate"), np.array([0.1, 0.7, 0.2]))
    assert recognition.best == "Mug"


def test_a_recognition_without_classes_has_no_best_one() -> None:
    assert Recognition((), np.zeros(0)).best == ""


@pytest.mark.parametrize("confidence", [[0.5], [0.5, 1.5], [0.5, float("nan")], [-0.1, 0.0]])
def test_numbers_that_are_no_confidences_are_refused(confidence: list[float]) -> None:
    with pytest.raises(InvalidInput):
        Recognition(("Fork", "Mug"), np.array(confidence))


def test_a_tilted_top_is_higher_on_one_side() -> None:
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    top = SupportPlane(0.7, corners, np.zeros(2), slope=(0.02, 0.0))
    heights = top.height_at(np.array([[1.0, 0.0, 0.9], [-1.0, 0.5, 0.9]]))
    assert heights == pytest.approx([0.72, 0.68])
