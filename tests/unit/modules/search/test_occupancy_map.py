"""The occupancy map: what a look does to it, what rays find in it, OctoMap as the oracle."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fluentboard.errors import InvalidGeometry, InvalidInput
from fluentboard.model.geometry import BoundingBox, FloatArray, Pose
from fluentboard_modules.search.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyMap
from fluentboard_modules.search.octomap_files import read_octomap, write_octomap

pyoctomap: Any = pytest.importorskip("pyoctomap")

ORIGIN = np.array([0.12, -0.07, 1.03])


def walls(rng: np.random.Generator, count: int = 4000) -> FloatArray:
    """Points on the inside of a wavy room around the origin."""
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    length = 1.5 + 0.4 * np.sin(3.0 * direction[:, 0]) + 0.3 * np.cos(5.0 * direction[:, 1])
    # Single precision, as OctoMap reads them: no point changes its cell by rounding.
    return (ORIGIN + length[:, None] * direction).astype(np.float32).astype(np.float64)


def octomap_of(points: FloatArray, origin: FloatArray, looks: int, range_m: float = -1.0) -> Any:
    tree = pyoctomap.OcTree(0.05)
    for _ in range(looks):
        tree.insertPointCloud(points, origin, range_m, True, True)
    tree.updateInnerOccupancy()
    return tree


@pytest.mark.parametrize("looks", [1, 3, 12])
def test_looks_give_the_log_odds_of_octomap(rng: np.random.Generator, looks: int) -> None:
    points = walls(rng)
    ours = OccupancyMap(0.05)
    for _ in range(looks):
        ours.integrate(points, ORIGIN)
    theirs = octomap_of(points, ORIGIN, looks)
    cells, values = ours.known_cells()
    different = 0
    for centre, value in zip(ours.centres(cells), values, strict=True):
        node = theirs.search(centre)
        different += node is None or abs(node.getLogOdds() - value) > 1e-5
    assert different == 0
    assert len(cells) > 30_000


@pytest.mark.parametrize("range_m", [-1.0, 1.6])
def test_a_sensor_that_moves_fills_the_cells_that_octomap_fills(
    rng: np.random.Generator, tmp_path: Path, range_m: float
) -> None:
    ours, theirs = OccupancyMap(0.05), pyoctomap.OcTree(0.05)
    for shift in ([0.0, 0.0, 0.0], [2.53, -1.31, 0.22], [-3.17, 0.64, 0.11]):
        origin = (ORIGIN + shift).astype(np.float32).astype(np.float64)
        points = (walls(rng, 3000) + shift).astype(np.float32).astype(np.float64)
        theirs.insertPointCloud(points, origin, range_m, False, True)
        image = np.full((2, 3000, 3), math.nan)  # as a camera has it: holes, and points twice
        image[0], image[1, ::3] = points, points[::3]
        ours.integrate(image, origin, max(0.0, range_m))
    theirs.write(str(tmp_path / "theirs.ot"))
    cells, values = read_octomap(tmp_path / "theirs.ot").known_cells()
    assert len(cells) == ours.known_count > 60_000
    np.testing.assert_array_equal(ours.log_odds_at(cells), values)


def test_a_look_that_is_too_wide_for_its_marks_leaves_the_map_as_it_was() -> None:
    ours = OccupancyMap(0.05)
    ours.integrate([[1.0, 0.0, 0.0]], [0.0, 0.0, 0.0])
    known = ours.known_count
    with pytest.raises(InvalidGeometry, match="range"):
        ours.integrate([[500.0, 500.0, 40.0]], [0.0, 0.0, 0.0])
    with pytest.raises(InvalidGeometry, match="absurdly far"):
        ours.integrate([[1.0, 0.0, 0.0]], [1e12, 0.0, 0.0])
    assert ours.known_count == known
    ours.integrate([[500.0, 500.0, 40.0]], [0.0, 0.0, 0.0], range_max_m=2.0)
    assert ours.known_count > known


def test_far_points_free_the_way_to_the_range_only() -> None:
    ours = OccupancyMap(0.1)
    ours.integrate([[5.05, 0.05, 0.05]], [0.05, 0.05, 0.05], range_max_m=2.0)
    assert len(ours.occupied_cells()) == 0
    assert ours.states(ours.cells_of([[1.95, 0.05, 0.05]])) == FREE
    assert ours.states(ours.cells_of([[2.25, 0.05, 0.05]])) == UNKNOWN


def test_points_of_another_country_free_the_way_to_the_range_too() -> None:
    near, far = OccupancyMap(0.05), OccupancyMap(0.05)
    directions = np.array([[0.3, 0.4, 0.1], [-0.5, 0.2, 0.3]])
    near.integrate(10.0 * directions, [0.0, 0.0, 0.0], range_max_m=2.0)
    far.integrate(1e6 * directions, [0.0, 0.0, 0.0], range_max_m=2.0)
    assert far.known_count == pytest.approx(near.known_count, abs=2)
    assert far.known_count > 60
    with pytest.raises(InvalidGeometry, match="limit"):
        far.integrate(1e6 * directions, [0.0, 0.0, 0.0])


@pytest.mark.parametrize("wrong", [math.nan, math.inf])
def test_rays_without_an_end_are_refused(wrong: float) -> None:
    with pytest.raises(InvalidGeometry, match="range"):
        OccupancyMap(0.05).cast_rays([0.0, 0.0, 0.0], [[1.0, 0.0, 0.0]], wrong)
    with pytest.raises(InvalidGeometry, match="zero"):
        OccupancyMap(0.05).cast_rays([0.0, 0.0, 0.0], [[0.0, 0.0, 0.0]], 1.0)


def test_points_without_depth_change_nothing() -> None:
    ours = OccupancyMap(0.1)
    assert ours.integrate([[math.nan, 0.0, 1.0], [math.inf, 0.0, 0.0]], [0.0, 0.0, 0.0]) == 0
    assert ours.known_count == 0


def test_a_hit_wins_over_the_rays_that_pass_through_its_cell() -> None:
    ours = OccupancyMap(0.1)
    ours.integrate([[1.05, 0.05, 0.05], [2.05, 0.05, 0.05]], [0.05, 0.05, 0.05])
    assert ours.states(ours.cells_of([[1.05, 0.05, 0.05]])) == OCCUPIED


def test_a_map_that_would_span_a_country_is_refused() -> None:
    with pytest.raises(InvalidGeometry, match="range"):
        OccupancyMap(0.01).integrate([[1e5, 1e5, 1e5]], [0.0, 0.0, 0.0])
    with pytest.raises(InvalidInput, match="positive side"):
        OccupancyMap(0.0)


def test_rays_meet_what_octomap_meets(rng: np.random.Generator) -> None:
    points = walls(rng)
    ours = OccupancyMap(0.05)
    ours.integrate(points, ORIGIN)
    theirs = octomap_of(points, ORIGIN, 1)
    directions = rng.normal(size=(2000, 3))
    hits = ours.cast_rays(ORIGIN, directions, 4.0)
    centres = ours.centres(hits.cells)
    agree = 0
    for n, direction in enumerate(directions):
        end = np.zeros(3)
        hit = theirs.castRay(ORIGIN, direction, end, True, 4.0)
        same = not hit or bool(np.allclose(end, centres[n], atol=1e-3))
        agree += bool(hit == hits.is_hit[n]) and same
    assert agree >= 1998  # a ray through an edge may pass it on either side
    assert hits.is_hit.mean() > 0.4


def test_a_ray_stops_at_the_unknown_if_that_is_not_transparent() -> None:
    ours = OccupancyMap(0.1)
    ours.integrate([[1.05, 0.05, 0.05]], [0.05, 0.05, 0.05])
    ray = ([0.05, 0.05, 0.05], [[0.0, 1.0, 0.0]], 3.0)
    assert ours.cast_rays(*ray, ignore_unknown=False).is_unknown.all()
    through = ours.cast_rays(*ray)
    assert not through.is_unknown.any()
    assert not through.is_hit.any()


def test_a_volume_can_be_forgotten_with_or_without_what_stands_there() -> None:
    ours = OccupancyMap(0.1)
    ours.integrate([[1.05, 0.05, 0.05]], [0.05, 0.05, 0.05])
    turned = BoundingBox(Pose.from_rpy(0.8, 0.05, 0.05, yaw=0.3), 0.9, 0.2, 0.2)
    kept = ours.copy()
    assert kept.reset(turned, keep_occupied=True) > 0
    assert len(kept.occupied_cells()) == 1
    assert ours.reset(turned) > 0
    assert len(ours.occupied_cells()) == 0
    assert ours.states(ours.cells_of([[0.15, 0.05, 0.05]])) == FREE


def test_knowledge_fades_to_unknown_unless_it_is_renewed() -> None:
    ours = OccupancyMap(0.1)
    for _ in range(5):
        ours.integrate([[1.05, 0.05, 0.05]], [0.05, 0.05, 0.05])
    known = ours.known_count
    assert ours.fade(10.0, half_life_s=60.0) == 0
    ours.fade(600.0, half_life_s=60.0)
    assert known > 5
    assert ours.known_count == 0


@pytest.mark.parametrize("suffix", [".bt", ".ot"])
def test_maps_travel_to_octomap_and_back(
    rng: np.random.Generator, tmp_path: Path, suffix: str
) -> None:
    ours = OccupancyMap(0.05)
    points = walls(rng, 800)
    ours.integrate(points, ORIGIN)
    ours.set_cells(ours.cells_in(BoundingBox(Pose(5.0, 5.0, 1.0), 1.6, 1.6, 1.6)), -0.5)
    path = tmp_path / f"room{suffix}"
    write_octomap(ours, path)
    theirs = pyoctomap.OcTree(0.3)
    assert theirs.readBinary(str(path)) if suffix == ".bt" else True
    if suffix == ".ot":
        theirs = theirs.read(str(path))
    assert theirs.getResolution() == pytest.approx(0.05)
    cells, values = ours.known_cells()
    for centre, value in zip(ours.centres(cells[::17]), values[::17], strict=True):
        node = theirs.search(centre)
        assert node is not None
        assert theirs.isNodeOccupied(node) == (value >= 0.0)
        if suffix == ".ot":
            assert node.getLogOdds() == pytest.approx(float(value), abs=1e-6)
    again = tmp_path / f"again{suffix}"
    write_octomap(read_octomap(path), again)
    assert again.read_bytes() == path.read_bytes()
    assert read_octomap(path).known_count == ours.known_count


def test_a_map_of_octomap_is_read_and_written_byte_by_byte(tmp_path: Path) -> None:
    tree = octomap_of(walls(np.random.default_rng(3)), ORIGIN, 2)
    tree.toMaxLikelihood()
    tree.writeBinary(str(tmp_path / "theirs.bt"))
    write_octomap(read_octomap(tmp_path / "theirs.bt"), tmp_path / "ours.bt")
    theirs, ours = (
        (tmp_path / f"{who}.bt").read_bytes().partition(b"\nid OcTree")[2]
        for who in ("theirs", "ours")
    )
    assert ours == theirs


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"ply\n", "not an OctoMap file"),
        (b"# Octomap OcTree binary file\nid OcTree\nsize 9\nres 0.1\ndata\n\xff", "truncated"),
        (b"# Octomap OcTree file\nid ColorOcTree\nsize 1\nres 0.1\ndata\n12345", "ColorOcTree"),
        (b"# Octomap OcTree file\nid OcTree\nsize x\nres 0.1\ndata\n12345", "resolution and size"),
    ],
)
def test_files_that_are_no_maps_are_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "map.bt"
    path.write_bytes(content)
    with pytest.raises(InvalidInput, match=message):
        read_octomap(path)


def test_an_empty_map_is_a_file_too(tmp_path: Path) -> None:
    write_octomap(OccupancyMap(0.1), tmp_path / "empty.ot")
    assert read_octomap(tmp_path / "empty.ot").known_count == 0
    with pytest.raises(InvalidInput, match=r"\.bt or \.ot"):
        write_octomap(OccupancyMap(0.1), tmp_path / "map.txt")


def test_a_real_kitchen_is_read(shared_data: Path) -> None:
    kitchen = read_octomap(shared_data / "octomaps" / "tum_kitchen_octomap.bt")
    assert kitchen.resolution_m == 0.05
    assert kitchen.known_count == 1_777_880
