"""Where chairs stand and from where a robot reaches tops."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fluentboard.model.fluent import Fluent
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.mapping.area_fluents import floor_areas
from fluentboard_modules.mapping.furniture_fluents import FurnitureFluents
from fluentboard_modules.mapping.furniture_item import CadFit, FurnitureItem
from fluentboard_modules.statements import Ending


def piece(class_name: str, sizes: tuple[float, float, float], yaw: float = 0.0) -> FurnitureItem:
    pose = Pose.from_rpy(2.0, 1.0, sizes[2], yaw=yaw)
    box = BoundingBox(Pose.from_rpy(2.0, 1.0, 0.5 * sizes[2], yaw=yaw), *sizes)
    return FurnitureItem(
        identifier=f"{class_name.lower()}1",
        class_name=class_name,
        pose=pose,
        box=box,
        placing_area=None if class_name == "Chair" else box,
        score=0.9,
        n_frames=5,
        n_direct=5,
        planes=(),
        rules=(),
        alternatives=(),
        first_seen_s=1.0,
        last_seen_s=3.0,
    )


def test_a_chair_stands_on_its_sitting_area() -> None:
    ((class_name, area),) = floor_areas(piece("Chair", (0.4, 0.5, 0.9)), 1)

    assert class_name == "SittingArea"
    assert (area.pose.x, area.pose.y, area.pose.z) == pytest.approx((2.0, 1.0, 0.0))
    assert area.sizes == pytest.approx([0.4, 0.5, 0.0])


def test_a_shelf_is_reached_from_its_front() -> None:
    ((class_name, area),) = floor_areas(piece("Shelf", (0.4, 0.9, 1.8), yaw=0.5 * np.pi), 1)

    assert class_name == "ManipulationArea"
    assert (area.pose.x, area.pose.y) == pytest.approx((2.0, 1.0 + 0.2 + 0.05 + 0.35))
    assert area.y_size == pytest.approx(0.9)


def test_a_table_is_reached_from_both_longer_sides() -> None:
    areas = floor_areas(piece("Table", (1.6, 0.8, 0.7)), 2)

    assert sorted(round(area.pose.y, 2) for _, area in areas) == [0.2, 1.8]


def test_areas_move_with_their_piece_and_end_with_it() -> None:
    state = FurnitureFluents(symmetry_order={"Table": 2})
    table = piece("Table", (1.6, 0.8, 0.7))
    state, first = state.update([table], 3.0)
    names = {s.name for s in first if isinstance(s, Fluent) and s.class_name == "ManipulationArea"}
    pose = replace(table.pose, x=3.0)
    moved = replace(table, pose=pose, box=replace(table.box, pose=replace(table.box.pose, x=3.0)))
    state, second = state.update([replace(moved, last_seen_s=9.0)], 9.0)
    _, third = state.update([], 12.0)

    assert names == {"manipulationAreaTable1_1", "manipulationAreaTable1_2"}
    assert "bBoxManipulationAreaTable1_1_0" in {s.name for s in second if isinstance(s, Ending)}
    assert names <= {s.name for s in third if isinstance(s, Ending)}


def test_board_is_told_the_model_and_how_sure_the_pose_is() -> None:
    fit = CadFit(
        "ikea_table",
        True,
        Pose(2.0, 1.0, 0.0),
        0.97,
        Pose(2.1, 1.0, 0.0),
        0.8,
        np.diag([1e-4, 1e-4, 4e-4]),
        5,
    )
    _, said = FurnitureFluents().update([replace(piece("Table", (1.6, 0.8, 0.7)), cad=fit)], 3.0)
    fluents = {s.name: s for s in said if isinstance(s, Fluent)}

    assert fluents["table1"].values("hasCadModel") == ("ikea_table",)
    assert fluents["table1"].values("hasFitScore") == (0.97,)
    assert fluents["poseTable1_0"].values("hasPositionDeviation") == (0.01,)
    assert fluents["poseTable1_0"].values("hasYawDeviation") == (0.02,)
