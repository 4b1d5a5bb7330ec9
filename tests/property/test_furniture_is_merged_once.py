"""However a table is cut up by views and shaken by poses, it is one table; two tables are two."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import MultiPolygon, box

from fluentboard.model.geometry import Transform
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.mapping.furniture_map import FurnitureMap
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.rules import load_rules
from fluentboard_ontology import read

RULES = load_rules(read("furniture"))
CAMERA = Camera(4, 3, 4.0, 4.0, 2.0, 1.5)
LENGTH, WIDTH, HEIGHT = 2.0, 0.8, 0.72


def blind_frame(number: int) -> SensorFrame:
    """A frame that shows nothing: the regions are given, and nothing is seen through."""
    return SensorFrame(np.zeros((3, 4), np.float32), CAMERA, 1.0 + number, Transform.identity())


def view(start: float, stop: float, drift: Sequence[float], origin: float = 0.0) -> PlanarRegion:
    """The part of a table top between two places along its length, displaced by a bad pose."""
    middle = 0.5 * (start + stop)
    return PlanarRegion(
        index=0,
        T_map_region=Transform.from_parts(
            np.eye(3), np.array([origin + middle, 0.0, HEIGHT]) + np.asarray(drift)
        ),
        contour=MultiPolygon([box(start - middle, -0.5 * WIDTH, stop - middle, 0.5 * WIDTH)]),
        n_points=1000,
        rms_m=0.003,
        sensor_position=np.array([origin + middle, -1.5, 1.4]),
    )


drifts = st.tuples(st.floats(-0.02, 0.02), st.floats(-0.02, 0.02), st.floats(-0.02, 0.02))
# Each view overlaps the middle of the table, so that they hang together.
views = st.lists(
    st.tuples(st.floats(0.0, 0.7), st.floats(1.3, LENGTH), drifts), min_size=8, max_size=16
)


def tables_after(frames: Sequence[Sequence[PlanarRegion]]) -> FurnitureMap:
    room = FurnitureMap(RULES)
    for number, regions in enumerate(frames):
        room.update(blind_frame(number), regions)
    return room


@settings(max_examples=25)
@given(views)
def test_one_table_in_many_views_is_one_table(
    seen: list[tuple[float, float, tuple[float, float, float]]],
) -> None:
    room = tables_after([[view(*one)] for one in seen])

    (table,) = room.furniture()
    assert table.class_name == "Table"
    assert table.n_frames == len(seen)
    assert abs(table.pose.z - HEIGHT) < 0.02
    low, high = min(one[0] for one in seen), max(one[1] for one in seen)
    x_low, x_high = table.box.corners()[:, 0].min(), table.box.corners()[:, 0].max()
    # Never more than was seen, give or take drift and the grid.
    assert x_low > low - 0.06
    assert x_high < high + 0.06
    # And never less than what all have seen.
    assert x_low < max(one[0] for one in seen) + 0.06
    assert x_high > min(one[1] for one in seen) - 0.06


@settings(max_examples=15)
@given(views, st.permutations(range(8)))
def test_the_order_of_the_views_does_not_matter(
    seen: list[tuple[float, float, tuple[float, float, float]]], order: list[int]
) -> None:
    seen = seen[:8]
    (there,) = tables_after([[view(*one)] for one in seen]).furniture()
    (back,) = tables_after([[view(*seen[k])] for k in order]).furniture()

    assert there.identifier == back.identifier
    # Every end was seen up to 2 cm off to either side, and the grid has cells of 1 cm.
    assert np.allclose(there.box.sizes, back.box.sizes, atol=0.10)
    assert abs(there.pose.x - back.pose.x) < 0.05
    assert abs(there.pose.y - back.pose.y) < 0.05


@settings(max_examples=15)
@given(views, st.floats(0.3, 2.0))
def test_two_tables_stay_two(
    seen: list[tuple[float, float, tuple[float, float, float]]], gap: float
) -> None:
    frames = [[view(*one), view(*one, origin=LENGTH + gap)] for one in seen]
    room = tables_after(frames)

    assert [item.identifier for item in room.furniture()] == ["table1", "table2"]


@settings(max_examples=15)
@given(views)
def test_every_piece_appears_before_it_changes_and_once(
    seen: list[tuple[float, float, tuple[float, float, float]]],
) -> None:
    room = FurnitureMap(RULES)
    known: set[str] = set()
    for number, one in enumerate(seen):
        for change in room.update(blind_frame(number), [view(*one)]):
            name = change.item.identifier
            assert (change.kind == "appeared") == (name not in known)
            known.add(name)
            assert 0.0 <= change.item.score <= 1.0
    assert known == {item.identifier for item in room.furniture()}
