"""The mapping worker as a process of its own: a recording in, furniture on the board out."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Self

import numpy as np
import pytest

from fluentboard_client import Client
from fluentboard_modules.demo.findings import Finding
from fluentboard_modules.demo.run import present_furniture
from fluentboard_modules.demo.service_process import ServiceProcess
from fluentboard_modules.simulation.drive import table_drive
from fluentboard_modules.simulation.recording import record
from fluentboard_modules.simulation.restaurant import restaurant
from fluentboard_modules.simulation.viewpoint import kinect_camera

FRAMES = 12


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive around a laid table with two chairs, on disk."""
    folder = tmp_path_factory.mktemp("recording")
    scene = restaurant(np.random.default_rng(0))
    camera = kinect_camera(320)
    record(table_drive(scene, "table1", 0, FRAMES, clearance_m=0.9, camera=camera), folder)
    return folder


@pytest.fixture
def service(tmp_path: Path) -> Iterator[ServiceProcess]:
    with ServiceProcess(tmp_path / "board") as running:
        yield running


class Worker:
    """`fluentboard work mapping` as a process that does not outlive its test."""

    def __init__(self, recording: Path, board: str, *arguments: str) -> None:
        command: Sequence[str] = (
            *(sys.executable, "-m", "fluentboard", "work", "mapping", "--frames", str(recording)),
            *("--board", board, *arguments),
        )
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)

    def finish(self) -> tuple[int, str]:
        """Exit code and what it said, once it has ended."""
        _, said = self.process.communicate(timeout=60.0)
        return self.process.returncode, said

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.communicate()


def await_fluent(board: Client, class_name: str) -> None:
    """Waits until the worker has written a fluent of that class."""
    deadline = time.monotonic() + 30.0
    while next(board.fluents(class_name), None) is None:
        assert time.monotonic() < deadline, f"the worker writes no {class_name}"
        time.sleep(0.02)


def tables(board: Client) -> list[Finding]:
    return [piece for piece in present_furniture(board) if piece.class_name == "Table"]


def test_recording_becomes_furniture_on_the_board(
    recording: Path, service: ServiceProcess, tmp_path: Path
) -> None:
    frame_out, plot = tmp_path / "frame.json", tmp_path / "plot"
    options = ("--frame-out", str(frame_out), "--plot", str(plot))
    with Worker(recording, service.address, *options) as worker:
        code, said = worker.finish()
    assert (code, f"{FRAMES} frames" in said) == (0, True), said
    with Client(service.address) as board:
        (table,) = tables(board)
        assert table.rules == ("TablePlaneRule",)
        assert abs(table.box.pose.z + 0.5 * table.box.z_size - 0.74) < 0.03
        tops = board.fluents("PlacingArea", is_open=True)
        assert [area.values("isAreaOf") for area in tops].count((table.name,)) == 1
        assert board.history(table.name)[0].author == "mapping"
        assert [frame.name for frame in board.fluents("MapFrame")]
    assert np.shape(json.loads(frame_out.read_text())["T_map_world"]) == (4, 4)
    assert (plot / "map.png").stat().st_size > 1000


def test_second_run_finds_what_the_first_one_wrote(
    recording: Path, service: ServiceProcess
) -> None:
    for start_s in ("1.0", "101.0"):
        with Worker(recording, service.address, "--start", start_s) as worker:
            code, said = worker.finish()
        assert code == 0, said
    with Client(service.address) as board:
        assert [table.name for table in tables(board)] == ["table1"]
        assert len(list(board.fluents("MapFrame"))) == 1


def test_sigterm_ends_the_worker_cleanly(recording: Path, service: ServiceProcess) -> None:
    with Client(service.address) as board, Worker(recording, service.address) as worker:
        await_fluent(board, "MapFrame")
        worker.process.send_signal(signal.SIGTERM)
        code, said = worker.finish()
        assert (code, "(stopped)" in said) == (0, True), said
        assert f"{FRAMES} frames" not in said


def test_worker_goes_on_when_the_board_was_killed_and_comes_back(
    recording: Path, tmp_path: Path
) -> None:
    data = tmp_path / "board"
    with (
        ServiceProcess(data) as first,
        Client(first.address) as board,
        Worker(recording, first.address) as worker,
    ):
        await_fluent(board, "Furniture")
        first.kill()
        time.sleep(0.5)  # long enough for the worker to have something to say
        with ServiceProcess(data, int(first.address.rpartition(":")[2])):
            code, said = worker.finish()
            assert (code, f"{FRAMES} frames" in said) == (0, True), said
            assert len(tables(board)) == 1


def test_source_that_is_not_there_is_one_clear_line(service: ServiceProcess) -> None:
    with Worker(Path("/nowhere"), service.address) as worker:
        code, said = worker.finish()
    assert code == 1
    assert said.startswith("invalid-frame: /nowhere: no such file or folder; give")
    assert said.count("\n") == 1
