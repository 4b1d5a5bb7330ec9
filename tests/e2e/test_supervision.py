"""`fluentboard up` with a real board and real processes: restarts, states, drops, a clean stop."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from fluentboard_client import Client
from fluentboard_modules.frames.live import FramePublisher
from fluentboard_modules.frames.sources import open_source

_PATIENCE_S = 40.0

# A worker that takes a quarter of a second per frame, and crashes at its third frame if there is no
# file that says it has done so already.
_WORKER = """
import os, sys, time
from fluentboard.model.fluent import Fluent
from fluentboard_client import AssertFluent, Client
from fluentboard_modules.frames.sources import open_source
from fluentboard_modules.worker import run, stop_on_signals

class Silence:
    def begin(self, name, frames): pass
    def advance(self, status): pass
    def waiting(self, reason): pass

class Slow:
    name, subscription, frames = "slow", None, 0
    def begin(self, board): return []
    def notice(self, event): pass
    def status(self): return f"{self.frames} frames"
    def draw(self, directory): return []
    def finish(self): return [AssertFluent(Fluent("farewell", "Mug"), merge=True)]
    def process(self, frame):
        self.frames += 1
        if self.frames == 3 and not os.path.exists("crashed"):
            open("crashed", "w").close()
            os._exit(7)
        time.sleep(0.25)
        return []

source, board = sys.argv[1:]
with stop_on_signals() as stop, Client(board, author="slow") as client:
    run(Slow(), open_source(source), client, progress=Silence(), stop=stop)
print("worker says goodbye")
"""


class Up:
    """`fluentboard up` in a process of its own."""

    def __init__(self, folder: Path, config: dict[str, Any]) -> None:
        (folder / "slow.py").write_text(_WORKER)
        (folder / "up.yaml").write_text(yaml.safe_dump(config))
        self.log = folder / "up.log"
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "fluentboard", "up", str(folder / "up.yaml")],
                stdout=log,
                stderr=subprocess.STDOUT,
                env={**os.environ, "COLUMNS": "200"},
            )

    @property
    def text(self) -> str:
        return self.log.read_text()

    @property
    def address(self) -> str:
        self.await_that(lambda: "serves http" in self.text)
        found = re.search(r"serves (http://\S+)", self.text)
        assert found is not None
        return found.group(1)

    def await_that(self, holds: Callable[[], object]) -> None:
        deadline = time.monotonic() + _PATIENCE_S
        while not holds():
            assert self.process.poll() is None, self.text
            assert time.monotonic() < deadline, self.text
            time.sleep(0.05)

    def stop(self, number: int = signal.SIGTERM) -> int:
        self.process.send_signal(number)
        return self.process.wait(_PATIENCE_S)


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[[dict[str, Any]], Up]]:
    started: list[Up] = []

    def begin(config: dict[str, Any]) -> Up:
        started.append(Up(tmp_path, config))
        return started[-1]

    yield begin
    for up in started:
        if up.process.poll() is None:
            up.process.terminate()
            up.process.wait(_PATIENCE_S)


SERVICE = {"port": 0, "in_memory": True}
QUICK = {"restart": {"first_wait_s": 0.2}, "state": {"heartbeat_s": 0.5, "status_s": 1.0}}
_RUNS = """
SELECT ?result ?restarts ?earliest ?latest WHERE {
  ?run a upper:WorkerActivity ; upper:hasWorkerName "slow" ; upper:hasRestarts ?restarts ;
       upper:hasFinishEarliest ?earliest ; upper:hasFinishLatest ?latest .
  OPTIONAL { ?run upper:hasResult ?result }
} ORDER BY ?restarts
"""
_DROPPED = "SELECT (MAX(?n) AS ?most) WHERE { ?s upper:hasDroppedFrames ?n }"


def test_slow_worker_crashes_resumes_drops_frames_and_stops_with_everything(
    start: Callable[[dict[str, Any]], Up],
) -> None:
    worker = {"command": [sys.executable, "slow.py", "{board}/frames/head", "{board}"]}
    up = start({"service": SERVICE, "workers": {"slow": worker}, **QUICK})
    with Client(up.address) as board, FramePublisher(up.address, "head") as publisher:
        (frame,) = open_source("sim:table?frames=1&width=32&noise=0")

        def second_run_has_dropped_frames() -> bool:
            publisher.send(frame)
            rows: Any = board.query(_DROPPED)
            return (rows[0].get("most") or 0) > 5 if rows else False

        up.await_that(second_run_has_dropped_frames)
        runs: Any = board.query(_RUNS)
        assert [(row["result"], row["restarts"]) for row in runs] == [
            ("crashed: exit code 7", 0),
            (None, 1),
        ]
        crashed, running = runs
        assert crashed["earliest"] <= crashed["latest"] < time.time() + 1.0  # noqa: TID251
        assert running["latest"] == float("inf")
        assert running["earliest"] > crashed["latest"]
    assert up.stop() == 0
    text = up.text
    assert "slow: crashed after" in text
    assert "(exit code 7); restart 1 in 0.2 s" in text
    assert "slower than its sensor" in text
    # The worker said goodbye to a board that was still there, and only then the board stopped.
    order = ["slow: stopping", "worker says goodbye", "slow: stopped", "board: stopping"]
    places = [text.index(words) for words in [*order, "board: stopped"]]
    assert places == sorted(places)
    assert "WARNING" not in text[places[0] :]


def test_killed_board_comes_back_on_its_port_and_workers_go_on(
    start: Callable[[dict[str, Any]], Up], tmp_path: Path
) -> None:
    (tmp_path / "crashed").touch()
    worker = {"command": [sys.executable, "slow.py", "{board}/frames/head", "{board}"]}
    service = {"port": 0, "data": "board"}
    up = start({"service": service, "workers": {"slow": worker}, **QUICK})
    address = up.address
    (frame,) = open_source("sim:table?frames=1&width=32&noise=0")
    with Client(address, retries=0) as board, FramePublisher(address, "head") as publisher:
        publisher.send(frame)
        up.await_that(lambda: board.query("ASK { ?s upper:hasProcessedFrames ?n }"))
        pid = int(re.findall(r"board: started, process (\d+)", up.text)[0])
        os.kill(pid, signal.SIGKILL)
        up.await_that(lambda: up.text.count("board: started, process") == 2)
        up.await_that(board.ready)
        assert re.findall(r"serves (http://\S+)", up.text) == [address, address]
        publisher.send(frame)
        again = "SELECT ?n WHERE { ?s upper:hasProcessedFrames ?n FILTER (?n > 1) }"
        up.await_that(lambda: board.query(again))
        runs: Any = board.query(_RUNS)
        assert len(runs) == 1  # the worker was not restarted
    assert up.stop(signal.SIGINT) == 0


def test_all_stop_when_recordings_are_done(start: Callable[[dict[str, Any]], Up]) -> None:
    worker = {
        "command": [sys.executable, "slow.py", "sim:table?frames=2&width=32&noise=0", "{board}"]
    }
    up = start({"service": SERVICE, "workers": {"slow": worker}, "stop_when_done": True})
    assert up.process.wait(_PATIENCE_S) == 0
    assert "slow: finished after" in up.text
    assert "all workers are done" in up.text


def test_board_that_does_not_come_up_is_explained(start: Callable[[dict[str, Any]], Up]) -> None:
    up = start({"service": {"port": 0, "ontologies": ["none.ttl"]}, "workers": {}})
    assert up.process.wait(_PATIENCE_S) == 1
    assert "the board did not come up; it said:" in up.text
    assert "none.ttl" in up.text


def test_workers_of_a_supervisor_that_was_killed_stop(
    start: Callable[[dict[str, Any]], Up], tmp_path: Path
) -> None:
    (tmp_path / "crashed").touch()
    worker = {"command": [sys.executable, "slow.py", "{board}/frames/head", "{board}"]}
    up = start({"service": SERVICE, "workers": {"slow": worker}, **QUICK})
    address = up.address
    up.await_that(lambda: "slow: started" in up.text)
    service, slow = (
        int(re.findall(rf"{name}: started, process (\d+)", up.text)[0])
        for name in ("board", "slow")
    )
    (frame,) = open_source("sim:table?frames=1&width=32&noise=0")
    try:
        with Client(address) as board, FramePublisher(address, "head") as publisher:
            publisher.send(frame)
            up.await_that(lambda: board.query("ASK { ?s upper:hasProcessedFrames ?n }"))
            up.process.kill()
            up.process.wait()
            deadline = time.monotonic() + _PATIENCE_S
            while _is_alive(slow):
                assert time.monotonic() < deadline
                time.sleep(0.05)
            # It was asked to stop, so it still wrote what it had.
            assert board.fluent("farewell").class_name == "Mug"
    finally:
        os.kill(service, signal.SIGTERM)


def _is_alive(pid: int) -> bool:
    try:
        with open(f"/proc/{pid}/stat", encoding="ascii") as stat:
            return stat.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
