"""Furniture and tableware: frames and sizes as documented."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fluentboard.errors import InvalidGeometry
from fluentboard_modules.simulation import belongings, furniture, tableware
from fluentboard_modules.simulation.scene import Model
from fluentboard_modules.simulation.supports import horizontal_supports

FURNITURE = [
    furniture.table(),
    furniture.round_table(),
    furniture.desk(),
    furniture.counter(),
    furniture.chair(),
    furniture.chair(slats=3),
    furniture.shelf(),
    furniture.cabinet(),
]
TABLEWARE = [
    tableware.plate(),
    tableware.bowl(),
    tableware.mug(),
    tableware.jug(),
    tableware.sugar_pot(),
    tableware.milk_pot(),
    tableware.pepper_mill(),
    tableware.table_sign(),
    tableware.fork(),
    tableware.spoon(),
    tableware.knife(),
]
BELONGINGS = [
    belongings.book(0.24, 0.17, 0.03, (0, 0, 0)),
    belongings.carton(),
    belongings.bottle(),
    belongings.screen(),
    belongings.keyboard(),
    belongings.laptop(),
    belongings.plant(),
    belongings.waste_bin(),
    belongings.candle(),
]
ALL = FURNITURE + TABLEWARE + BELONGINGS


@pytest.mark.parametrize("model", ALL, ids=lambda m: m.name)
def test_a_model_stands_on_its_origin(model: Model):
    low, high = model.mesh.bounds
    assert low[2] == pytest.approx(0.0, abs=1e-9)
    # Handles and spouts make the box of a vessel lopsided, but the origin stays under it.
    assert (low[:2] < 0.0).all()
    assert (high[:2] > 0.0).all()


@pytest.mark.parametrize("model", ALL, ids=lambda m: m.name)
def test_the_surface_of_a_model_is_oriented_outwards(model: Model):
    assert model.mesh.volume_m3 > 0.0


@pytest.mark.parametrize("model", FURNITURE, ids=lambda m: m.name)
def test_a_support_lies_on_the_model(model: Model):
    levels = model.mesh.vertices[:, 2]
    for support in model.supports:
        assert np.abs(levels - support.z).min() < 1e-9


@pytest.mark.parametrize(
    ("model", "low_m", "high_m"),
    [
        (furniture.table(), 0.71, 0.76),
        (furniture.desk(), 0.71, 0.76),
        (furniture.counter(), 0.86, 0.99),
        (furniture.chair(), 0.38, 0.48),
    ],
    ids=["table", "desk", "counter", "chair"],
)
def test_the_main_surface_has_the_usual_height(model: Model, low_m: float, high_m: float):
    assert low_m <= model.supports[0].z <= high_m


def test_the_boards_of_a_shelf_are_evenly_spaced():
    heights = [support.z for support in furniture.shelf(compartments=5).supports]
    steps = np.diff(heights)
    assert np.allclose(steps, steps[0])
    assert 0.30 <= steps[0] <= 0.35


def test_a_shelf_is_open_to_the_front_and_closed_at_the_back():
    shelf = furniture.shelf()
    facing = shelf.mesh.normals() @ np.array([1.0, 0.0, 0.0])
    a, b, c = (shelf.mesh.vertices[shelf.mesh.triangles[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    at_front = np.isclose(a[:, 0], shelf.mesh.bounds[1, 0]) & (facing > 0.99)
    at_back = np.isclose(a[:, 0], shelf.mesh.bounds[0, 0]) & (facing < -0.99)
    assert area[at_front].sum() < 0.2 * area[at_back].sum()


def test_the_back_of_a_chair_rises_behind_its_seat():
    mesh = furniture.chair().mesh
    high = mesh.vertices[mesh.vertices[:, 2] > 0.6]
    assert (high[:, 0] < -0.1).all()


def test_the_supports_of_a_mesh_are_found_without_being_told():
    table = furniture.table()
    (found,) = horizontal_supports(table.mesh)
    (told,) = table.supports
    assert (found.z, found.x_size, found.y_size) == pytest.approx(
        (told.z, told.x_size, told.y_size)
    )


def test_the_free_height_over_a_shelf_board_is_found():
    shelf = furniture.shelf()
    found = {round(s.z, 3): s.clearance for s in horizontal_supports(shelf.mesh)}
    for support in shelf.supports[:-1]:
        assert found[round(support.z, 3)] == pytest.approx(support.clearance, abs=1e-6)


@pytest.mark.parametrize("make", [tableware.fork, tableware.spoon, tableware.knife])
def test_cutlery_is_long_narrow_and_flat(make: Callable[[], Model]):
    x_size, y_size, z_size = make().mesh.size
    assert 0.17 < x_size < 0.23
    assert y_size < 0.045
    assert z_size < 0.03


def test_a_mug_points_its_handle_to_the_front():
    low, high = tableware.mug().mesh.bounds
    assert high[0] - 0.02 > -low[0]


@pytest.mark.parametrize(
    "make",
    [
        lambda: furniture.table(width=0.1),
        lambda: furniture.chair(height=0.5),
        lambda: furniture.shelf(height=0.5, compartments=9),
    ],
)
def test_impossible_furniture_is_refused(make: Callable[[], Model]):
    with pytest.raises(InvalidGeometry):
        make()
