"""The furniture ontology applied to planes made by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.rules import (
    Classification,
    FurnitureRules,
    partial_hypotheses,
)
from fluentboard_modules.simulation.furniture import table

MakePlane = Callable[..., PlanarRegion]
BACK = (0.0, -1.0, 0.1)  # an upright normal towards the seat, reclined a little


def seat_and_back(make_plane: MakePlane, seat_height_m: float = 0.45) -> list[PlanarRegion]:
    return [
        make_plane((0.0, 0.0, seat_height_m), size=(0.42, 0.42)),
        make_plane((0.0, 0.25, seat_height_m + 0.3), BACK, (0.42, 0.35)),
    ]


def found(classification: Classification) -> set[tuple[str, int]]:
    return {(h.class_name, h.main_plane) for h in classification.hypotheses}


def test_a_level_plane_at_table_height_is_a_table(
    furniture_rules: FurnitureRules, make_plane: MakePlane
) -> None:
    result = furniture_rules.classify([make_plane((0.0, 0.0, 0.73), size=(1.2, 0.8))])

    assert ("Table", 0) in found(result)
    assert {"HorizontalPlane", "TablePlane"} <= result.labels[0]
    assert "TablePlaneRule" in result.rules[0]


def test_seat_and_backrest_are_a_chair_explained_by_both(
    furniture_rules: FurnitureRules, make_plane: MakePlane
) -> None:
    result = furniture_rules.classify(seat_and_back(make_plane))

    (chair,) = (h for h in result.hypotheses if h.class_name == "Chair" and h.main_plane == 0)
    assert [part.plane for part in chair.planes] == [0, 1]
    assert {"ChairSeatPlaneRule", "ChairBackrestPlaneRule"} <= set(chair.rules)
    assert chair.main_label == "ChairSeatPlane"


def test_a_seat_without_a_backrest_is_no_chair(
    furniture_rules: FurnitureRules, make_plane: MakePlane
) -> None:
    seat, _ = seat_and_back(make_plane)

    assert ("Chair", 0) not in found(furniture_rules.classify([seat]))


def test_one_plane_can_hold_several_labels(
    furniture_rules: FurnitureRules, make_plane: MakePlane
) -> None:
    result = furniture_rules.classify([make_plane((0.0, 0.0, 0.45), size=(0.42, 0.42))])

    assert {"ChairSeatPlane", "MiddleShelfPlane", "ShelfPlane"} <= result.labels[0]


def test_three_boards_above_each_other_are_a_shelf(
    furniture_rules: FurnitureRules, make_plane: MakePlane
) -> None:
    boards = [make_plane((0.0, 0.0, z), size=(0.8, 0.3)) for z in (0.13, 0.48, 0.83)]

    (shelf,) = (h for h in furniture_rules.classify(boards).hypotheses if h.class_name == "Shelf")
    assert shelf.main_plane == 0
    assert {part.plane for part in shelf.planes} == {0, 1, 2}


def test_boards_side_by_side_are_no_shelf(
    furniture_rules: FurnitureRules, make_plane: MakePlane
) -> None:
    boards = [make_plane((2.0 * k, 0.0, 0.13 + 0.35 * k), size=(0.8, 0.3)) for k in range(3)]

    assert not found(furniture_rules.classify(boards)) & {("Shelf", k) for k in range(3)}


def test_a_high_seat_is_a_near_miss_that_says_why(
    furniture_rules: FurnitureRules, make_plane: MakePlane
) -> None:
    result = furniture_rules.classify(seat_and_back(make_plane, seat_height_m=0.61))

    (miss,) = (m for m in result.near_misses if m.class_name == "Chair" and m.plane == 0)
    assert "0.61 m" in miss.reason
    assert "must be less than 0.53 m" in miss.reason
    assert "height above the floor" in miss.reason


def test_a_backrest_too_far_off_is_a_near_miss_that_says_how_far(
    furniture_rules: FurnitureRules, make_plane: MakePlane
) -> None:
    seat, back = seat_and_back(make_plane)
    far = make_plane(back.centroid + np.array([0.0, 0.25, 0.0]), BACK, (0.42, 0.35))

    result = furniture_rules.classify([seat, far])

    (miss,) = (m for m in result.near_misses if m.class_name == "Chair" and m.plane == 0)
    assert "chair backrest plane" in miss.reason
    assert "at most 0.25 m" in miss.reason


def test_furniture_is_no_near_miss(furniture_rules: FurnitureRules, make_plane: MakePlane) -> None:
    result = furniture_rules.classify(seat_and_back(make_plane))

    assert not [m for m in result.near_misses if (m.class_name, m.plane) in found(result)]


def test_hypotheses_come_in_the_order_of_the_ontologys_priority(
    furniture_rules: FurnitureRules, make_plane: MakePlane
) -> None:
    result = furniture_rules.classify([make_plane((0.0, 0.0, 0.73), size=(1.2, 0.8))])

    priorities = [h.priority for h in result.hypotheses]
    assert priorities == sorted(priorities, reverse=True)
    assert result.hypotheses[0].class_name == "Table"


@pytest.mark.parametrize("explain", [True, False])
def test_no_planes_are_no_furniture(furniture_rules: FurnitureRules, explain: bool) -> None:
    result = furniture_rules.classify([], explain=explain)

    assert result.labels == ()
    assert result.hypotheses == ()
    assert result.near_misses == ()


def test_the_backrest_beside_a_chair_is_still_a_hint_at_one(
    furniture_rules: FurnitureRules, make_plane: MakePlane
) -> None:
    planes = [*seat_and_back(make_plane), make_plane((0.6, 0.25, 0.75), BACK, (0.42, 0.35))]
    result = furniture_rules.classify(planes)

    hints = partial_hypotheses(result, furniture_rules.rules.furniture["Chair"], planes)

    assert 2 in {hint.main_plane for hint in hints}


def test_a_piece_of_a_wall_is_no_hint_at_a_chair(
    furniture_rules: FurnitureRules, make_plane: MakePlane
) -> None:
    planes = [
        make_plane((0.0, 2.0, 1.0), (0.0, -1.0, 0.0), (3.0, 1.6)),
        make_plane((2.5, 2.02, 0.75), (0.0, -1.0, 0.0), (0.42, 0.35)),
    ]
    result = furniture_rules.classify(planes)

    assert "ChairBackrestPlane" in result.labels[1]
    assert not partial_hypotheses(result, furniture_rules.rules.furniture["Chair"], planes)


def test_a_strip_of_a_top_is_a_hint_where_a_cad_model_has_its_top(
    furniture_rules: FurnitureRules, make_plane: MakePlane
) -> None:
    model = table(width=1.4, depth=0.8, height=0.74)
    cad = CadModel(model.name, model.cls, model.mesh)

    def hints(height_m: float) -> int:
        planes = [make_plane((0.0, 0.0, height_m), size=(0.8, 0.15))]
        result = furniture_rules.classify(planes)
        kind = furniture_rules.rules.furniture["Table"]
        return len(partial_hypotheses(result, kind, planes, [cad]))

    assert hints(0.73) == 1
    assert hints(0.6) == 0


def test_doors_in_front_of_a_wall_are_a_counter_whose_worktop_nobody_saw(
    furniture_rules: FurnitureRules, make_plane: MakePlane
) -> None:
    doors = make_plane((0.0, 0.0, 0.45), (0.0, -1.0, 0.0), (2.0, 0.85))
    tiles = make_plane((0.0, 0.6, 1.3), (0.0, -1.0, 0.0), (2.0, 0.7))

    (counter,) = (
        h for h in furniture_rules.classify([doors, tiles]).hypotheses if h.class_name == "Counter"
    )
    assert [part.label for part in counter.planes] == ["CounterFrontPlane", "SplashbackPlane"]
    assert ("Counter", 0) not in found(furniture_rules.classify([doors]))


def test_a_board_at_a_wall_is_a_wall_shelf(
    furniture_rules: FurnitureRules, make_plane: MakePlane
) -> None:
    board = make_plane((0.0, 0.0, 1.1), size=(1.5, 0.3))
    wall = make_plane((0.0, 0.17, 1.2), (0.0, -1.0, 0.0), (3.0, 2.4))

    assert ("WallShelf", 0) in found(furniture_rules.classify([board, wall]))
    assert ("WallShelf", 0) not in found(furniture_rules.classify([board]))


def test_a_near_miss_by_less_than_a_centimetre_shows_that_it_is_one(
    furniture_rules: FurnitureRules, make_plane: MakePlane
) -> None:
    result = furniture_rules.classify([make_plane((0.0, 0.0, 0.8102), size=(1.2, 0.8))])

    (miss,) = (miss for miss in result.near_misses if miss.class_name == "Table")
    assert "0.8102 m, must be less than 0.81 m" in miss.reason
