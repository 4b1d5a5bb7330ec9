"""What `--frames` accepts: the source is told by looking at it; mistakes list what is known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from fluentboard.errors import InvalidFrame, InvalidInput
from fluentboard_modules.frames.bags import BagRecording
from fluentboard_modules.frames.clouds import CloudRecording
from fluentboard_modules.frames.folder_recording import FolderRecording
from fluentboard_modules.frames.recorder import checked_layout, record_source
from fluentboard_modules.frames.recordings import Recording
from fluentboard_modules.frames.sources import open_source

KINDS = [
    ("room", "7-scenes", FolderRecording),
    ("room", "tum", FolderRecording),
    ("room", "open3d", FolderRecording),
    ("room.bag", None, BagRecording),
    ("room.mcap", None, BagRecording),
    ("room.db3", None, BagRecording),
    ("room", "mcap", BagRecording),
    ("room", "sqlite3", BagRecording),
]


@pytest.mark.parametrize(("name", "layout", "kind"), KINDS)
def test_recording_is_told_by_looking_at_it(
    name: str, layout: Any, kind: type, made: Any, tmp_path: Path
) -> None:
    assert record_source(made, tmp_path / name, layout) == 5
    source = open_source(str(tmp_path / name))
    assert isinstance(source, kind)
    assert isinstance(source, Recording)
    assert made.agrees_with(list(source), colour=layout != "7-scenes")


def test_every_other_frame_may_be_asked_for(made: Any, tmp_path: Path) -> None:
    record_source(made, tmp_path / "room")
    source = open_source(f"{tmp_path / 'room'}?every=2", start_s=7.0)
    assert [frame.index for frame in source] == [0, 2, 4]
    assert next(iter(source)).stamp_s == 7.0


def test_cloud_is_a_source_of_one_frame(tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n0 0 1\n0.1 0 1\n0 0.1 1\n"
    )
    source = open_source(str(tmp_path / "a.ply"))
    assert isinstance(source, CloudRecording)
    assert isinstance(source, Recording)
    assert len(source) == 1
    assert next(iter(source)).cloud_sensor is not None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sim:ballroom", "no simulated scene is called 'ballroom'; give sim:restaurant, sim:room"),
        ("sim:room?sead=1", "no option 'sead' for this source; options are seed, frames"),
        ("sim:room?seed=x", "seed=x; give a whole number of at least 0"),
        ("sim:room?seed", "the option 'seed' is not understood"),
        ("sim:room?seed=1&seed=2", "the option 'seed=2' is not understood"),
        ("simulated-restaurant:x", "'simulated-restaurant:x'"),
        ("simulated-kitchen", "no simulated source is called 'simulated-kitchen'"),
    ],
)
def test_mistaken_simulator_is_explained(text: str, message: str) -> None:
    with pytest.raises(InvalidInput, match=message):
        open_source(text)


def test_place_with_nothing_lists_what_could_be_there(tmp_path: Path) -> None:
    with pytest.raises(InvalidFrame, match="no such file or folder; give a folder") as caught:
        open_source(str(tmp_path / "nowhere"))
    for kind in ("7-Scenes", "TUM", "Open3D", "ROS 2", ".pcd", ".mcap", "sim:room", "http://"):
        assert kind in caught.value.message


def test_file_of_an_unknown_kind_lists_the_known(tmp_path: Path) -> None:
    (tmp_path / "film.avi").write_bytes(b"")
    with pytest.raises(InvalidFrame, match=r"files in \.avi; known are \.pcd, \.ply, \.bag"):
        open_source(str(tmp_path / "film.avi"))


def test_folder_around_a_bag_names_it(made: Any, tmp_path: Path) -> None:
    record_source(made, tmp_path / "room.mcap")
    with pytest.raises(InvalidFrame, match=r"no recording itself, but holds room\.mcap"):
        open_source(str(tmp_path))


def test_options_of_one_kind_are_unknown_to_another(made: Any, tmp_path: Path) -> None:
    record_source(made, tmp_path / "room")
    with pytest.raises(InvalidInput, match="no option 'map' for this source; options are every"):
        open_source(f"{tmp_path / 'room'}?map=odom")


def test_bag_options_reach_the_bag(made: Any, tmp_path: Path) -> None:
    record_source(made, tmp_path / "room.bag")
    with pytest.raises(InvalidFrame, match="no topic '/nothing' for depth="):
        open_source(f"{tmp_path / 'room.bag'}?depth=/nothing")


def test_question_mark_may_be_part_of_a_name(made: Any, tmp_path: Path) -> None:
    record_source(made, tmp_path / "room?every=2")
    assert len(open_source(str(tmp_path / "room?every=2"))) == 5


def test_first_stamp_must_be_positive(made: Any, tmp_path: Path) -> None:
    record_source(made, tmp_path / "room")
    with pytest.raises(InvalidFrame, match=r"first stamp 0\.0 s; give one greater than 0"):
        open_source(str(tmp_path / "room"), start_s=0.0)


def test_unknown_layout_lists_the_known() -> None:
    with pytest.raises(InvalidInput, match="layout 'zip'; give one of 7-scenes, tum, open3d"):
        checked_layout("zip")
