"""Settings of anchoring from a file and flags."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from fluentboard.errors import InvalidInput
from fluentboard_modules.anchoring.config import AnchoringConfig
from fluentboard_modules.anchoring.settings import for_short_recordings, read_settings
from fluentboard_modules.frames.live import LiveFrames
from fluentboard_modules.frames.sensor_frame import SensorFrame


def file_of(folder: Path, text: str) -> Path:
    path = folder / "anchoring.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_without_a_file_and_flags_all_is_as_by_default() -> None:
    assert read_settings(None, {"recognition.context": None}) == AnchoringConfig()


def test_a_file_overrides_the_defaults_and_flags_the_file(tmp_path: Path) -> None:
    path = file_of(tmp_path, "world:\n  association: {method: nn, gate_m: 0.3}\n")
    flags = {"world.association.method": "murty", "recognition.recogniser": "spin-images"}
    settings = read_settings(path, flags)
    assert settings.world.association.method == "murty"
    assert settings.world.association.gate_m == 0.3
    assert settings.recognition.recogniser == "spin-images"


def test_an_empty_file_changes_nothing(tmp_path: Path) -> None:
    assert read_settings(file_of(tmp_path, ""), {}) == AnchoringConfig()


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("world: {gate: 1.0}", "world.gate"),
        ("tracking: {reach_m: -1.0}", "tracking.reach_m"),
        ("world: {association: {method: best}}", "world.association.method"),
    ],
)
def test_a_wrong_setting_is_named(tmp_path: Path, text: str, named: str) -> None:
    with pytest.raises(InvalidInput, match=named):
        read_settings(file_of(tmp_path, text), {})


@pytest.mark.parametrize("text", ["- a\n- b\n", "world: [", "just words"])
def test_what_is_no_mapping_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(InvalidInput, match=r"anchoring\.yaml"):
        read_settings(file_of(tmp_path, text), {})


def test_a_flag_below_a_value_is_refused(tmp_path: Path) -> None:
    path = file_of(tmp_path, "world: 3\n")
    with pytest.raises(InvalidInput, match="world is 3"):
        read_settings(path, {"world.association.method": "gnn"})


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match=r"nowhere\.yaml"):
        read_settings(tmp_path / "nowhere.yaml", {})


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


def test_a_number_of_frames_that_the_settings_name_stays(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    named = read_settings(file_of(tmp_path, "world: {confirm_frames: 2}\n"), {})
    assert for_short_recordings(named, Stills(1)).world.confirm_frames == 2
    assert "asks for 2 before an object is anchored" in caplog.text


def test_live_frames_have_no_number_that_settings_could_be_fitted_to() -> None:
    live = LiveFrames("http://127.0.0.1:1", "head")
    assert for_short_recordings(AnchoringConfig(), live) == AnchoringConfig()
