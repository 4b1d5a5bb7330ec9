"""Occupancy maps: looks do what OctoMap's do, rays end where each border crossed says."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fluentboard.model.geometry import BoundingBox, FloatArray, Pose
from fluentboard_modules.search.occupancy import CellArray, OccupancyMap
from fluentboard_modules.search.octomap_files import read_octomap

pyoctomap: Any = pytest.importorskip("pyoctomap")

SEEDS = st.integers(0, 10_000)


def random_cloud(rng: np.random.Generator, count: int, range_m: float) -> FloatArray:
    """Walls, strewn points, repetitions and holes, in single precision as OctoMap reads them."""
    origin = rng.uniform(-3.0, 3.0, 3)
    direction = rng.normal(size=(count, 3))
    direction[: count // 4, rng.integers(3)] = 0.0  # parallel to a face of the cells
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    length = rng.uniform(0.05, range_m, count)
    length[count // 2 :] = range_m * (0.6 + 0.2 * np.sin(4.0 * direction[count // 2 :, 0]))
    points = origin + length[:, None] * direction
    points = np.concatenate([np.repeat(points, 3, axis=0), points[::-1]])
    holes = rng.integers(0, len(points), len(points) // 5)
    points[holes, rng.integers(0, 3, len(holes))] = rng.choice([math.nan, math.inf, -math.inf])
    return np.concatenate([origin[None], points]).astype(np.float32).astype(np.float64)


@given(
    SEEDS,
    st.sampled_from([0.02, 0.05, 0.11]),
    st.sampled_from([0.0, 0.7]),
    st.integers(1, 3),
)
@settings(max_examples=15, deadline=None)
def test_random_looks_give_the_cells_and_log_odds_of_octomap(
    seed: int, resolution_m: float, range_m: float, looks: int
) -> None:
    rng = np.random.default_rng(seed)
    ours, theirs = OccupancyMap(resolution_m), pyoctomap.OcTree(resolution_m)
    for _ in range(looks):
        origin, *points = random_cloud(rng, int(rng.integers(0, 300)), 40.0 * resolution_m)
        cloud = np.array(points).reshape(-1, 3)
        updated = ours.integrate(cloud, origin, range_m)
        assert updated <= ours.known_count
        finite = cloud[np.isfinite(cloud).all(axis=1)]
        theirs.insertPointCloud(finite, origin, range_m or -1.0, False, True)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "theirs.ot"
        theirs.write(str(path))
        cells, values = read_octomap(path).known_cells()
    assert len(cells) == ours.known_count
    np.testing.assert_array_equal(ours.log_odds_at(cells), values)


def random_map(rng: np.random.Generator) -> OccupancyMap:
    """Cells strewn over a few blocks, some of them full, some of them known all over."""
    occupancy = OccupancyMap(0.05)
    free = rng.integers(-14, 15, (int(rng.integers(1, 1500)), 3))
    occupancy.set_cells(free, -0.4)
    occupancy.set_cells(free[: int(rng.integers(0, 40))], 0.85)
    box = BoundingBox(Pose(*rng.uniform(-0.7, 0.7, 3)), 0.4, 0.5, 0.6)
    occupancy.set_cells(occupancy.cells_in(box), float(rng.choice([-0.4, 0.85])))
    return occupancy


def crossed(origin: FloatArray, direction: FloatArray, reach_m: float) -> CellArray:
    """Cells along a ray, by sorting all borders that it crosses."""
    unit = direction / np.linalg.norm(direction)
    at = [0.0, reach_m]
    for axis in np.flatnonzero(unit):
        ends = sorted([origin[axis], origin[axis] + reach_m * unit[axis]])
        borders = range(math.floor(ends[0] / 0.05), math.ceil(ends[1] / 0.05) + 1)
        along = [float((0.05 * border - origin[axis]) / unit[axis]) for border in borders]
        at += [length for length in along if 0.0 < length < reach_m]
    lengths = np.sort(at)
    middle = 0.5 * (lengths[1:] + lengths[:-1])[np.diff(lengths) > 1e-9]
    return np.floor((origin + middle[:, None] * unit) / 0.05).astype(np.int64)


@given(SEEDS, st.booleans())
@settings(max_examples=40, deadline=None)
def test_a_ray_ends_in_the_first_cell_crossed_that_stops_it(
    seed: int, ignore_unknown: bool
) -> None:
    rng = np.random.default_rng(seed)
    occupancy = random_map(rng)
    origins = rng.uniform(-1.0, 1.0, (20, 3))
    directions = rng.normal(size=(20, 3))
    directions[:8, rng.integers(3)] = 0.0
    directions[0] = [0.0, 0.0, -1.0]
    hits = occupancy.cast_rays(origins, directions, 2.0, ignore_unknown)
    for n in range(20):
        cells = crossed(origins[n], directions[n], 2.0)
        values = occupancy.log_odds_at(cells)
        stops = values >= 0.0
        if not ignore_unknown:
            stops |= np.isnan(values)
        assert bool(hits.is_hit[n] or hits.is_unknown[n]) == bool(stops.any())
        if stops.any():
            first = int(stops.argmax())
            np.testing.assert_array_equal(hits.cells[n], cells[first])
            assert hits.is_unknown[n] == np.isnan(values[first])
        else:
            assert hits.length_m[n] > 2.0


def bits(log_odds: NDArray[np.float32], stops_at_unknown: bool) -> NDArray[np.uint64]:
    """What `RayStops.cells` should be."""
    stops = log_odds >= 0.0
    if stops_at_unknown:
        stops |= np.isnan(log_odds)
    return np.packbits(stops.reshape(-1, 8, 64), axis=2, bitorder="little").view("<u8")[..., 0]


@given(SEEDS, st.lists(st.sampled_from(["look", "set", "reset", "fade"]), max_size=5))
@settings(max_examples=25, deadline=None)
def test_what_rays_stop_at_is_up_to_date_after_every_change(seed: int, changes: list[str]) -> None:
    rng = np.random.default_rng(seed)
    occupancy = random_map(rng)
    for change in ["", *changes]:
        if change == "look":
            origin, *points = random_cloud(rng, 30, 1.0)
            occupancy.integrate(np.array(points), origin)
        elif change == "set":
            occupancy.set_cells(rng.integers(-20, 20, (20, 3)), float(rng.choice([-0.4, 0.85])))
        elif change == "reset":
            occupancy.reset(BoundingBox(Pose(*rng.uniform(-0.7, 0.7, 3)), 0.4, 0.5, 0.6))
        elif change == "fade":
            occupancy.fade(60.0, 40.0)
        for ignore_unknown in (True, False):
            stops = occupancy.ray_stops(ignore_unknown)
            expected = bits(occupancy.log_odds, not ignore_unknown)
            np.testing.assert_array_equal(stops.cells, expected)
            has_block = occupancy.directory >= 0
            blocks = occupancy.directory[has_block]
            met = np.where(np.any(expected, axis=1)[blocks], blocks, -1)
            np.testing.assert_array_equal(stops.meetings[has_block], met)
            assert (stops.meetings[~has_block] == (-1 if ignore_unknown else -2)).all()
