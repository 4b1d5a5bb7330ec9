"""Recordings in folders: every layout is read back as written, damage is named."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fluentboard.errors import InvalidFrame, InvalidInput
from fluentboard.model.geometry import Pose
from fluentboard_modules.frames.folder_writers import write_redwood, write_tum
from fluentboard_modules.frames.folders import open_folder
from fluentboard_modules.simulation.recording import record

WRITERS: dict[str, Callable[..., int]] = {
    "7-Scenes": partial(record, colour="png"),
    "TUM RGB-D": write_tum,
    "Open3D/Redwood": write_redwood,
}


@pytest.mark.parametrize("layout", WRITERS)
def test_layout_reads_back_as_written(layout: str, made: Any, tmp_path: Path) -> None:
    assert WRITERS[layout](made, tmp_path / "room") == 5
    recording = open_folder(tmp_path / "room")
    assert recording.layout == layout
    assert len(recording) == 5
    assert made.agrees_with(list(recording))
    assert recording.colour_camera is None


@pytest.mark.parametrize("layout", WRITERS)
def test_first_stamp_can_be_chosen(layout: str, made: Any, tmp_path: Path) -> None:
    WRITERS[layout](made, tmp_path / "room")
    stamps_s = [frame.stamp_s for frame in open_folder(tmp_path / "room", start_s=100.0)]
    assert np.allclose(stamps_s, 100.0 + 0.1 * np.arange(5), atol=1e-5)


@pytest.mark.parametrize("layout", WRITERS)
def test_truncated_depth_image_is_skipped_with_a_warning(
    layout: str, made: Any, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    WRITERS[layout](made, tmp_path / "room")
    recording = open_folder(tmp_path / "room")
    damaged = recording.files[2].depth
    damaged.write_bytes(damaged.read_bytes()[:-30])
    with caplog.at_level(logging.WARNING):
        assert [frame.index for frame in recording] == [0, 1, 3, 4]
    assert "frame 2 skipped" in caplog.text
    assert str(damaged) in caplog.text


@pytest.mark.parametrize("layout", WRITERS)
def test_missing_depth_image_is_skipped_with_a_warning(
    layout: str, made: Any, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    WRITERS[layout](made, tmp_path / "room")
    recording = open_folder(tmp_path / "room")
    recording.files[0].depth.unlink()
    with caplog.at_level(logging.WARNING):
        assert len(list(recording)) == 4
    assert "cannot be read (No such file or directory)" in caplog.text


def test_recorded_labels_are_read(made: Any, tmp_path: Path) -> None:
    labels = np.arange(192, dtype=np.int32).reshape(12, 16)
    made.frames[:] = [replace(frame, labels=labels) for frame in made.frames]
    record(made, tmp_path / "room")
    frame = open_folder(tmp_path / "room").read(0)
    assert np.array_equal(np.asarray(frame.labels), labels)


def test_original_seven_scenes_have_their_published_cameras(made: Any, tmp_path: Path) -> None:
    record(made, tmp_path / "room")
    for name in ("recording.json", "stamps.txt", "camera-intrinsics.txt"):
        (tmp_path / "room" / name).unlink()
    recording = open_folder(tmp_path / "room")
    assert recording.camera.fx == 585.0
    assert recording.colour_camera is not None
    assert recording.files[3].stamp_s == pytest.approx(1.0 + 3 / 30)


def test_lost_tracking_skips_the_frame(
    made: Any, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    record(made, tmp_path / "room")
    (tmp_path / "room" / "frame-000001.pose.txt").write_text("-1.#IND " * 16)
    with caplog.at_level(logging.WARNING):
        assert [frame.index for frame in open_folder(tmp_path / "room")] == [0, 2, 3, 4]
    assert "frame-000001.pose.txt" in caplog.text


def test_stamps_must_be_as_many_as_depth_images(made: Any, tmp_path: Path) -> None:
    record(made, tmp_path / "room")
    (tmp_path / "room" / "stamps.txt").write_text("1.0\n2.0\n")
    with pytest.raises(InvalidFrame, match="2 stamps, perhaps unordered, for 5 depth images"):
        open_folder(tmp_path / "room")


def test_tum_images_are_associated_by_stamp(made: Any, tmp_path: Path) -> None:
    write_tum(made, tmp_path / "room")
    rows = (tmp_path / "room" / "rgb.txt").read_text().splitlines()
    delayed = [f"{float(r.split()[0]) + 0.019:.6f} {r.split()[1]}" for r in rows[1:4]]
    late = f"{float(rows[4].split()[0]) + 0.025:.6f} {rows[4].split()[1]}"
    (tmp_path / "room" / "rgb.txt").write_text("\n".join([*reversed(delayed), late]))
    frames = list(open_folder(tmp_path / "room"))
    assert [frame.colour is not None for frame in frames] == [True, True, True, False, False]
    assert np.array_equal(np.asarray(frames[1].colour), np.asarray(made.frames[1].colour))


def test_tum_frame_without_a_pose_near_it_is_skipped(
    made: Any, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_tum(made, tmp_path / "room")
    path = tmp_path / "room" / "groundtruth.txt"
    path.write_text("\n".join(path.read_text().splitlines()[:-1]))
    with caplog.at_level(logging.WARNING):
        assert len(list(open_folder(tmp_path / "room"))) == 4
    assert "no pose within 0.02 s of 1.4 s" in caplog.text


def test_tum_line_without_a_stamp_is_named(made: Any, tmp_path: Path) -> None:
    write_tum(made, tmp_path / "room")
    (tmp_path / "room" / "depth.txt").write_text("# comment\nsoon depth/1.png\n")
    with pytest.raises(InvalidFrame, match=r"depth\.txt, line 2: starts with no stamp"):
        open_folder(tmp_path / "room")


def test_redwood_poses_may_count_from_one(made: Any, tmp_path: Path) -> None:
    write_redwood(made, tmp_path / "room")
    path = tmp_path / "room" / "trajectory.log"
    lines = path.read_text().splitlines()
    lines[::5] = [f"{n} {n} {n + 1}" for n in range(1, 6)]
    path.write_text("\n".join(lines))
    assert made.agrees_with(list(open_folder(tmp_path / "room")))


def test_redwood_camera_gives_the_unit_of_depth(made: Any, tmp_path: Path) -> None:
    write_redwood(made, tmp_path / "room")
    path = tmp_path / "room" / "camera.json"
    path.rename(path.with_name("intrinsic.json"))
    text = path.with_name("intrinsic.json").read_text().replace("1000.0", "500.0")
    path.with_name("intrinsic.json").write_text(text)
    frame = open_folder(tmp_path / "room").read(0)
    assert np.allclose(frame.depth_m, 2.0 * made.frames[0].depth_m, atol=1e-3)


def test_redwood_truncated_trajectory_is_named(made: Any, tmp_path: Path) -> None:
    write_redwood(made, tmp_path / "room")
    path = tmp_path / "room" / "trajectory.log"
    path.write_text("\n".join(path.read_text().splitlines()[:-2]))
    with pytest.raises(InvalidFrame, match="the pose in line 21 has no 4x4 matrix"):
        open_folder(tmp_path / "room")


def test_redwood_without_poses_says_what_to_do(made: Any, tmp_path: Path) -> None:
    write_redwood(made, tmp_path / "room")
    (tmp_path / "room" / "trajectory.log").unlink()
    with pytest.raises(InvalidFrame, match=r"trajectory\.log: no such file; a recording needs"):
        open_folder(tmp_path / "room")


def test_redwood_images_are_ordered_by_number(made: Any, tmp_path: Path) -> None:
    write_redwood(made, tmp_path / "room")
    for folder in ("depth", "color"):
        for position, path in enumerate(sorted((tmp_path / "room" / folder).iterdir())):
            path.rename(path.with_name(f"{position + 8}.png"))
    recording = open_folder(tmp_path / "room")
    assert [files.depth.name for files in recording.files][:3] == ["8.png", "9.png", "10.png"]
    assert recording.files[2].colour is not None
    assert recording.files[2].colour.name == "10.png"


def test_redwood_colour_that_belongs_to_no_depth_image_is_an_error(
    made: Any, tmp_path: Path
) -> None:
    write_redwood(made, tmp_path / "room")
    for position, path in enumerate(sorted((tmp_path / "room" / "color").iterdir())):
        path.rename(path.with_name(f"picture{position}.png"))
    (tmp_path / "room" / "color" / "picture0.png").unlink()
    with pytest.raises(InvalidFrame, match="5 depth and 4 colour images with different names"):
        open_folder(tmp_path / "room")


def test_folder_of_something_else_lists_the_layouts(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("nothing")
    with pytest.raises(InvalidFrame, match="not a recording; expected 7-Scenes: frame-NNN") as e:
        open_folder(tmp_path)
    assert "TUM RGB-D" in e.value.message
    assert "Open3D/Redwood" in e.value.message


def test_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidFrame, match="nowhere: no such folder"):
        open_folder(tmp_path / "nowhere")


def test_frames_are_placed_in_the_map(made: Any, tmp_path: Path) -> None:
    record(made, tmp_path / "room")
    T_map_world = Pose.from_rpy(1.0, 2.0, 3.0, yaw=0.5).to_transform()
    frame = open_folder(tmp_path / "room").in_map(T_map_world).every(2).read(1)
    expected = T_map_world @ made.frames[2].T_map_sensor
    assert np.allclose(frame.T_map_sensor.matrix, expected.matrix)


def test_writer_leaves_a_folder_with_something_in_it_alone(made: Any, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("precious")
    with pytest.raises(InvalidInput, match="is not empty"):
        write_tum(made, tmp_path)
    with pytest.raises(InvalidInput, match="is not empty"):
        write_redwood(made, tmp_path)
