"""Which way is up, and where the floor is."""

from __future__ import annotations

import numpy as np
import pytest

from fluentboard.errors import InvalidGeometry
from fluentboard_modules.frames.gravity import (
    FloorCandidates,
    align_with_gravity,
    find_floor,
    place_in_map,
)

DOWN = np.array([0.0, 0.0, -1.0])


def surfaces(
    *heights_and_areas: tuple[float, float], lowest_m: float | None = None
) -> FloorCandidates:
    heights = [height for height, _ in heights_and_areas]
    return FloorCandidates(
        centres=np.array([[0.0, 0.0, height] for height in heights]).reshape(-1, 3),
        areas_m2=np.array([area for _, area in heights_and_areas]),
        lowest_m=min(heights, default=np.inf) if lowest_m is None else lowest_m,
    )


@pytest.mark.parametrize(
    "gravity", [(0.0, 0.9, 0.4), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)]
)
def test_gravity_points_down_in_the_upright_frame(gravity: tuple[float, float, float]) -> None:
    T_upright_world = align_with_gravity(np.array(gravity))

    assert np.allclose(T_upright_world.rotate(np.array(gravity) / np.linalg.norm(gravity)), DOWN)


def test_the_rotation_is_the_smallest_one() -> None:
    gravity = np.array([0.3, 0.0, -1.0])
    rotation = align_with_gravity(gravity).rotation

    angle = np.arccos(0.5 * (np.trace(rotation) - 1.0))
    assert angle == pytest.approx(np.arctan(0.3))


def test_without_gravity_z_is_taken_to_be_up() -> None:
    assert np.allclose(align_with_gravity(None).matrix, np.eye(4))


@pytest.mark.parametrize("gravity", [(0.0, 0.0, 0.0), (np.nan, 0.0, 1.0)])
def test_a_gravity_without_direction_is_refused(gravity: tuple[float, float, float]) -> None:
    with pytest.raises(InvalidGeometry, match="is no direction"):
        align_with_gravity(np.array(gravity))


def test_the_floor_is_at_zero_in_the_map() -> None:
    gravity = np.array([0.0, 1.0, 0.0])  # y points down, as in an optical frame

    T_map_world = place_in_map(gravity, floor_height_m=-1.4)

    assert T_map_world.apply(np.array([0.5, 1.4, 2.0]))[2] == pytest.approx(0.0)


def test_the_floor_is_the_lowest_surface_seen_often() -> None:
    floor = find_floor([surfaces((-1.4, 0.5), (-0.7, 1.0)) for _ in range(5)])

    assert floor is not None
    assert floor.height_m == pytest.approx(-1.4, abs=0.005)
    assert floor.n_frames == 5


def test_a_reflection_below_the_floor_is_no_floor() -> None:
    frames = [surfaces((-1.4, 0.8)) for _ in range(10)]
    frames[3] = surfaces((-1.4, 0.8), (-2.3, 0.05))

    floor = find_floor(frames)

    assert floor is not None
    assert floor.height_m == pytest.approx(-1.4, abs=0.005)


def test_frames_without_the_floor_do_not_raise_it() -> None:
    frames = [surfaces((-0.7, 1.0)) for _ in range(10)] + [surfaces((-1.4, 0.9))] * 3

    floor = find_floor(frames)

    assert floor is not None
    assert floor.height_m == pytest.approx(-1.4, abs=0.005)


def test_a_surface_with_legs_below_it_is_no_floor() -> None:
    floor = find_floor([surfaces((-0.7, 1.0), lowest_m=-1.38) for _ in range(5)])

    assert floor is not None
    assert floor.height_m == pytest.approx(-1.38)
    assert floor.n_frames == 0


def test_the_floor_is_robust_against_drifting_poses(rng: np.random.Generator) -> None:
    frames = [surfaces((-1.4 + rng.normal(0.0, 0.02), 0.5), (-0.68, 0.5)) for _ in range(30)]

    floor = find_floor(frames)

    assert floor is not None
    assert floor.height_m == pytest.approx(-1.4, abs=0.01)


def test_a_sloping_floor_is_taken_where_the_furniture_stands() -> None:
    slope = 0.03  # gravity 1.7 degrees off
    places = np.linspace(0.0, 3.0, 7)
    patches = np.column_stack([places, np.zeros(7), -1.4 + slope * places])
    table = np.array([[2.5, 0.0, -0.6]])
    frame = FloorCandidates(np.concatenate([patches, table]), np.full(8, 0.5), -1.4)

    floor = find_floor([frame] * 5)

    assert floor is not None
    assert floor.slope_x == pytest.approx(slope, abs=0.005)
    assert floor.height_m == pytest.approx(-1.4 + slope * 2.5, abs=0.01)
    assert floor.anchor[0] == pytest.approx(2.5)


def test_nothing_seen_is_no_floor() -> None:
    assert find_floor([]) is None
    assert find_floor([surfaces()]) is None
