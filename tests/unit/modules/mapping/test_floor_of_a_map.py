"""The floor under a map: where heights count from."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.config import SurfacesConfig
from fluentboard_modules.mapping.floor import level_surfaces, sloping_floor, survey_floor
from fluentboard_modules.mapping.planar_region import PlanarRegion

MakePlane = Callable[..., PlanarRegion]
Render = Callable[..., SensorFrame]


def test_a_survey_finds_the_floor_under_a_table(render: Render, table_boxes: object) -> None:
    floor = survey_floor([render(table_boxes)], SurfacesConfig())

    assert floor is not None
    assert floor.height_m == pytest.approx(0.0, abs=0.01)
    assert floor.n_frames == 1


def test_a_survey_of_nothing_finds_no_floor(render: Render) -> None:
    assert survey_floor([render([], floor=False)], SurfacesConfig()) is None


def test_only_level_surfaces_may_be_floor(make_plane: MakePlane) -> None:
    planes = [
        make_plane((0.0, 0.0, 0.0)),
        make_plane((0.0, 0.0, 2.4), (0.0, 0.0, -1.0)),  # a ceiling
        make_plane((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),  # a wall
        make_plane((0.0, 0.0, 0.3), (0.3, 0.0, 1.0)),  # a ramp
    ]

    assert len(level_surfaces(planes).centres) == 1


def test_the_lowest_point_of_a_wall_bounds_the_floor(make_plane: MakePlane) -> None:
    wall = make_plane((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (2.0, 2.0))

    assert level_surfaces([wall]).lowest_m == pytest.approx(0.0, abs=1e-9)


def test_a_level_floor_is_level(make_plane: MakePlane) -> None:
    floor = sloping_floor([make_plane((0.0, 0.0, 0.0), size=(3.0, 3.0))], 0.15)

    assert floor is not None
    assert np.allclose(floor.normal, (0.0, 0.0, 1.0))
    assert floor.offset_m == pytest.approx(0.0, abs=1e-9)


def test_a_floor_that_rises_is_followed(make_plane: MakePlane) -> None:
    rise = 0.03
    patches = [
        make_plane((x, 0.0, rise * x), (-rise, 0.0, 1.0), (0.8, 0.8))
        for x in (-2.0, -1.0, 1.0, 2.0)
    ]

    floor = sloping_floor(patches, 0.15)

    assert floor is not None
    assert floor.signed_distance(np.array([[2.0, 0.0, 0.7]]))[0] == pytest.approx(0.64, abs=0.01)


def test_tables_are_no_floor(make_plane: MakePlane) -> None:
    assert sloping_floor([make_plane((0.0, 0.0, 0.72))], 0.15) is None
    assert sloping_floor([], 0.15) is None
