"""A single image or a cloud is all there is: it is searched in one look."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from fluentboard.model.geometry import Transform
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.cad_library import CadLibrary
from fluentboard_modules.mapping.config import FurnitureMapConfig, MappingConfig
from fluentboard_modules.mapping.labelled import run_labelled
from fluentboard_modules.mapping.rules import FurnitureRules
from fluentboard_modules.mapping.single_look import look_at
from fluentboard_modules.mapping.surfaces import detect_regions
from fluentboard_modules.mapping.worker import MappingModule

Box = tuple[Sequence[float], Sequence[float]]
Render = Callable[..., SensorFrame]


def mapped(frames: Sequence[SensorFrame], config: MappingConfig | None = None) -> MappingModule:
    """A module that has come to the end of a recording."""
    module = MappingModule("recording", Transform.identity(), config)
    for frame in frames:
        module.process(frame)
    module.finish()
    return module


def test_one_image_of_a_table_is_enough(render: Render, table_boxes: list[Box]) -> None:
    module = mapped([render(table_boxes, width=320)])

    (table,) = module.furniture
    assert table.class_name == "Table"
    assert table.n_frames == 1
    assert table.placing_area is not None
    assert module.status() == "1 Table"


def test_two_images_show_one_table(render: Render, table_boxes: list[Box]) -> None:
    frames = [
        render(table_boxes, width=320, stamp_s=1.0),
        render(table_boxes, width=320, eye=(0.4, -0.5, 1.5), stamp_s=2.0),
    ]
    (table,) = mapped(frames).furniture

    assert table.class_name == "Table"
    assert table.frames_s == (1.0, 2.0)


def test_only_what_was_told_of_this_place_keeps_its_identifier(
    render: Render, table_boxes: list[Box], furniture_rules: FurnitureRules
) -> None:
    frame, config = render(table_boxes, width=320), MappingConfig()
    few = [(frame, detect_regions(frame, config.surfaces))]
    (table,) = look_at(few, furniture_rules, CadLibrary(), config).furniture
    pose = replace(table.box.pose, x=table.box.pose.x + 3.0)
    elsewhere = replace(table, box=replace(table.box, pose=pose))
    here = replace(table, identifier="table3")

    (found,) = look_at(few, furniture_rules, CadLibrary(), config, [elsewhere, here]).furniture
    (new,) = look_at(few, furniture_rules, CadLibrary(), config, [elsewhere]).furniture

    assert (table.identifier, found.identifier, new.identifier) == ("table1", "table3", "table2")


def test_with_memory_one_image_is_too_little(render: Render, table_boxes: list[Box]) -> None:
    config = MappingConfig(furniture=FurnitureMapConfig(look_frames=0))

    assert mapped([render(table_boxes, width=320)], config).furniture == []


def test_who_finds_nothing_says_what_came_nearest(render: Render) -> None:
    stool: Box = ((-0.7, 1.2, 0.57), (0.7, 2.0, 0.6))

    status = mapped([render([stool], width=320)]).status()

    assert status.startswith("nothing found (nearest: ")
    assert "height above the floor 0.60 m" in status


def test_one_labelled_image_is_rated_as_the_worker_maps_it(
    render: Render, furniture_rules: FurnitureRules, table_boxes: list[Box]
) -> None:
    frames = [render(table_boxes, width=320)]

    trial = run_labelled(frames, [], furniture_rules, CadLibrary(), MappingConfig())

    assert [piece.class_name for piece in trial.found] == ["Table"]
