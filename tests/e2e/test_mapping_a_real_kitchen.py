"""The furniture of a real kitchen, from twenty frames, with poses and gravity as they are."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from fluentboard_modules.frames.folders import open_folder
from fluentboard_modules.frames.gravity import align_with_gravity, place_in_map
from fluentboard_modules.mapping.cad_library import CadLibrary
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.floor import survey_floor
from fluentboard_modules.mapping.furniture_item import FurnitureItem
from fluentboard_modules.mapping.furniture_map import FurnitureMap
from fluentboard_modules.mapping.judge import FurnitureJudge
from fluentboard_modules.mapping.rules import load_rules
from fluentboard_modules.mapping.surfaces import detect_regions
from fluentboard_ontology import read


@pytest.fixture(scope="module")
def furniture(shared_data: Path) -> list[FurnitureItem]:
    config = MappingConfig()
    recording = open_folder(shared_data / "redkitchen")
    upright = recording.in_map(align_with_gravity(recording.gravity_world))
    floor = survey_floor(upright.every(25), config.surfaces)
    assert floor is not None
    in_map = recording.in_map(place_in_map(recording.gravity_world, floor.height_m))
    noise = config.surfaces.noise
    judge = FurnitureJudge(CadLibrary(), config.verification, noise)
    room = FurnitureMap(load_rules(read("furniture")), config.furniture, noise, judge)
    for frame in in_map.every(10):
        room.update(frame, detect_regions(frame, config.surfaces))
    room.settle()
    return room.furniture()


def test_the_dining_table_is_one_table(furniture: list[FurnitureItem]) -> None:
    assert [item.class_name for item in furniture].count("Table") == 1


def test_its_top_is_as_high_as_it_is(furniture: list[FurnitureItem]) -> None:
    (table,) = (item for item in furniture if item.class_name == "Table")

    assert 0.69 < table.pose.z < 0.75
    assert 1.6 < table.box.x_size < 2.4
    assert 0.8 < table.box.y_size < 1.1
    assert table.score > 0.8


def test_nothing_is_found_but_what_is_there(furniture: list[FurnitureItem]) -> None:
    counts = Counter(item.class_name for item in furniture)

    assert 3 <= counts.pop("Chair") <= 5
    assert counts == {"Table": 1, "Counter": 2, "WallShelf": 1}


def test_the_counters_meet_in_the_corner(furniture: list[FurnitureItem]) -> None:
    """The worktop is of polished stone, of which the camera measured nothing."""
    back, left = sorted(
        (item for item in furniture if item.class_name == "Counter"),
        key=lambda item: -item.box.pose.y,
    )

    assert (back.box.pose.x, back.box.pose.y) == pytest.approx((-1.13, 3.15), abs=0.15)
    assert (left.box.pose.x, left.box.pose.y) == pytest.approx((-2.26, 1.91), abs=0.15)
    for counter in (back, left):
        assert 0.55 < counter.box.x_size < 0.7
        assert 0.86 < counter.box.z_size < 0.99
        assert counter.placing_area is not None
