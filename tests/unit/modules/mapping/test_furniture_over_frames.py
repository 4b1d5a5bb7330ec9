"""Many frames, one piece of furniture: it appears once, keeps its name, goes when it is gone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.candidates import Stand, share_a_place
from fluentboard_modules.mapping.config import FurnitureMapConfig, SurfacesConfig
from fluentboard_modules.mapping.furniture_item import CadFit, FurnitureChange, FurnitureItem
from fluentboard_modules.mapping.furniture_map import FurnitureMap
from fluentboard_modules.mapping.rules import FurnitureRules
from fluentboard_modules.mapping.surfaces import detect_regions

SURFACES = SurfacesConfig()
WALL = ((-3.0, 3.2, 0.0), (3.0, 3.3, 2.5))
Render = Callable[..., SensorFrame]


def watch(
    room: FurnitureMap, frames: Sequence[SensorFrame], rules: FurnitureRules
) -> list[FurnitureChange]:
    changes: list[FurnitureChange] = []
    for frame in frames:
        regions = detect_regions(frame, SURFACES)
        changes += room.update(frame, regions, rules.classify(regions, explain=False))
    return changes


def only(room: FurnitureMap, class_name: str) -> FurnitureItem:
    (item,) = (item for item in room.furniture() if item.class_name == class_name)
    return item


def around(render: Render, boxes: Any, n_frames: int, **options: Any) -> list[SensorFrame]:
    """Views from a path in front of the boxes, poses a centimetre or two off."""
    rng = np.random.default_rng(5)
    frames: list[SensorFrame] = []
    for k, x in enumerate(np.linspace(-0.4, 0.4, n_frames)):
        eye = np.array([x, -0.5, 1.4])
        drift = rng.normal(0.0, 0.01, 3)
        frame = render([*boxes, WALL], eye=eye, stamp_s=1.0 + k, noise=rng, **options)
        pose = type(frame.T_map_sensor).from_parts(frame.T_map_sensor.rotation, eye + drift)
        frames.append(SensorFrame(frame.depth_m, frame.camera, frame.stamp_s, pose))
    return frames


@pytest.fixture(scope="module")
def table_seen(
    render: Render, table_boxes: Any, furniture_rules: FurnitureRules
) -> tuple[FurnitureMap, list[FurnitureChange]]:
    room = FurnitureMap(furniture_rules)
    changes = watch(room, around(render, table_boxes, 14), furniture_rules)
    return room, changes


def test_a_table_in_many_frames_is_one_table(
    table_seen: tuple[FurnitureMap, list[FurnitureChange]],
) -> None:
    room, changes = table_seen

    assert [item.class_name for item in room.furniture()] == ["Table"]
    assert [c.kind for c in changes if c.kind != "changed"] == ["appeared"]


def test_its_place_and_size_are_those_of_the_table(
    table_seen: tuple[FurnitureMap, list[FurnitureChange]],
) -> None:
    table = only(table_seen[0], "Table")

    assert (table.pose.x, table.pose.y) == pytest.approx((0.0, 1.6), abs=0.03)
    assert table.pose.z == pytest.approx(0.72, abs=0.02)
    # At this resolution a cell on the far edge is 0.1 m deep.
    assert table.box.sizes == pytest.approx([1.4, 0.8, 0.72], abs=0.12)
    assert table.placing_area is not None
    assert table.placing_area.pose.z > 0.72


def test_its_evidence_is_told(table_seen: tuple[FurnitureMap, list[FurnitureChange]]) -> None:
    table = only(table_seen[0], "Table")

    assert table.n_frames == 14
    assert table.n_direct >= 10
    assert table.score > 0.6  # all from one side
    assert table.rules == ("TablePlaneRule",)
    assert table.planes[0].label == "TablePlane"
    assert "Desk" in table.alternatives
    assert table.first_seen_s < table.last_seen_s == 14.0


def test_nothing_is_furniture_after_one_look(
    render: Render, table_boxes: Any, furniture_rules: FurnitureRules
) -> None:
    room = FurnitureMap(furniture_rules)

    assert watch(room, [render(table_boxes)], furniture_rules) == []
    assert room.furniture() == []


def test_a_chair_needs_several_frames(
    render: Render, chair_boxes: Any, furniture_rules: FurnitureRules
) -> None:
    room = FurnitureMap(furniture_rules)
    frames = around(render, chair_boxes, 8, width=320)

    early = watch(room, frames[:3], furniture_rules)
    late = watch(room, frames[3:], furniture_rules)

    assert early == []
    assert late[0].kind == "appeared"
    chair = only(room, "Chair")
    assert (chair.pose.x, chair.pose.y) == pytest.approx((0.0, 1.92), abs=0.06)
    assert chair.pose.yaw_rad == pytest.approx(-0.5 * np.pi, abs=0.1)
    assert chair.placing_area is None


def test_halves_seen_in_different_frames_make_one_table(
    render: Render, table_boxes: Any, furniture_rules: FurnitureRules
) -> None:
    room = FurnitureMap(furniture_rules)
    left = [render(table_boxes, eye=(-0.6, 0.3, 1.4), target=(-0.6, 1.6, 0.7)) for _ in range(6)]
    right = [render(table_boxes, eye=(0.6, 0.3, 1.4), target=(0.6, 1.6, 0.7)) for _ in range(6)]

    watch(room, left, furniture_rules)
    part = only(room, "Table")
    watch(room, right, furniture_rules)
    whole = only(room, "Table")

    assert whole.identifier == part.identifier
    assert part.box.x_size < 1.35
    assert whole.box.x_size == pytest.approx(1.4, abs=0.06)


def test_a_table_that_is_carried_away_disappears(
    render: Render, table_boxes: Any, furniture_rules: FurnitureRules
) -> None:
    room = FurnitureMap(furniture_rules)
    watch(room, around(render, table_boxes, 7), furniture_rules)
    assert only(room, "Table")

    changes = watch(room, around(render, [], 26), furniture_rules)

    assert [c.kind for c in changes if c.kind != "changed"] == ["disappeared"]
    assert room.furniture() == []


def test_a_table_out_of_sight_stays(
    render: Render, table_boxes: Any, furniture_rules: FurnitureRules
) -> None:
    room = FurnitureMap(furniture_rules)
    watch(room, around(render, table_boxes, 7), furniture_rules)

    away = [render([], target=(0.0, -3.0, 0.3)) for _ in range(12)]

    assert [c.kind for c in watch(room, away, furniture_rules) if c.kind != "changed"] == []
    assert only(room, "Table").identifier == "table1"


def test_a_table_behind_a_screen_stays(
    render: Render, table_boxes: Any, furniture_rules: FurnitureRules
) -> None:
    room = FurnitureMap(furniture_rules)
    watch(room, around(render, table_boxes, 7), furniture_rules)
    screen = ((-2.0, 0.6, 0.0), (2.0, 0.65, 2.5))

    watch(room, around(render, [screen], 12), furniture_rules)

    assert only(room, "Table")


def test_the_same_frames_give_the_same_furniture(
    render: Render, table_boxes: Any, furniture_rules: FurnitureRules
) -> None:
    frames = around(render, table_boxes, 8)
    first, second = FurnitureMap(furniture_rules), FurnitureMap(furniture_rules)
    watch(first, frames, furniture_rules)
    watch(second, frames, furniture_rules)

    assert [(i.identifier, i.pose, i.box) for i in first.furniture()] == [
        (i.identifier, i.pose, i.box) for i in second.furniture()
    ]


def test_empty_frames_do_no_harm(render: Render, furniture_rules: FurnitureRules) -> None:
    room = FurnitureMap(furniture_rules)

    assert watch(room, [render([], floor=False) for _ in range(3)], furniture_rules) == []
    assert room.classified_planes()[1] == []


def test_the_threshold_for_furniture_is_configurable(
    render: Render, table_boxes: Any, furniture_rules: FurnitureRules
) -> None:
    eager = FurnitureMapConfig(accept_score=0.3, drop_score=0.1)
    room = FurnitureMap(furniture_rules, eager)

    watch(room, around(render, table_boxes, 3), furniture_rules)

    assert [item.class_name for item in room.furniture()] == ["Table"]


def test_only_a_chair_may_stand_where_another_piece_stands(furniture_rules: FurnitureRules) -> None:
    config, classes = FurnitureMapConfig(), furniture_rules.rules.furniture

    def stand(class_name: str, x: float, size: float) -> Stand:
        pose = Pose(x, 0.0, 0.4)
        fit = CadFit("model", True, pose, 0.9, pose, 0.9, np.eye(3), 1)
        return Stand(classes[class_name], BoundingBox(pose, size, size, 0.8), fit)

    table, chair = stand("Table", 0.0, 1.0), stand("Chair", 0.1, 0.5)
    assert not share_a_place(table, chair, config)
    assert share_a_place(table, stand("Shelf", 0.6, 0.5), config)
    assert share_a_place(table, stand("Table", 0.8, 1.0), config)
    assert not share_a_place(table, stand("Table", 0.9, 1.0), config)  # poses are off by so much
