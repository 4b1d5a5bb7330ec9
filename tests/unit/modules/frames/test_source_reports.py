"""What `frames info` says of a source, and what it finds wrong with one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fluentboard.model.geometry import Pose, Transform
from fluentboard_modules.frames.folders import open_folder
from fluentboard_modules.frames.pictures import draw_source
from fluentboard_modules.frames.recorder import Layout, record_source
from fluentboard_modules.frames.report import describe, examine
from fluentboard_modules.frames.sensor_frame import SensorFrame


def change(made: Any, **fields: Any) -> None:
    made.frames[:] = [replace(frame, **fields) for frame in made.frames]


def test_report_tells_the_numbers(made: Any) -> None:
    text = describe(examine(made))
    assert "frames       5" in text
    assert "16 x 12 px, f = 20.0, 21.0 px, c = 7.5, 5.5 px" in text
    assert "16 x 12 px, registered to depth" in text
    assert "from 1.000 s, 0.5 s long, 10.0 frames/s" in text
    assert "99 % of the pixels" in text
    assert "0.4 m long, within 0.40 x 0.00 x 0.00 m" in text
    assert "z of the world frame; the camera is 0 degrees off it" in text


def test_duration_is_right_when_few_frames_are_looked_at(made: Any, tmp_path: Path) -> None:
    record_source(made, tmp_path / "room")
    report = examine(open_folder(tmp_path / "room"), at_most=3)
    assert len(report.frames) == 3
    assert report.count == 5


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"T_map_sensor": Transform.identity()}, "all frames have the same pose"),
        ({"stamp_s": 4.0}, "the stamps do not ascend after frame 0"),
        ({"T_map_sensor": Transform.identity()}, "held sideways if z were up; give --gravity"),
        (
            {"depth_m": np.full((12, 16), 1500.0, dtype=np.float32)},
            "the median depth is 1.5e+03 m; is the unit of depth right",
        ),
        ({"depth_m": np.zeros((12, 16), dtype=np.float32)}, "only 0 % of the pixels have depth"),
    ],
)
def test_problems_are_found(fields: dict[str, Any], message: str, made: Any) -> None:
    change(made, **fields)
    assert any(message in problem for problem in examine(made).problems)


def test_jump_of_the_camera_is_found(made: Any) -> None:
    frame: SensorFrame = made.frames[3]
    far = Pose.from_rpy(2.0, 0.0, 0.0).to_transform() @ frame.T_map_sensor
    made.frames[3] = replace(frame, T_map_sensor=far)
    assert "the camera jumps before frame 3, faster than 3 m/s" in examine(made).problems


def test_missing_colour_is_counted(made: Any) -> None:
    made.frames[1] = replace(made.frames[1], colour=None)
    assert "1 of 5 frames have no colour" in examine(made).problems


def test_frames_that_cannot_be_read_are_problems(made: Any, tmp_path: Path) -> None:
    record_source(made, tmp_path / "room")
    (tmp_path / "room" / "frame-000001.depth.png").write_bytes(b"")
    problems = examine(open_folder(tmp_path / "room")).problems
    assert any("frame 1 skipped" in problem for problem in problems)


def test_empty_source_says_so(made: Any) -> None:
    made.frames.clear()
    assert "not one frame could be read" in describe(examine(made))


def test_picture_of_frames_without_depth_or_colour_is_drawn(made: Any, tmp_path: Path) -> None:
    change(made, depth_m=np.zeros((12, 16), dtype=np.float32), colour=None)
    assert len(draw_source(examine(made), tmp_path)) == 2


@pytest.mark.parametrize("layout", ["7-scenes", "tum", "open3d"])
def test_recording_with_gravity_is_copied_with_it(
    layout: Layout, made: Any, tmp_path: Path
) -> None:
    record_source(made, tmp_path / "room")
    tilted = replace(open_folder(tmp_path / "room"), gravity_world=np.array([0.0, 0.6, -0.8]))
    record_source(tilted, tmp_path / "copy", layout)
    gravity = open_folder(tmp_path / "copy").gravity_world
    assert gravity is not None
    assert np.allclose(gravity, [0.0, 0.6, -0.8])
