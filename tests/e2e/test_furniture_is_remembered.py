"""Furniture over several visits: what was moved, what was taken away, and what keeps its name."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from fluentboard.model.fluent import Fluent
from fluentboard.model.geometry import Transform
from fluentboard_client import Client
from fluentboard_modules.demo.service_process import ServiceProcess
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.worker import MappingModule
from fluentboard_modules.progress import FrameProgress
from fluentboard_modules.simulation.drive import SimulatedDrive, table_drive
from fluentboard_modules.simulation.restaurant import restaurant
from fluentboard_modules.simulation.scene import Scene
from fluentboard_modules.simulation.viewpoint import kinect_camera
from fluentboard_modules.worker import run

FRAMES = 14


@dataclass(frozen=True)
class Drives:
    """Several drives, one after the other, as one source."""

    parts: tuple[SimulatedDrive, ...]
    name: str = "simulated"

    def __len__(self) -> int:
        return sum(map(len, self.parts))

    def __iter__(self) -> Iterator[SensorFrame]:
        for part in self.parts:
            yield from part


def drive(scene: Scene, start_s: float) -> SimulatedDrive:
    looks = table_drive(scene, "table1", 0, FRAMES, clearance_m=0.9, camera=kinect_camera(320))
    return replace(looks, start_s=start_s)


def map_on(board: Client, *drives: SimulatedDrive) -> None:
    """One run of the worker."""
    module = MappingModule("simulated", Transform.identity())
    run(module, Drives(drives), board, progress=FrameProgress())


def places(board: Client, piece: Fluent) -> list[tuple[float, float]]:
    """Where a piece stands, by its open poses."""
    poses = [board.fluent(str(name)) for name in piece.values("hasPose")]
    return [
        (float(pose.values("hasX")[0]), float(pose.values("hasY")[0]))
        for pose in poses
        if pose.is_open
    ]


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    """A board after three visits: a chair was moved before the second and one removed before the
    third; the worker was restarted between the first and the second."""
    scene = restaurant(np.random.default_rng(0))
    chair = scene["chair2"]
    aside = chair.pose.yaw_rad + 0.5 * math.pi
    to = replace(
        chair.pose,
        x=chair.pose.x + 1.1 * math.cos(aside),
        y=chair.pose.y + 1.1 * math.sin(aside),
    )
    second = scene.moved("chair2", to)
    with (
        ServiceProcess(tmp_path_factory.mktemp("board") / "data") as service,
        Client(service.address, author="mapping") as client,
    ):
        map_on(client, drive(scene, 1.0))
        map_on(client, drive(second, 100.0), drive(second.without("chair1"), 200.0))
        yield client


def test_every_piece_has_one_fluent_over_all_visits(board: Client) -> None:
    assert sorted(piece.name for piece in board.fluents("Furniture")) == [
        "chair1",
        "chair2",
        "counter1",  # in the background
        "table1",
    ]
    (table,) = board.fluents("Table")
    assert table.is_open


def test_moved_chair_keeps_its_name_and_gets_a_new_pose(board: Client) -> None:
    (moved,) = (piece for piece in board.fluents("Chair") if piece.is_open)
    true = restaurant(np.random.default_rng(0))["chair2"].pose
    ((x, y),) = places(board, moved)
    assert math.hypot(x - true.x, y - true.y) == pytest.approx(1.1, abs=0.15)
    first = board.fluent(str(moved.values("hasPose")[0]))
    assert first.finish.latest is not None
    assert 100.0 < first.finish.latest < 110.0


def test_removed_chair_is_ended_when_its_place_was_seen_empty(board: Client) -> None:
    (removed,) = (piece for piece in board.fluents("Chair") if not piece.is_open)
    assert removed.finish.earliest is not None
    assert removed.finish.latest is not None
    assert 100.0 < removed.finish.earliest < 200.0 < removed.finish.latest < 220.0
    assert places(board, removed) == []


def test_frames_of_all_runs_support_the_table(board: Client) -> None:
    evidence = [
        e
        for e in board.fluents("ExistenceEvidence")
        if "table1" in map(str, e.values("isEvidenceAbout"))
    ]
    frames = [float(stamp) for e in evidence for stamp in e.values("hasSupportingFrame")]
    assert len(frames) == len(set(frames)) > 2 * FRAMES
    assert [e.values("hasExistenceBelief") for e in evidence if e.is_open] == [(0.97,)]


def test_documented_queries_explain_the_furniture(board: Client) -> None:
    page = Path(__file__).parents[2] / "docs" / "reference" / "mapping.md"
    blocks = page.read_text(encoding="utf-8").split("```sparql\n")[1:]
    (moved,) = (piece for piece in board.fluents("Chair") if piece.is_open)
    queries = [block.split("```")[0].replace("chair2", moved.name) for block in blocks]
    support, why, why_not = (board.select(query) for query in queries)
    assert len(support) >= FRAMES
    assert {row["rule"] for row in why} >= {"ChairSeatPlaneRule"}
    assert all(row["reason"] for row in why_not)
