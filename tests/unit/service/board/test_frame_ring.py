"""The ring of live frames: bounded, whole, and there again after a restart."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from fluentboard.board.frame_ring import FrameRing
from fluentboard.board.frame_settings import FrameSettings
from fluentboard.errors import InvalidFrame, InvalidName, StorageFailed, TooLarge, UnknownResource
from fluentboard.model.frame_message import FrameMessage, PinholeJson, pack_frame
from fluentboard.model.geometry import Transform

Open = Callable[..., FrameRing]
CAMERA = PinholeJson(4, 3, 2.0, 2.0, 1.5, 1.0)


def frame(number: int, size: int = 0) -> bytes:
    depth = b"\x89PNG\r\n\x1a\n" + bytes(size)
    return pack_frame(FrameMessage(1.0 + number, CAMERA, Transform.identity(), depth))


SIZE = len(frame(1))


@pytest.fixture
def ring_of(tmp_path: Path) -> Open:
    def open_ring(**settings: int) -> FrameRing:
        return FrameRing(tmp_path / "frames", FrameSettings.model_validate(settings))

    return open_ring


def kept(ring: FrameRing, sensor: str = "head") -> list[int]:
    (state,) = (state for state in ring.sensors() if state.sensor == sensor)
    return list(range(state.oldest.index, state.newest.index + 1))


def test_frames_are_numbered_and_read_back(ring_of: Open) -> None:
    ring = ring_of()
    assert [ring.add("head", frame(n)).index for n in range(3)] == [0, 1, 2]
    assert ring.read("head", 1) == frame(1)
    newest = ring.newest("head")
    assert newest is not None
    assert (newest.index, newest.stamp_s) == (2, 3.0)


def test_newest_is_given_only_to_who_does_not_have_it(ring_of: Open) -> None:
    ring = ring_of()
    assert ring.newest("head") is None
    for n in range(3):
        ring.add("head", frame(n))
    assert ring.newest("head", after=2) is None
    newest = ring.newest("head", after=0)
    assert newest is not None
    assert newest.index == 2


def test_number_from_before_the_ring_was_emptied_counts_as_none(ring_of: Open) -> None:
    ring = ring_of()
    ring.add("head", frame(0))
    newest = ring.newest("head", after=900)
    assert newest is not None
    assert newest.index == 0


def test_oldest_frames_of_a_sensor_make_room(ring_of: Open, tmp_path: Path) -> None:
    ring = ring_of(ring_frames=3)
    for n in range(7):
        ring.add("head", frame(n))
    assert kept(ring) == [4, 5, 6]
    assert len(list((tmp_path / "frames" / "head").iterdir())) == 3
    assert ring.dropped == 4
    with pytest.raises(UnknownResource, match="frame 3 of sensor 'head' is not kept"):
        ring.read("head", 3)


def test_oldest_frames_of_all_sensors_make_room_for_bytes(ring_of: Open, tmp_path: Path) -> None:
    ring = ring_of(ring_max_bytes=4 * SIZE)
    ring.add("a", frame(0))
    for n in range(3):
        ring.add("b", frame(n))
    ring.add("b", frame(3))
    assert ring.newest("a") is None
    assert kept(ring, "b") == [0, 1, 2, 3]
    ring.add("b", frame(4))
    assert kept(ring, "b") == [1, 2, 3, 4]
    assert ring.size_bytes <= 4 * SIZE
    on_disk = sum(path.stat().st_size for path in tmp_path.rglob("*.frame"))
    assert on_disk == ring.size_bytes


def test_number_goes_on_after_all_frames_of_a_sensor_were_dropped(ring_of: Open) -> None:
    ring = ring_of(ring_max_bytes=2 * SIZE)
    ring.add("a", frame(0))
    ring.add("b", frame(0))
    ring.add("b", frame(1))
    assert ring.add("a", frame(1)).index == 1


def test_frames_are_there_after_a_restart(ring_of: Open) -> None:
    before = ring_of()
    for n in range(3):
        before.add("head", frame(n))
    after = ring_of()
    assert kept(after) == [0, 1, 2]
    assert after.size_bytes == 3 * SIZE
    assert after.add("head", frame(3)).index == 3


def test_restart_with_lower_limits_drops_what_does_not_fit(ring_of: Open) -> None:
    before = ring_of()
    for n in range(6):
        before.add("head", frame(n))
    assert kept(ring_of(ring_frames=4)) == [2, 3, 4, 5]
    assert kept(ring_of(ring_max_bytes=2 * SIZE)) == [4, 5]


def test_what_a_crash_left_half_written_is_removed(ring_of: Open, tmp_path: Path) -> None:
    ring_of().add("head", frame(0))
    folder = tmp_path / "frames" / "head"
    (folder / "000000000001.partial").write_bytes(b"half")
    (folder / "000000000002.frame").write_bytes(b"??")
    ring = ring_of()
    assert kept(ring) == [0]
    assert [path.name for path in folder.iterdir()] == ["000000000000.frame"]


def test_frame_that_is_none_is_refused_and_not_kept(ring_of: Open, tmp_path: Path) -> None:
    ring = ring_of()
    with pytest.raises(InvalidFrame):
        ring.add("head", frame(0)[:-3])
    assert not ring.sensors()
    assert not list(tmp_path.rglob("*.frame"))


def test_too_long_a_frame_is_refused(ring_of: Open) -> None:
    with pytest.raises(TooLarge, match="more than the 100 it may have"):
        ring_of(frame_max_bytes=100).add("head", frame(0, size=200))


def test_too_many_sensors_are_refused(ring_of: Open) -> None:
    ring = ring_of(sensors_max=2)
    ring.add("a", frame(0))
    ring.add("b", frame(0))
    with pytest.raises(TooLarge, match="2 sensors send frames already"):
        ring.add("c", frame(0))
    ring.add("a", frame(1))


@pytest.mark.parametrize("name", ["", ".", "..", "../etc", "a/b", ".hidden", "ä", "x" * 65])
def test_sensor_that_is_no_folder_name_is_refused(name: str, ring_of: Open) -> None:
    with pytest.raises(InvalidName, match="use letters, digits"):
        ring_of().add(name, frame(0))
    with pytest.raises(UnknownResource):
        ring_of().read(name, 0)


def test_unwritable_folder_is_an_error(ring_of: Open, tmp_path: Path) -> None:
    ring = ring_of()
    (tmp_path / "frames" / "head").write_text("a file where the folder should be")
    with pytest.raises(StorageFailed, match="the frame cannot be written"):
        ring.add("head", frame(0))


def test_folder_that_is_a_file_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "frames").write_text("mine")
    with pytest.raises(StorageFailed, match="frames cannot be kept there"):
        FrameRing(tmp_path / "frames", FrameSettings())


def test_many_senders_at_once_lose_nothing(ring_of: Open) -> None:
    ring = ring_of(ring_frames=1000)

    def send(sensor: str) -> None:
        for n in range(25):
            ring.add(sensor, frame(n))

    threads = [threading.Thread(target=send, args=(name,)) for name in ("a", "b", "a")]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert kept(ring, "a") == list(range(50))
    assert kept(ring, "b") == list(range(25))
    assert ring.size_bytes == sum(len(frame(n)) for n in range(25)) * 3
