"""Every format can be the `--frames` of a worker: mapping and anchoring run on each."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from fluentboard_client import Client, Command, Event
from fluentboard_modules.anchoring.worker import run_anchoring
from fluentboard_modules.demo.service_process import ServiceProcess
from fluentboard_modules.frames.live import FramePublisher
from fluentboard_modules.frames.recorder import Layout, record_source
from fluentboard_modules.frames.sensor_frame import FrameSource, SensorFrame
from fluentboard_modules.frames.sources import open_source
from fluentboard_modules.map_placing import open_placed
from fluentboard_modules.mapping.worker import run_mapping
from fluentboard_modules.progress import FrameProgress
from fluentboard_modules.worker import StopRequest, run

DRIVE = "sim:table?frames=2&width=160&noise=0"


def _anchoring(frames: str, board: str) -> int:
    placed = open_placed(frames, board)
    return run_anchoring(placed.source, board).frames


WORKERS: dict[str, Callable[[str, str], int]] = {
    "mapping": lambda frames, board: run_mapping(frames, board).frames,
    "anchoring": _anchoring,
}
"""What a worker does with a source and a board: it returns how many frames it processed."""


@pytest.fixture(scope="module")
def drive() -> FrameSource:
    return open_source(DRIVE)


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with ServiceProcess(tmp_path_factory.mktemp("board") / "data") as service:
        yield service.address


@pytest.mark.parametrize("worker", list(WORKERS))
@pytest.mark.parametrize(
    ("name", "layout"),
    [
        ("room", "7-scenes"),
        ("room", "tum"),
        ("room", "open3d"),
        ("room.bag", "bag"),
        ("room", "sqlite3"),
        ("room.mcap", "mcap"),
        ("room.db3", "sqlite3"),
    ],
)
def test_a_worker_processes_a_recording_of_every_layout(
    worker: str, name: str, layout: Layout, drive: FrameSource, board: str, tmp_path: Path
) -> None:
    record_source(drive, tmp_path / name, layout)
    assert WORKERS[worker](str(tmp_path / name), board) == 2


@pytest.mark.parametrize("worker", list(WORKERS))
@pytest.mark.parametrize("ending", [".pcd", ".ply"])
def test_a_worker_processes_a_cloud(
    worker: str, ending: str, drive: FrameSource, board: str, tmp_path: Path
) -> None:
    frame = next(iter(drive))
    points = frame.points_sensor().reshape(-1, 3)
    rows = "\n".join(" ".join(f"{v:.4f}" for v in point) for point in points)
    if ending == ".pcd":
        head = (
            "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
            f"WIDTH {frame.camera.width}\nHEIGHT {frame.camera.height}\n"
            f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA ascii\n"
        )
    else:
        rows = "\n".join(row for row in rows.split("\n") if "nan" not in row)
        head = (
            f"ply\nformat ascii 1.0\nelement vertex {int(np.isfinite(points[:, 0]).sum())}\n"
            "property float x\nproperty float y\nproperty float z\nend_header\n"
        )
    (tmp_path / f"table{ending}").write_text(head + rows + "\n")
    assert WORKERS[worker](str(tmp_path / f"table{ending}"), board) == 1


@pytest.mark.parametrize("worker", list(WORKERS))
def test_a_worker_processes_a_simulated_drive(worker: str, board: str) -> None:
    assert WORKERS[worker](DRIVE, board) == 2


class _Counting:
    """A module that counts frames and asks to be stopped at the second."""

    name = "counting"
    subscription = None

    def __init__(self, stop: StopRequest) -> None:
        self._stop = stop
        self.seen: list[SensorFrame] = []

    def begin(self, board: Client) -> Sequence[Command]:
        return []

    def notice(self, event: Event) -> None: ...

    def process(self, frame: SensorFrame) -> Sequence[Command]:
        self.seen.append(frame)
        if len(self.seen) == 2:
            self._stop.ask()
        return []

    def finish(self) -> Sequence[Command]:
        return []

    def status(self) -> str:
        return ""

    def draw(self, directory: Path) -> Sequence[Path]:
        return []


def test_a_worker_processes_live_frames(drive: FrameSource, board: str) -> None:
    stop, over = StopRequest(), threading.Event()
    first = next(iter(drive))

    def send() -> None:
        with FramePublisher(board, "head") as publisher:
            while not over.wait(0.02):
                publisher.send(first)

    robot = threading.Thread(target=send)
    robot.start()
    try:
        module = _Counting(stop)
        with Client(board) as client, FrameProgress() as progress:
            source = open_source(f"{board}/frames/head")
            report = run(module, source, client, progress=progress, stop=stop)
    finally:
        over.set()
        robot.join()
    assert (report.frames, report.was_stopped) == (2, True)
    # Millimetres survive the way over the board.
    assert np.abs(module.seen[0].depth_m - first.depth_m).max() <= 0.0005 + 1e-6
