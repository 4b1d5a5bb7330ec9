"""Track numbers from frame to frame."""

from __future__ import annotations

import numpy as np
import pytest

from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.anchoring.config import TrackingConfig
from fluentboard_modules.anchoring.observation import Cluster
from fluentboard_modules.anchoring.tracking import Tracker


def cluster(x: float, stamp_s: float) -> Cluster:
    box = BoundingBox(Pose(x, 0.0, 0.8), 0.1, 0.1, 0.1)
    return Cluster(np.zeros((0, 3)), np.zeros((0, 2), dtype=np.int64), box, stamp_s, np.zeros(3))


def tracks(tracker: Tracker, stamp_s: float, *places: float) -> list[int | None]:
    found = tracker.update([cluster(x, stamp_s) for x in places], stamp_s)
    return [one.track_id for one in found]


@pytest.mark.parametrize("interval_s", [0.03, 0.5, 2.0])
def test_a_track_goes_on_however_slow_the_frames_come(interval_s: float) -> None:
    tracker = Tracker(TrackingConfig())
    for k in range(4):
        assert tracks(tracker, 10.0 + k * interval_s, 0.0, 0.3) == [1, 2]


def test_after_a_long_pause_tracks_begin_anew() -> None:
    tracker = Tracker(TrackingConfig())
    assert tracks(tracker, 10.0, 0.0) == [1]
    assert tracks(tracker, 20.0, 0.0) == [2]


def test_a_track_outlives_a_missed_frame_but_not_many() -> None:
    tracker = Tracker(TrackingConfig())
    assert tracks(tracker, 10.0, 0.0, 0.5) == [1, 2]
    assert tracks(tracker, 10.2, 0.5) == [2]
    assert tracks(tracker, 10.4, 0.0, 0.5) == [1, 2]
    for k in range(10):
        tracks(tracker, 10.6 + 0.2 * k, 0.5)
    assert tracks(tracker, 12.6, 0.0, 0.5) == [3, 2]
