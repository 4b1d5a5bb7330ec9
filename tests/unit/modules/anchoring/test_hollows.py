"""Plates whose middle cannot be told from the top pixel by pixel."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fluentboard_modules.anchoring.config import AnchoringConfig, SegmentationConfig
from fluentboard_modules.anchoring.geometric import GeometricRecogniser
from fluentboard_modules.anchoring.pipeline import AnchoringPipeline
from fluentboard_modules.anchoring.similarity import load_mismatch
from fluentboard_modules.frames.sensor_frame import SensorFrame

TOP = (-0.6, 0.8, 0.68, 0.6, 1.8, 0.72)


def rim(x: float, y: float, radius: float) -> list[tuple[float, ...]]:
    """Four pieces of a rim of 2 cm around a middle of 4 mm; the gaps lie on the diagonals."""
    thick, short = 0.02, 0.55 * radius
    low, high = 0.72, 0.74
    return [
        (x, y, radius, low, low + 0.004),
        (x - short, y - radius, low, x + short, y - radius + thick, high),
        (x - short, y + radius - thick, low, x + short, y + radius, high),
        (x - radius, y - short, low, x - radius + thick, y + short, high),
        (x + radius - thick, y - short, low, x + radius, y + short, high),
    ]


def widths(frame: SensorFrame, config: SegmentationConfig) -> list[float]:
    pipeline = AnchoringPipeline(
        GeometricRecogniser(), load_mismatch(), AnchoringConfig(segmentation=config)
    )
    found = pipeline.observe(frame).clusters
    return sorted(max(c.box.x_size, c.box.y_size) for c in found)


def test_pieces_of_a_rim_are_one_plate(render: Callable[..., SensorFrame]) -> None:
    frame = render([TOP, *rim(0.0, 1.25, 0.12)], noise=np.random.default_rng(0))
    assert len(widths(frame, SegmentationConfig(hollow_m=0.0))) > 1
    assert widths(frame, SegmentationConfig()) == pytest.approx([0.24], abs=0.03)


def test_what_lies_around_a_bare_place_is_not_joined(render: Callable[..., SensorFrame]) -> None:
    frame = render([TOP, *rim(0.0, 1.25, 0.12)[1:]], noise=np.random.default_rng(0))
    alone = widths(frame, SegmentationConfig(hollow_m=0.0))
    assert widths(frame, SegmentationConfig()) == alone


def test_a_fork_beside_a_plate_stays_a_fork(render: Callable[..., SensorFrame]) -> None:
    fork = (-0.17, 1.16, 0.72, -0.15, 1.34, 0.738)
    frame = render([TOP, *rim(0.0, 1.25, 0.12), fork], noise=np.random.default_rng(1))
    assert widths(frame, SegmentationConfig()) == pytest.approx([0.18, 0.24], abs=0.03)
