"""Pictures of planes and furniture are drawn for whatever there is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from matplotlib.figure import Figure

from fluentboard.model.geometry import BoundingBox, Pose, Transform
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.furniture_item import FurnitureItem, FurniturePlane
from fluentboard_modules.mapping.picture_overlay import draw_overlay
from fluentboard_modules.mapping.picture_plan import draw_plan
from fluentboard_modules.mapping.picture_style import save_picture
from fluentboard_modules.mapping.planar_region import PlanarRegion

MakePlane = Callable[..., PlanarRegion]
Render = Callable[..., SensorFrame]


def table_of(top: PlanarRegion) -> FurnitureItem:
    return FurnitureItem(
        identifier="table1",
        class_name="Table",
        pose=Pose.from_rpy(0.0, 1.6, 0.72),
        box=BoundingBox(Pose.from_rpy(0.0, 1.6, 0.36), 1.4, 0.8, 0.72),
        placing_area=None,
        score=0.9,
        n_frames=9,
        n_direct=5,
        planes=(FurniturePlane(top.index, "TablePlane", top, 9),),
        rules=("TablePlaneRule",),
        alternatives=(),
        first_seen_s=1.0,
        last_seen_s=2.0,
    )


def words_in(figure: Figure) -> str:
    return " ".join(text.get_text() for axes in figure.axes for text in axes.texts)


def test_a_plan_names_the_furniture(make_plane: MakePlane) -> None:
    top = make_plane((0.0, 1.6, 0.72), size=(1.4, 0.8))
    wall = make_plane((0.0, 3.0, 1.0), (0.0, -1.0, 0.0), (3.0, 2.0), index=1)
    labels = [frozenset({"TablePlane"}), frozenset({"WallPlane"})]

    figure = draw_plan([top, wall], labels, [table_of(top)], path_map=np.zeros((3, 3)), title="x")

    assert "table1" in words_in(figure)
    legend = figure.axes[0].get_legend()
    assert legend is not None
    assert {text.get_text() for text in legend.get_texts()} == {"table", "wall", "camera"}


def test_a_plan_of_nothing_is_empty() -> None:
    assert words_in(draw_plan([], [], [])) == ""


def test_an_overlay_names_the_furniture_in_view(render: Render, make_plane: MakePlane) -> None:
    top = make_plane((0.0, 1.6, 0.72), size=(1.4, 0.8))
    labels = [frozenset({"TablePlane"})]
    ahead, away = render([]), render([], target=(0.0, -3.0, 1.0))

    assert "table1" in words_in(draw_overlay(ahead, [top], labels, [table_of(top)]))
    assert words_in(draw_overlay(away, [top], labels, [table_of(top)])) == ""


def test_a_plane_that_reaches_behind_the_camera_is_clipped(
    render: Render, make_plane: MakePlane
) -> None:
    carpet = make_plane((0.0, 0.0, 0.02), size=(6.0, 6.0))

    figure = draw_overlay(render([]), [carpet], [frozenset({"ChairSeatPlane"})], [])

    (patch,) = figure.axes[0].patches
    assert np.isfinite(patch.get_path().vertices).all()


def test_a_frame_with_colour_shows_it(render: Render) -> None:
    frame = render([])
    red = np.zeros((*frame.depth_m.shape, 3), np.uint8)
    red[..., 0] = 255
    coloured = SensorFrame(
        frame.depth_m, frame.camera, 1.0, frame.T_map_sensor, colour=red,
        T_colour_depth=Transform.identity(),
    )  # fmt: skip

    (image,) = draw_overlay(coloured, [], [], []).axes[0].images

    assert (np.asarray(image.get_array())[0, 0] == (255, 63, 63)).all()


def test_pictures_are_saved_in_a_new_folder(tmp_path: Path) -> None:
    path = tmp_path / "plots" / "plan.png"

    save_picture(draw_plan([], [], []), path)

    assert cv2.imread(str(path)) is not None
