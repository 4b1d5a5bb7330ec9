"""The demo from its first line to its last file, on a short recording."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fluentboard_client import Client
from fluentboard_modules.simulation.drive import table_drive
from fluentboard_modules.simulation.recording import record
from fluentboard_modules.simulation.restaurant import restaurant
from fluentboard_modules.simulation.viewpoint import kinect_camera


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recording")
    scene = restaurant(np.random.default_rng(0))
    camera = kinect_camera(320)
    record(table_drive(scene, "table1", 0, 10, clearance_m=0.9, camera=camera), folder)
    return folder


def start_demo(recording: Path, output: Path, *arguments: str) -> subprocess.Popen[str]:
    command = [
        *(sys.executable, "-m", "fluentboard", "demo", "--frames", str(recording)),
        *("--output", str(output), *arguments),
    ]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_demo_shows_the_whole_path(recording: Path, tmp_path: Path) -> None:
    with start_demo(recording, tmp_path) as demo:
        told, complained = demo.communicate(timeout=120.0)
    assert demo.returncode == 0, complained
    assert re.search(r"commit +\d+ +\+ table1 +a Table at", told)  # heard while mapping
    assert re.search(r"^table1 +Table ", told, re.MULTILINE)  # in the table of findings
    assert re.search(r"^placingAreaTable1 +table1 ", told, re.MULTILINE)  # the query's answer
    names = {"overview.png", "map.png", "view.png", "timeline.png", "fluents.yaml"}
    assert {file.name for file in tmp_path.iterdir()} == names
    assert all(file.stat().st_size > 1000 for file in tmp_path.iterdir())


def test_kept_service_answers_until_ctrl_c(recording: Path, tmp_path: Path) -> None:
    with start_demo(recording, tmp_path, "--keep") as demo:
        assert demo.stdout is not None
        address = ""
        for line in demo.stdout:
            found = re.search(r"The board stays at (http://\S+);", line)
            if found:
                address = found.group(1)
            if "Ctrl-C" in line:
                break
        with Client(address) as board:
            assert board.ask("ASK { ?table a furniture:Table }")
            demo.send_signal(signal.SIGINT)
            demo.communicate(timeout=60.0)
            assert demo.returncode == 0
            assert not board.ready()
