"""The map frame on the board: written once, and again only when it changes."""

from __future__ import annotations

import numpy as np
import pytest

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import Transform
from fluentboard.model.interval import UNKNOWN
from fluentboard_modules.geometry_fluents import pose_of
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.map_frame import map_frame_fluents, place

T = Transform.from_parts(np.eye(3), np.array([0.0, 0.0, 1.5]))


class UprightSource:
    """Frames that are in the map frame already."""

    name = "robot"

    def __len__(self) -> int:
        return 0

    def __iter__(self):  # type: ignore[no-untyped-def]
        return iter(())


def test_map_frame_holds_since_ever_and_names_its_recording() -> None:
    pose, frame = map_frame_fluents("/data/red kitchen", T, {}, {})
    assert (frame.name, frame.class_name) == ("mapFrame_red_kitchen", "MapFrame")
    assert (frame.start, frame.finish) == (UNKNOWN, UNKNOWN)
    assert frame.values("hasRecording") == ("/data/red kitchen",)
    assert np.allclose(pose_of(pose).to_transform().matrix, T.matrix)


def test_map_frame_that_the_board_knows_is_not_written_again() -> None:
    pose, frame = map_frame_fluents("kitchen", T, {}, {})
    assert map_frame_fluents("kitchen", T, {frame.name: frame}, {pose.name: pose}) == []


def test_other_map_frame_of_the_same_recording_gets_another_pose() -> None:
    pose, frame = map_frame_fluents("kitchen", T, {}, {})
    higher = Transform.from_parts(np.eye(3), np.array([0.0, 0.0, 1.6]))
    changed = map_frame_fluents("kitchen", higher, {frame.name: frame}, {pose.name: pose})
    assert changed[0].name == "poseMapFrame_kitchen_1"


def test_source_in_the_map_frame_stays_as_it_is() -> None:
    source = UprightSource()
    assert place(source, MappingConfig())[0] is source
    with pytest.raises(InvalidInput, match="robot has z up already"):
        place(source, MappingConfig(), np.array([0.0, 0.0, -1.0]))
