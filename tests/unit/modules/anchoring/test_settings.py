"""Settings of anchoring, fitted to the recording."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from fluentboard_modules.anchoring.config import AnchoringConfig
from fluentboard_modules.anchoring.settings import for_short_recordings
from fluentboard_modules.frames.live import LiveFrames
from fluentboard_modules.frames.sensor_frame import SensorFrame


class Stills:
    """A recording of so many frames, which nobody looks at."""

    name = "stills"

    def __init__(self, frames: int) -> None:
        self._frames = frames

    def __len__(self) -> int:
        return self._frames

    def __iter__(self) -> Iterator[SensorFrame]:
        return iter(())


@pytest.mark.parametrize(("frames", "needed"), [(0, 3), (1, 1), (2, 2), (3, 3), (200, 3)])
def test_an_object_needs_no_more_frames_than_the_recording_has(frames: int, needed: int) -> None:
    settings = for_short_recordings(AnchoringConfig(), Stills(frames))
    assert settings.world.confirm_frames == needed


def test_a_number_of_frames_that_the_settings_name_stays(caplog: pytest.LogCaptureFixture) -> None:
    named = AnchoringConfig.model_validate({"world": {"confirm_frames": 2}})
    assert for_short_recordings(named, Stills(1)).world.confirm_frames == 2
    assert "asks for 2 before an object is anchored" in caplog.text


def test_live_frames_have_no_number_that_settings_could_be_fitted_to() -> None:
    live = LiveFrames("http://127.0.0.1:1", "head")
    assert for_short_recordings(AnchoringConfig(), live) == AnchoringConfig()
