"""Pictures of a search are drawn for every look, over time, and as an animation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.search.config import SearchConfig, ViewSamplingConfig
from fluentboard_modules.search.execution import ObjectSearch
from fluentboard_modules.search.occupancy import OccupancyMap
from fluentboard_modules.search.pictures import (
    SearchAlbum,
    draw_probability,
    footprint,
    place_name,
)
from fluentboard_modules.search.record import Moment, SearchRecord
from fluentboard_modules.search.region import SearchVolume, region_of
from fluentboard_modules.simulation.furniture import table
from fluentboard_modules.simulation.navigation import costmap
from fluentboard_modules.simulation.robots import PR2, View
from fluentboard_modules.simulation.rooms import empty_room
from fluentboard_modules.simulation.scene import Instance
from fluentboard_modules.simulation.simulated_robot import SimulatedRobot

SCENE = empty_room(4.0, 4.0).with_instances([Instance("table1", table(), Pose(2.0, 2.6, 0.0))])
FREE = costmap(SCENE, PR2.radius_m)


@pytest.fixture
def search() -> ObjectSearch:
    start = View(2.0, 0.8, 1.57)
    robot = SimulatedRobot(PR2, SCENE, start, np.random.default_rng(0), image_width=64)
    occupancy = OccupancyMap(0.1)
    volume = SearchVolume("table1", BoundingBox(Pose(2.0, 2.6, 0.85), 0.8, 1.4, 0.25), 0.3)
    config = SearchConfig(resolution_m=0.1, sampling=ViewSamplingConfig(views=20), new_views=5)
    region = region_of(occupancy, [volume])
    return ObjectSearch(robot, occupancy, region, robot.costmap, config, np.random.default_rng(1))


def test_every_look_is_drawn_and_the_search_as_a_whole(
    search: ObjectSearch, tmp_path: Path
) -> None:
    album = SearchAlbum(FREE, PR2, sought_map=np.array([2.1, 2.5]))
    for _ in range(2):
        if search.step(lambda step: album.look(search, step)) is None:
            break
    search.end("found")
    looks = len(search.record.steps)
    files = album.draw(search.record, tmp_path / "pictures")
    assert [file.name for file in files] == [
        *(f"look{number + 1:02d}.png" for number in range(looks)),
        "probability.png",
        "search.gif",
    ]
    assert looks > 0
    with Image.open(files[-1]) as animation:
        assert getattr(animation, "n_frames", 1) == looks


def test_a_search_without_a_look_has_no_pictures(search: ObjectSearch, tmp_path: Path) -> None:
    assert SearchAlbum(FREE, PR2).draw(SearchRecord(View(0, 0, 0)), tmp_path) == []


def test_several_searches_share_one_plot_of_probability() -> None:
    records: dict[str, SearchRecord] = {}
    for name, seen in (("greedy", 0.4), ("ours", 0.6)):
        records[name] = SearchRecord(View(0.0, 0.0, 0.0))
        records[name].moments.append(Moment(10.0, 1.0, seen))
    (axes,) = draw_probability(records).axes
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["greedy", "ours"]


def test_the_outline_of_a_turned_box_is_turned() -> None:
    outline = footprint(BoundingBox(Pose.from_rpy(1.0, 2.0, 0.5, yaw=np.pi / 2), 2.0, 1.0, 0.3))
    assert outline.min(axis=0) == pytest.approx([0.5, 1.0])
    assert outline.max(axis=0) == pytest.approx([1.5, 3.0])


@pytest.mark.parametrize(
    ("volume", "place"),
    [
        ("searchVolumePlacingAreaTable1_search1", "Table1"),
        ("shelf3_search_PepperMill_c0808ee8", "shelf3"),
        ("around table1", "around table1"),
        ("_search", "_search"),
    ],
)
def test_volumes_are_labelled_by_their_place(volume: str, place: str) -> None:
    assert place_name(volume) == place
