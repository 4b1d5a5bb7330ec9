"""Counters known by their doors, and boards on walls, as depth images show them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pytest

from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.cad_library import CadLibrary
from fluentboard_modules.mapping.candidates import Stand, place_candidate, takes_the_place
from fluentboard_modules.mapping.config import (
    DepthNoiseConfig,
    FurnitureMapConfig,
    HypothesisConfig,
    VerificationConfig,
)
from fluentboard_modules.mapping.depth_views import thin_view
from fluentboard_modules.mapping.hypotheses import FurnitureGeometry, place_hypothesis, space_above
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.rules import FurnitureRules
from fluentboard_modules.mapping.verify import Verdict, verify

Box = tuple[Sequence[float], Sequence[float]]
Render = Callable[..., SensorFrame]
MakePlane = Callable[..., PlanarRegion]

ROOM: list[Box] = [((-3.0, 2.0, 0.0), (3.0, 2.1, 2.5)), ((-3.0, -1.0, -0.1), (3.0, 2.0, 0.0))]
COUNTER: Box = ((-1.0, 1.4, 0.0), (1.0, 2.0, 0.9))
BOARD: Box = ((-0.7, 1.7, 1.06), (0.7, 2.0, 1.1))
EYES = ((-0.3, -0.6, 1.5), (0.4, -0.5, 1.5))


@pytest.fixture
def doors(make_plane: MakePlane) -> list[PlanarRegion]:
    """The doors of the counter, and the wall above it."""
    return [
        make_plane((0.0, 1.4, 0.47), (0.0, -1.0, 0.0), (2.0, 0.86)),
        make_plane((0.0, 2.0, 1.6), (0.0, -1.0, 0.0), (3.0, 1.4)),
    ]


@pytest.fixture
def board(make_plane: MakePlane) -> list[PlanarRegion]:
    """The board, and the wall that it is fixed to."""
    return [
        make_plane((0.0, 1.85, 1.1), size=(1.4, 0.3)),
        make_plane((0.0, 2.0, 1.25), (0.0, -1.0, 0.0), (3.0, 2.5)),
    ]


def placed(
    rules: FurnitureRules, class_name: str, planes: Sequence[PlanarRegion]
) -> FurnitureGeometry:
    """Where the only hypothesis of a class puts the piece."""
    (hypothesis,) = (h for h in rules.classify(planes).hypotheses if h.class_name == class_name)
    furniture = rules.rules.furniture[class_name]
    return place_hypothesis(hypothesis, furniture, planes, HypothesisConfig())


def verdict_on(
    render: Render,
    rules: FurnitureRules,
    class_name: str,
    planes: Sequence[PlanarRegion],
    boxes: Sequence[Box],
    height_m: float = 0.8,
) -> Verdict:
    """What two views of a room with these boxes say; they look at the given height."""
    noise = DepthNoiseConfig()
    views = [
        thin_view(render([*ROOM, *boxes], eye=eye, target=(0.0, 1.8, height_m), stamp_s=k), noise)
        for k, eye in enumerate(EYES, start=1)
    ]
    geometry = placed(rules, class_name, planes)
    (verdict,) = verify(class_name, geometry, planes, views, CadLibrary(), VerificationConfig())
    return verdict


def test_a_counter_reaches_from_its_doors_to_the_wall(
    furniture_rules: FurnitureRules, doors: list[PlanarRegion]
) -> None:
    box = placed(furniture_rules, "Counter", doors).box

    assert (box.pose.x, box.pose.y, box.pose.z) == pytest.approx((0.0, 1.7, 0.45))
    assert (box.x_size, box.y_size, box.z_size) == pytest.approx((0.6, 2.0, 0.9))


def test_things_are_put_on_top_of_a_counter_of_which_only_the_doors_were_seen(
    furniture_rules: FurnitureRules, doors: list[PlanarRegion]
) -> None:
    area = space_above(placed(furniture_rules, "Counter", doors).box, HypothesisConfig())

    assert area.pose.z - 0.5 * area.z_size == pytest.approx(0.9)
    assert (area.x_size, area.y_size) == pytest.approx((0.6, 2.0))


def test_a_counter_is_believed_by_its_doors(
    render: Render, furniture_rules: FurnitureRules, doors: list[PlanarRegion]
) -> None:
    assert verdict_on(render, furniture_rules, "Counter", doors, [COUNTER]).is_accepted


def test_a_wall_that_juts_out_is_no_counter(
    render: Render, furniture_rules: FurnitureRules, doors: list[PlanarRegion]
) -> None:
    jut: Box = ((-1.0, 1.4, 0.0), (1.0, 2.0, 2.5))

    assert not verdict_on(render, furniture_rules, "Counter", doors, [jut]).is_accepted


def test_a_front_that_nobody_saw_over_is_no_counter(
    render: Render, furniture_rules: FurnitureRules, doors: list[PlanarRegion]
) -> None:
    """The images end below its upper edge: it may go on to the ceiling."""
    verdict = verdict_on(render, furniture_rules, "Counter", doors, [COUNTER], height_m=-0.6)

    assert not verdict.is_accepted


def test_a_wall_shelf_does_not_reach_down_to_the_floor(
    furniture_rules: FurnitureRules, board: list[PlanarRegion]
) -> None:
    box = placed(furniture_rules, "WallShelf", board).box

    assert box.pose.z - 0.5 * box.z_size == pytest.approx(1.06)
    assert sorted((box.x_size, box.y_size)) == pytest.approx([0.3, 1.4])


def test_a_board_with_nothing_below_it_is_a_wall_shelf(
    render: Render, furniture_rules: FurnitureRules, board: list[PlanarRegion]
) -> None:
    assert verdict_on(render, furniture_rules, "WallShelf", board, [BOARD]).is_accepted


def test_the_top_of_a_cupboard_is_no_wall_shelf(
    render: Render, furniture_rules: FurnitureRules, board: list[PlanarRegion]
) -> None:
    cupboard: Box = ((-0.7, 1.7, 0.0), (0.7, 2.0, 1.1))

    assert not verdict_on(render, furniture_rules, "WallShelf", board, [cupboard]).is_accepted


@pytest.mark.parametrize(
    ("class_name", "aside_m", "is_gone"),
    [("Cabinet", 0.0, True), ("Cabinet", 1.5, False), ("WallShelf", 0.0, False)],
)
def test_a_counter_takes_the_place_of_a_cabinet_but_not_of_a_shelf_above_it(
    furniture_rules: FurnitureRules,
    doors: list[PlanarRegion],
    class_name: str,
    aside_m: float,
    is_gone: bool,
) -> None:
    """A scrap of the top and the doors were a cabinet, until the wall behind them was seen."""
    config = FurnitureMapConfig()
    (hypothesis,) = (
        h for h in furniture_rules.classify(doors).hypotheses if h.class_name == "Counter"
    )
    classes = furniture_rules.rules.furniture
    counter = place_candidate(
        hypothesis, classes["Counter"], [0, 1], doors, {0: 20, 1: 20}, {0: 1.0, 1: 1.0}, config
    )
    low, high = (0.0, 0.9) if class_name == "Cabinet" else (1.06, 1.1)
    at = Pose.from_rpy(aside_m, 1.7, 0.5 * (low + high))

    box = BoundingBox(at, 1.0, 0.5, high - low)
    assert takes_the_place(counter, Stand(classes[class_name], box, None), config) == is_gone
