"""ROS bags of every kind are read back as written; what is missing or damaged is named."""

from __future__ import annotations

import itertools
import logging
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fluentboard.errors import InvalidFrame, InvalidInput
from fluentboard.model.geometry import Pose
from fluentboard_modules.frames.bag_writers import COLOUR_TOPIC, DEPTH_TOPIC, Kind, write_bag
from fluentboard_modules.frames.bags import open_bag
from fluentboard_modules.frames.ros_messages import (
    CAMERA_INFO,
    COMPRESSED_IMAGE,
    IMAGE,
    POINT_CLOUD,
    depth_m,
)
from fluentboard_modules.frames.ros_topics import Topic, choose_topics, is_rectified

KINDS: dict[Kind, str] = {"bag": "room.bag", "mcap": "room", "sqlite3": "room"}


@pytest.mark.parametrize("kind", KINDS)
def test_bag_reads_back_as_written(kind: Kind, made: Any, tmp_path: Path) -> None:
    assert write_bag(made, tmp_path / KINDS[kind], kind) == 5
    recording = open_bag(tmp_path / KINDS[kind])
    assert len(recording) == 5
    assert made.agrees_with(list(recording))
    assert made.agrees_with(list(recording))  # may be read again
    assert recording.gravity_world is None
    assert recording.world_frame == "map"


@pytest.mark.parametrize(("kind", "ending"), [("mcap", ".mcap"), ("sqlite3", ".db3")])
def test_storage_file_of_a_bag_is_read_alone(
    kind: Kind, ending: str, made: Any, tmp_path: Path
) -> None:
    write_bag(made, tmp_path / "room", kind)
    (file,) = (path for path in (tmp_path / "room").iterdir() if path.suffix == ending)
    assert made.agrees_with(list(open_bag(file)))


def test_every_second_frame_keeps_its_number_and_colour(made: Any, tmp_path: Path) -> None:
    write_bag(made, tmp_path / "room", "mcap")
    recording = open_bag(tmp_path / "room", start_s=50.0).every(2)
    assert len(recording) == 3
    frames = list(recording)
    assert [frame.index for frame in frames] == [0, 2, 4]
    assert np.allclose([frame.stamp_s for frame in frames], [50.0, 50.2, 50.4], atol=1e-6)
    assert np.array_equal(np.asarray(frames[1].colour), np.asarray(made.frames[2].colour))


def test_colour_camera_of_its_own_is_placed_by_the_transforms(made: Any, tmp_path: Path) -> None:
    T_colour_depth = Pose.from_rpy(-0.025, 0.001, 0.0, yaw=0.01).to_transform()
    camera = replace(made.frames[0].camera, fx=25.0)
    made.frames[:] = [
        replace(f, colour_camera=camera, T_colour_depth=T_colour_depth) for f in made.frames
    ]
    write_bag(made, tmp_path / "room", "mcap")
    frame = list(open_bag(tmp_path / "room"))[4]
    assert frame.colour_camera == camera
    assert frame.T_colour_depth is not None
    assert np.allclose(frame.T_colour_depth.matrix, T_colour_depth.matrix)


def test_truncated_frame_is_skipped_with_a_warning(
    made: Any, tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_bag(made, tmp_path / "room", "mcap")
    recording = open_bag(tmp_path / "room")

    def cut(message: Any, topic: str) -> Any:
        if message.header.stamp.nanosec == 200_000_000:
            message = SimpleNamespace(**{**vars(message), "data": message.data[:-9]})
        return depth_m(message, topic)

    monkeypatch.setattr("fluentboard_modules.frames.bags.depth_m", cut)
    with caplog.at_level(logging.WARNING):
        assert [frame.index for frame in recording] == [0, 1, 3, 4]
    assert "frame 2 skipped" in caplog.text
    assert "the message is truncated" in caplog.text


def test_damaged_message_is_skipped_with_a_warning(
    made: Any, tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rosbags.highlevel import AnyReader

    write_bag(made, tmp_path / "room", "mcap")
    recording = open_bag(tmp_path / "room")
    read, count = AnyReader.deserialize, itertools.count()

    def cut(reader: AnyReader, content: bytes, kind: str) -> object:
        is_third_image = kind == IMAGE and len(content) < 500 and next(count) == 2
        return read(reader, content[:60] if is_third_image else content, kind)

    monkeypatch.setattr(AnyReader, "deserialize", cut)
    with caplog.at_level(logging.WARNING):
        assert len(list(recording)) == 4
    assert "a message of /camera/depth/image_rect_raw at 1.200 s is skipped" in caplog.text


def test_bag_that_breaks_off_ends_with_an_error_in_the_log(
    made: Any, tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rosbags.highlevel import AnyReader

    write_bag(made, tmp_path / "room", "mcap")
    recording = open_bag(tmp_path / "room")
    read = AnyReader.messages

    def break_off(reader: AnyReader, connections: Any) -> Iterator[Any]:
        yield from itertools.islice(read(reader, connections), 5)
        raise OSError("disk on fire")

    monkeypatch.setattr(AnyReader, "messages", break_off)
    frames = list(recording)
    assert 1 <= len(frames) < 5
    assert "ends after frame" in caplog.text
    assert "disk on fire" in caplog.text


@pytest.mark.parametrize("kind", KINDS)
def test_damaged_bag_is_named(kind: Kind, made: Any, tmp_path: Path) -> None:
    write_bag(made, tmp_path / KINDS[kind], kind)
    path = tmp_path / KINDS[kind]
    file = path if path.is_file() else next(p for p in path.iterdir() if p.suffix != ".yaml")
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    with pytest.raises(InvalidFrame, match="the bag cannot be read"):
        list(open_bag(path))


def test_missing_bag_is_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidFrame, match=r"none\.bag: the bag cannot be read"):
        open_bag(tmp_path / "none.bag")


def test_named_topic_that_is_not_there_lists_what_is(made: Any, tmp_path: Path) -> None:
    write_bag(made, tmp_path / "room", "mcap")
    with pytest.raises(InvalidFrame, match="no topic '/depht' for depth=; topics are /camera/"):
        open_bag(tmp_path / "room", options={"depth": "/depht"})
    with pytest.raises(InvalidFrame, match="no frame 'mapp' for map=; frames are camera_depth_opt"):
        open_bag(tmp_path / "room", options={"map": "mapp"})


def test_bag_of_points_alone_gives_frames(made: Any, tmp_path: Path) -> None:
    write_points(made, tmp_path / "room")
    recording = open_bag(tmp_path / "room")
    frames = list(recording)
    assert len(frames) == 5
    # Organised points are the depth image they came from.
    assert frames[1].camera == made.frames[1].camera
    assert np.allclose(frames[1].depth_m, made.frames[1].depth_m, atol=1e-6)
    assert recording.gravity_world is not None  # nothing says where the sensor was


def test_writer_keeps_what_is_there(made: Any, tmp_path: Path) -> None:
    (tmp_path / "room.bag").write_text("precious")
    with pytest.raises(InvalidInput, match="exists already"):
        write_bag(made, tmp_path / "room.bag", "bag")


# Choice of topics, on messages made of the few fields that matter.


def topic(name: str, kind: str, count: int = 10, **fields: Any) -> Topic:
    header = SimpleNamespace(frame_id=fields.pop("frame", name))
    return Topic(name, kind, count, SimpleNamespace(header=header, **fields))


def image(name: str, encoding: str, count: int = 10) -> Topic:
    return topic(name, IMAGE, count, encoding=encoding, width=640, height=480)


def chosen(topics: list[Topic], **options: str) -> list[str | None]:
    by_name = {t.name: t.first for t in topics}
    found = choose_topics(topics, options, lambda t: by_name[t.name], "bag")
    parts = (found.depth, found.colour, found.cloud, found.depth_info, found.colour_info)
    return [None if part is None else part.name for part in parts]


REALSENSE = [
    image("/d400/depth/image_rect_raw", "16UC1"),
    image("/d400/aligned_depth_to_color/image_raw", "16UC1"),
    image("/d400/infra1/image_rect_raw", "mono8"),
    image("/d400/color/image_raw", "rgb8"),
    topic("/d400/depth/camera_info", CAMERA_INFO, width=640, height=480),
    topic("/d400/aligned_depth_to_color/camera_info", CAMERA_INFO, width=640, height=480),
    topic("/d400/color/camera_info", CAMERA_INFO, width=640, height=480),
    topic("/d400/points", POINT_CLOUD),
]


def test_depth_aligned_with_colour_is_preferred() -> None:
    assert chosen(REALSENSE) == [
        "/d400/aligned_depth_to_color/image_raw",
        "/d400/color/image_raw",
        None,
        "/d400/aligned_depth_to_color/camera_info",
        "/d400/color/camera_info",
    ]


def test_named_topics_are_taken() -> None:
    assert chosen(REALSENSE, depth="/d400/depth/image_rect_raw", info="/d400/color/camera_info")[
        ::3
    ] == ["/d400/depth/image_rect_raw", "/d400/color/camera_info"]
    assert chosen(REALSENSE, cloud="/d400/points")[2] == "/d400/points"


def test_compressed_topics_have_the_camera_beside_the_raw_ones() -> None:
    topics = [
        topic(
            "/k/depth/image_raw/compressedDepth", COMPRESSED_IMAGE, format="16UC1; compressedDepth"
        ),
        topic("/k/rgb/image_color/compressed", COMPRESSED_IMAGE, format="jpeg"),
        topic("/k/depth/camera_info", CAMERA_INFO, width=640, height=480),
    ]
    assert chosen(topics) == [
        "/k/depth/image_raw/compressedDepth",
        "/k/rgb/image_color/compressed",
        None,
        "/k/depth/camera_info",
        None,
    ]


def test_camera_elsewhere_is_found_by_its_frame() -> None:
    depth = topic("/a/depth", IMAGE, encoding="32FC1", width=64, height=48, frame="eye")
    other = topic("/b/info", CAMERA_INFO, width=64, height=48, frame="ear")
    right = topic("/c/info", CAMERA_INFO, width=64, height=48, frame="eye")
    assert chosen([depth, other, right])[3] == "/c/info"


def test_points_serve_where_there_is_no_depth_image() -> None:
    topics = [image("/color", "rgb8"), topic("/scan", POINT_CLOUD, 5), topic("/p", POINT_CLOUD, 9)]
    assert chosen(topics) == [None, None, "/p", None, None]


def test_bag_without_depth_lists_its_topics() -> None:
    with pytest.raises(InvalidFrame, match=r"neither depth images nor point clouds .* /color \("):
        chosen([image("/color", "rgb8")])


def test_rectified_images_are_told_by_their_names() -> None:
    assert is_rectified("/camera/depth/image_rect_raw")
    assert is_rectified("/camera/depth_registered/image/compressedDepth")
    assert not is_rectified("/camera/depth/image_raw/compressedDepth")
    assert DEPTH_TOPIC != COLOUR_TOPIC


def write_points(made: Any, path: Path) -> None:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types: Any = store.types
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/points", POINT_CLOUD, typestore=store)
        for frame in made:
            points = frame.points_sensor().astype("<f4")
            nanoseconds = round(frame.stamp_s * 1e9)
            message = types[POINT_CLOUD](
                header=types["std_msgs/msg/Header"](
                    stamp=types["builtin_interfaces/msg/Time"](
                        sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9
                    ),
                    frame_id="camera_optical",
                ),
                height=points.shape[0],
                width=points.shape[1],
                fields=[
                    types["sensor_msgs/msg/PointField"](name=n, offset=4 * k, datatype=7, count=1)
                    for k, n in enumerate("xyz")
                ],
                is_bigendian=False,
                point_step=12,
                row_step=12 * points.shape[1],
                data=points.reshape(-1).view(np.uint8),
                is_dense=False,
            )
            writer.write(connection, nanoseconds, store.serialize_cdr(message, POINT_CLOUD))
