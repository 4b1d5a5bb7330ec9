"""The end of the demo: what a guest asks for is found, and the board tells how."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rich.console import Console

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.geometry import BoundingBox
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_client import Client
from fluentboard_modules.demo.searching import (
    STORY_QUERY,
    TARGET_CLASS,
    can_search,
    pictures_of,
    search_scene,
)
from fluentboard_modules.demo.service_process import ServiceProcess
from fluentboard_modules.geometry_fluents import box_fluents
from fluentboard_modules.simulation.restaurant import restaurant
from fluentboard_modules.simulation.scene import Scene
from fluentboard_modules.worker import stop_on_signals


def placing_area(scene: Scene, name: str) -> list[Fluent]:
    """The space on a piece of furniture, as mapping writes it."""
    box = scene[name].box
    top = BoundingBox(box.pose, box.x_size, box.y_size, box.z_size)
    since = Interval.at(1.0)
    parts = box_fluents("boxOfArea", "poseOfArea", top, since)
    link = (Property("hasBoundingBox", "BBox", "boxOfArea"),)
    return [*parts, Fluent("placingArea", "PlacingArea", since, UNKNOWN, link)]


def test_a_robot_finds_what_a_guest_asks_for(tmp_path: Path) -> None:
    scene = restaurant(np.random.default_rng(0))
    assert can_search(scene)
    assert not can_search(None)
    with (
        ServiceProcess(tmp_path / "board") as service,
        Client(service.address, author="test") as board,
        stop_on_signals() as stop,
    ):
        board.assert_fluents(placing_area(scene, "counter1"))
        record = search_scene(board, Console(quiet=True), scene, 10.0, stop, tmp_path)
        assert record is not None
        assert record.outcome == "found"
        (row,) = board.select(STORY_QUERY)
        assert row["result"] == "found"
        (mill,) = board.fluents(TARGET_CLASS, is_open=True)
        (search,) = board.fluents("SearchObjectActivity")
        assert search.values("hasFoundObject") == (mill.name,)
        assert not search.is_open
    assert {path.name for path, _ in pictures_of(tmp_path)} >= {"search.gif", "probability.png"}
