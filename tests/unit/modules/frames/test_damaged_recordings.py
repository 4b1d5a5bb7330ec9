"""Recordings on disk whose files are damaged: the rest is still read, and the log says why."""

from __future__ import annotations

import logging
from pathlib import Path

import cv2
import numpy as np
import pytest

from fluentboard.errors import InvalidFrame
from fluentboard_modules.frames.folders import FIRST_STAMP_S, open_folder

POSE = "1 0 0 0.5\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
INTRINSICS = "20 0 4\n0 20 3\n0 0 1\n"


def write_image(path: Path, image: object) -> None:
    assert cv2.imwrite(str(path), np.asarray(image))


def write_seven_scenes(folder: Path, numbers: tuple[int, ...] = (0, 5, 10)) -> Path:
    (folder / "camera-intrinsics.txt").write_text(INTRINSICS)
    (folder / "gravity-direction.txt").write_text("0 1 0")
    for number in numbers:
        stem = folder / f"frame-{number:06d}"
        depth = np.full((6, 8), 1500, np.uint16)
        depth[0, 0], depth[0, 1] = 0, 65535
        write_image(Path(f"{stem}.depth.png"), depth)
        write_image(Path(f"{stem}.color.jpg"), np.full((6, 8, 3), (255, 0, 0), np.uint8))
        Path(f"{stem}.pose.txt").write_text(POSE)
    return folder


def test_seven_scenes_frames_have_depth_in_metres(tmp_path: Path) -> None:
    recording = open_folder(write_seven_scenes(tmp_path))
    frame = next(iter(recording))

    assert len(recording) == 3
    assert recording.layout == "7-Scenes"
    assert frame.depth_m[3, 3] == 1.5
    assert not frame.valid[0, :2].any()
    assert frame.camera.fx == 20.0
    assert (frame.camera.width, frame.camera.height) == (8, 6)
    assert frame.T_map_sensor.translation[0] == 0.5


def test_colours_are_red_green_blue(tmp_path: Path) -> None:
    frame = next(iter(open_folder(write_seven_scenes(tmp_path))))

    assert frame.colour is not None
    assert frame.colour[3, 3, 2] > 250  # written as blue
    assert frame.T_colour_depth is not None


def test_stamps_follow_the_frame_numbers_and_are_never_zero(tmp_path: Path) -> None:
    write_seven_scenes(tmp_path, (0, 15))

    assert [f.stamp_s for f in open_folder(tmp_path)] == [FIRST_STAMP_S, FIRST_STAMP_S + 0.5]
    assert [f.stamp_s for f in open_folder(tmp_path, start_s=7.0)] == [7.0, 7.5]


def test_a_start_of_zero_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidFrame, match="greater than 0"):
        open_folder(write_seven_scenes(tmp_path), start_s=0.0)


def test_a_pose_that_is_nearly_a_rotation_becomes_one(tmp_path: Path) -> None:
    write_seven_scenes(tmp_path, (0,))
    (tmp_path / "frame-000000.pose.txt").write_text(
        "1.0002 0 0 0\n0 0.9998 0.0001 0\n0 0 1 0\n0 0 0 1"
    )
    rotation = next(iter(open_folder(tmp_path))).T_map_sensor.rotation

    assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize(
    ("name", "content", "problem"),
    [
        ("frame-000005.depth.png", b"", "empty"),
        ("frame-000005.color.jpg", None, "cannot be read"),
        ("frame-000005.depth.png", b"hello", "neither a PNG nor a JPEG"),
        ("frame-000005.color.jpg", b"\xff\xd8\xff\xe0", "no end marker"),
        ("frame-000005.pose.txt", b"", "holds 0 numbers, expected 4x4"),
        ("frame-000005.pose.txt", None, "cannot be read"),
        ("frame-000005.pose.txt", POSE.replace("0.5", "nan").encode(), "NaN"),
        ("frame-000005.pose.txt", POSE.replace("0.5", "-1.#IND").encode(), "not a number"),
        ("frame-000005.pose.txt", POSE.replace("1 0 0", "2 0 0", 1).encode(), "not a rotation"),
    ],
)
def test_a_damaged_frame_is_skipped_with_one_warning_that_names_it(
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    name: str,
    content: bytes | None,
    problem: str,
) -> None:
    write_seven_scenes(tmp_path)
    if content is None:
        (tmp_path / name).unlink()
    else:
        (tmp_path / name).write_bytes(content)

    with caplog.at_level(logging.WARNING):
        indices = [frame.index for frame in open_folder(tmp_path)]

    assert indices == [0, 10]
    (record,) = caplog.records
    assert name in record.getMessage()
    assert problem in record.getMessage()


def test_truncated_and_corrupted_pngs_are_noticed(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_seven_scenes(tmp_path)
    first, second = (tmp_path / f"frame-{k:06d}.depth.png" for k in (0, 5))
    first.write_bytes(first.read_bytes()[:-20])
    damaged = bytearray(second.read_bytes())
    damaged[-20] ^= 0xFF
    second.write_bytes(bytes(damaged))

    with caplog.at_level(logging.WARNING):
        indices = [frame.index for frame in open_folder(tmp_path)]

    assert indices == [10]
    assert "truncated" in caplog.records[0].getMessage()
    assert "checksum" in caplog.records[1].getMessage()


def test_an_eight_bit_depth_image_is_refused(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_seven_scenes(tmp_path, (0,))
    write_image(tmp_path / "frame-000000.depth.png", np.zeros((6, 8), np.uint8))

    with caplog.at_level(logging.WARNING):
        assert list(open_folder(tmp_path)) == []
    assert "16-bit" in caplog.text


def test_depth_images_without_any_pose_are_refused(tmp_path: Path) -> None:
    write_seven_scenes(tmp_path)
    for pose in tmp_path.glob("*.pose.txt"):
        pose.unlink()

    with pytest.raises(InvalidFrame, match="depth images without poses"):
        open_folder(tmp_path)
