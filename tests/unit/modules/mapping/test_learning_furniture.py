"""A class of furniture learned from its CAD model recognises that model's planes."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from fluentboard.errors import InvalidInput
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.learning import learn_furniture, measure_shape
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.rules import load_rules
from fluentboard_modules.simulation import furniture
from fluentboard_modules.simulation.scene import Model
from fluentboard_ontology import read

MakePlane = Callable[..., PlanarRegion]


def cad(model: Model) -> CadModel:
    return CadModel(model.name, model.cls, model.mesh)


def classes_of(planes: list[PlanarRegion], model: Model, name: str) -> list[str]:
    rules = load_rules(read("furniture") + "\n" + learn_furniture(cad(model), name))
    return [hypothesis.class_name for hypothesis in rules.classify(planes).hypotheses]


def test_heights_and_sizes_are_those_of_the_model() -> None:
    chair = measure_shape(cad(furniture.chair(seat_height=0.6, height=1.1)))

    assert [round(level.height_m, 3) for level in chair.levels] == [0.6]
    assert chair.levels[0].area_m2 == pytest.approx(0.42 * 0.42, rel=0.05)
    assert chair.back is not None
    assert 0.75 < chair.back.height_m < 0.95
    assert chair.symmetry_order == 1


def test_what_is_hidden_below_a_part_is_no_level() -> None:
    cabinet = measure_shape(cad(furniture.cabinet(height=1.1)))

    assert [round(level.height_m, 2) for level in cabinet.levels] == [1.1]


def test_a_bar_table_is_learned(make_plane: MakePlane) -> None:
    table = furniture.table(width=1.0, depth=0.7, height=1.08)
    seen = make_plane((0.0, 0.0, 1.1), size=(0.9, 0.7))
    lower = make_plane((0.0, 0.0, 0.98), size=(0.9, 0.7))

    assert classes_of([seen], table, "BarTable")[0] == "BarTable"
    assert "BarTable" not in classes_of([lower], table, "BarTable")


def test_a_bar_stool_needs_its_back(make_plane: MakePlane) -> None:
    stool = furniture.chair(seat_height=0.65, height=1.05)
    seat = make_plane((0.0, 0.0, 0.65), size=(0.4, 0.4))
    back = make_plane((-0.2, 0.0, 0.88), normal=(1.0, 0.0, 0.1), size=(0.38, 0.3))

    assert "BarStool" in classes_of([seat, back], stool, "BarStool")
    assert "BarStool" not in classes_of([seat], stool, "BarStool")


def test_a_shelf_is_three_of_its_boards(make_plane: MakePlane) -> None:
    shelf = furniture.shelf(width=0.6, depth=0.3, height=2.1, compartments=6)
    boards = [level.height_m for level in measure_shape(cad(shelf)).levels]
    planes = [make_plane((0.0, 0.0, boards[k]), size=(0.5, 0.25)) for k in (0, 2, 4)]

    assert "TallShelf" in classes_of(planes, shelf, "TallShelf")
    assert "TallShelf" not in classes_of(planes[:2], shelf, "TallShelf")


def test_class_names_are_checked() -> None:
    with pytest.raises(InvalidInput, match="give one like BarTable"):
        learn_furniture(cad(furniture.table()), "bar table")
