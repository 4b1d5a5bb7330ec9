"""CAD models against depth images: the pose is found, and what is not there is rejected."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fluentboard.errors import InvalidGeometry
from fluentboard.model.geometry import BoundingBox, Pose, Transform
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.alignment import Standing, align
from fluentboard_modules.mapping.cad_library import CadLibrary, load_library, stood_up
from fluentboard_modules.mapping.cad_models import ROUND, CadModel
from fluentboard_modules.mapping.config import (
    AlignmentConfig,
    DepthNoiseConfig,
    VerificationConfig,
    VisibilityConfig,
)
from fluentboard_modules.mapping.depth_views import DepthView, ViewMemory, best_views, thin_view
from fluentboard_modules.mapping.hypotheses import FurnitureGeometry
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.starts import possible_rows, possible_starts
from fluentboard_modules.mapping.verify import Verdict, verify
from fluentboard_modules.mapping.visibility import compare_with_views, front_relief_m
from fluentboard_modules.simulation import furniture
from fluentboard_modules.simulation.noise import NoiseConfig
from fluentboard_modules.simulation.office_furniture import plain_table
from fluentboard_modules.simulation.scene import Instance, Model, Scene
from fluentboard_modules.simulation.sensor import RgbdSensor
from fluentboard_modules.simulation.viewpoint import kinect_camera, look_at

MakePlane = Callable[..., PlanarRegion]
Render = Callable[..., SensorFrame]
NOISE = DepthNoiseConfig()
TABLE = furniture.table(width=1.2, depth=0.8, height=0.74)
CHAIR = furniture.chair()


def cad(model: Model) -> CadModel:
    return CadModel(model.name, model.cls, model.mesh)


def seen(things: Sequence[tuple[Model, Pose]], eyes: Sequence[Sequence[float]]) -> list[DepthView]:
    """Views of things on a floor, from eyes that look at the origin."""
    scene = Scene(
        (
            Instance("floor", furniture.floor(12.0, 12.0), Pose(0.0, 0.0, 0.0)),
            *(Instance(f"thing{k}", model, pose) for k, (model, pose) in enumerate(things)),
        )
    )
    sensor = RgbdSensor(kinect_camera(160), NoiseConfig())
    return [
        thin_view(
            sensor.look(
                scene,
                look_at(np.array(eye), np.array([0.0, 0.0, 0.5])),
                1.0 + k,
                np.random.default_rng(k),
            ),
            NOISE,
        )
        for k, eye in enumerate(eyes)
    ]


EYES = ((-1.8, -0.6, 1.5), (-1.2, 1.5, 1.4))


@pytest.mark.parametrize(
    ("model", "order"),
    [(TABLE, 2), (CHAIR, 1), (furniture.round_table(), ROUND), (furniture.shelf(), 1)],
    ids=["table", "chair", "round table", "shelf"],
)
def test_symmetry_of_a_model_is_known(model: Model, order: int) -> None:
    assert cad(model).symmetry_order == order


def test_icp_finds_a_chair_that_is_off() -> None:
    views = seen([(CHAIR, Pose.from_rpy(0.0, 0.0, 0.0, yaw=2.4))], EYES)
    points = np.concatenate([view.points_map for view in views])
    points = points[(points[:, 2] > 0.04) & (np.abs(points[:, :2]) < 0.8).all(axis=1)]

    found = align(points, cad(CHAIR), Standing(0.07, -0.06, 2.4 + 0.3), AlignmentConfig())

    assert np.hypot(found.x, found.y) < 0.012
    assert abs(found.yaw_rad - 2.4) < np.deg2rad(2.0)


def test_what_nobody_saw_of_a_table_does_not_pull_at_it() -> None:
    views = seen([(TABLE, Pose.from_rpy(0.0, 0.0, 0.0))], [(-1.5, 0.2, 1.4)])
    points = views[0].points_map
    near = points[(points[:, 2] > 0.6) & (points[:, 0] < 0.0)]  # half of its top

    found = align(near, cad(TABLE), Standing(0.0, 0.0, 0.0), AlignmentConfig())

    assert np.hypot(found.x, found.y) < 0.03


def test_score_tells_a_model_that_is_there_from_one_that_is_not() -> None:
    config = VisibilityConfig()
    views = seen([(TABLE, Pose.from_rpy(0.0, 0.0, 0.0))], EYES)
    model = cad(TABLE)

    def score(x: float) -> float:
        at = Standing(x, 0.0, 0.0).transform
        return compare_with_views(model, at, views, config).score(config)

    assert score(0.0) > 0.95
    assert score(0.3) < 0.9
    assert score(1.5) < 0.2


def test_hidden_models_are_not_held_against() -> None:
    config = VisibilityConfig()
    screen = furniture.cabinet(width=2.5, height=1.8)
    eyes = [(-2.5, 0.0, 1.0)]
    views = seen([(screen, Pose(-1.2, 0.0, 0.0)), (TABLE, Pose(0.0, 0.0, 0.0))], eyes)

    looks = compare_with_views(cad(TABLE), Standing(0.0, 0.0, 0.0).transform, views, config)

    assert looks.occluded > 10.0 * (looks.violated + looks.explained)
    assert looks.violated < 0.01


def hypothesis(
    make_plane: MakePlane, size: tuple[float, float], at: tuple[float, float, float], yaw: float
) -> tuple[FurnitureGeometry, list[PlanarRegion]]:
    turned = Transform.from_parts(
        Pose.from_rpy(0.0, 0.0, 0.0, yaw=yaw).to_transform().rotation, np.array(at)
    )
    plane = replace(make_plane(at, size=size), T_map_region=turned)
    pose = Pose.from_rpy(*at, yaw=yaw)
    box = BoundingBox(Pose.from_rpy(at[0], at[1], 0.5 * at[2], yaw=yaw), *size, at[2])
    return FurnitureGeometry(pose, box, None), [plane]


def judged(
    make_plane: MakePlane,
    views: list[DepthView],
    size: tuple[float, float],
    at: tuple[float, float, float],
    yaw: float = 0.0,
    library: CadLibrary | None = None,
) -> tuple[Verdict, ...]:
    geometry, planes = hypothesis(make_plane, size, at, yaw)
    return verify(
        "Table",
        geometry,
        planes,
        views,
        CadLibrary((cad(TABLE),)) if library is None else library,
        VerificationConfig(),
    )


def test_half_a_table_is_completed_by_its_model(make_plane: MakePlane) -> None:
    views = seen([(TABLE, Pose.from_rpy(0.0, 0.0, 0.0, yaw=0.5 * np.pi))], EYES)

    # Only the left half of the top was seen, so the hypothesis is 0.3 m off.
    (verdict,) = judged(make_plane, views, (0.6, 0.8), (-0.3, 0.0, 0.74))

    assert verdict.is_accepted
    assert np.hypot(verdict.standing.x, verdict.standing.y) < 0.02
    assert abs(np.cos(verdict.standing.yaw_rad)) < 0.05
    assert np.hypot(verdict.initial.x, verdict.initial.y) < 0.1  # the images say which half
    assert verdict.score >= verdict.initial_score
    assert (np.diag(verdict.covariance) > 0.0).all()
    assert np.sqrt(verdict.covariance[0, 0]) < 0.05


def test_joined_tables_are_two(make_plane: MakePlane) -> None:
    places = [Pose.from_rpy(x, 0.0, 0.0, yaw=0.5 * np.pi) for x in (-0.6, 0.6)]
    views = seen([(TABLE, place) for place in places], EYES)

    verdicts = judged(make_plane, views, (2.4, 0.8), (0.0, 0.0, 0.74))

    assert sorted(round(verdict.standing.x, 1) for verdict in verdicts) == [-0.6, 0.6]
    assert all(verdict.is_accepted for verdict in verdicts)


def test_seats_in_one_plane_are_chairs_that_face_their_own_ways(make_plane: MakePlane) -> None:
    places = [Pose.from_rpy(-0.27, 0.0, 0.0, yaw=0.1), Pose.from_rpy(0.27, 0.0, 0.0, yaw=3.0)]
    views = seen([(CHAIR, place) for place in places], EYES)
    geometry, planes = hypothesis(make_plane, (0.96, 0.42), (0.0, 0.0, 0.45), 0.0)

    verdicts = verify(
        "Chair", geometry, planes, views, CadLibrary((cad(CHAIR),)), VerificationConfig()
    )

    found = sorted((v.standing for v in verdicts if v.is_accepted), key=lambda one: one.x)
    assert [one.x for one in found] == pytest.approx([-0.27, 0.27], abs=0.02)
    assert [np.cos(one.yaw_rad) for one in found] == pytest.approx(
        np.cos([0.1, 3.0]).tolist(), abs=0.02
    )


def test_a_row_may_begin_at_either_end(make_plane: MakePlane) -> None:
    geometry, planes = hypothesis(make_plane, (2.5, 0.8), (0.0, 0.0, 0.74), 0.0)

    rows = possible_rows(cad(TABLE), geometry, planes, VerificationConfig())

    lengthwise = [row for row in rows if len(row) == 2]
    assert len({round(row[0].x, 3) for row in lengthwise}) == 3


def test_a_top_without_anything_below_is_no_table_of_that_make(make_plane: MakePlane) -> None:
    board = furniture.table(width=1.2, depth=0.4, height=0.74)
    views = seen([(board, Pose.from_rpy(0.0, 0.0, 0.0, yaw=0.5 * np.pi))], EYES)

    (verdict,) = judged(make_plane, views, (1.2, 0.4), (0.0, 0.0, 0.74))

    assert not verdict.is_accepted


def test_without_a_model_the_planes_speak_for_themselves(make_plane: MakePlane) -> None:
    views = seen([(TABLE, Pose.from_rpy(0.0, 0.0, 0.0, yaw=0.5 * np.pi))], EYES)
    nothing = CadLibrary()

    (there,) = judged(make_plane, views, (1.2, 0.8), (0.0, 0.0, 0.74), library=nothing)
    (absent,) = judged(make_plane, views, (1.2, 0.8), (0.0, 1.5, 0.74), library=nothing)

    assert there.is_accepted
    assert not there.model.is_exact
    assert not absent.is_accepted


def test_views_are_taken_from_different_sides() -> None:
    eyes = [(-1.8, 0.0, 1.4), (-1.81, 0.0, 1.4), (1.8, 0.0, 1.4)]
    views = seen([], eyes)

    chosen = best_views(views, np.zeros(3), 0.5, 2)

    assert sorted(round(float(view.T_map_sensor.translation[0])) for view in chosen) == [-2, 2]


def test_memory_of_views_is_bounded(render: Render) -> None:
    memory = ViewMemory(NOISE)
    frame = render([])
    for _ in range(600):
        memory.add(frame)

    assert len(memory.since()) <= 240


def test_models_are_read_from_a_folder(tmp_path: Path) -> None:
    text = "\n".join(
        [
            *(f"v {x} {y} {z}" for x in (1.0, 1.4) for y in (0.0, 0.5) for z in (0.3, 1.2)),
            *("f 1 2 4", "f 5 7 8", "f 1 5 6", "f 3 4 8", "f 1 3 7", "f 2 6 8"),
        ]
    )
    (tmp_path / "Chair").mkdir()
    (tmp_path / "Chair" / "rokoko.obj").write_text(text)
    (tmp_path / "lamp.obj").write_text(text)

    library = load_library(tmp_path, ["Chair", "Table"])

    (model,) = library.models
    assert (model.name, model.class_name) == ("rokoko", "Chair")
    assert model.mesh.bounds.ravel().tolist() == pytest.approx([-0.2, -0.25, 0.0, 0.2, 0.25, 0.9])


def test_folder_without_models_says_how_to_name_them(tmp_path: Path) -> None:
    with pytest.raises(InvalidGeometry, match=r"name files like Chair\.stl"):
        load_library(tmp_path, ["Chair"])
    with pytest.raises(InvalidGeometry, match="no such folder"):
        load_library(tmp_path / "nowhere", ["Chair"])


def test_model_in_millimetres_is_refused_with_the_remedy() -> None:
    with pytest.raises(InvalidGeometry, match="units=mm"):
        stood_up(CHAIR.mesh.scaled(1000.0), "chair.stl")


def test_sliding_out_of_the_image_gains_nothing() -> None:
    config = VisibilityConfig()
    views = seen([(TABLE, Pose.from_rpy(0.0, 0.7, 0.0))], [(-1.4, -0.3, 1.3)])
    model = cad(TABLE)

    def gain(y: float) -> float:
        return compare_with_views(model, Standing(0.0, y, 0.0).transform, views, config).gain(
            config
        )

    assert gain(0.7) > gain(0.9) > gain(1.2)


def test_a_wall_has_no_relief_however_the_model_is_turned_against_it() -> None:
    wall = furniture.wall(3.0)
    views = seen([(wall, Pose.from_rpy(1.0, 0.0, 0.0, yaw=np.pi))], [(-1.6, 0.0, 1.4)])
    shelf = furniture.shelf()
    books_in_front = shelf.mesh.bounds[1, 0]

    for turn in (0.0, 0.1):
        at = Standing(0.95 + float(books_in_front), 0.0, float(np.pi) + turn).transform
        assert front_relief_m(cad(shelf), at, views, VisibilityConfig()) < 0.008


def test_a_top_without_a_seen_end_may_lie_anywhere_along_itself(make_plane: MakePlane) -> None:
    bench = plain_table("bench", 3.6, 0.7, 0.73)

    def sigma_along_m(eye: Sequence[float], seen_m: float) -> float:
        views = seen([(bench, Pose(0.0, 0.0, 0.0))], [eye])
        plane = make_plane((0.0, 0.0, 0.73), size=(0.7, seen_m))
        geometry = FurnitureGeometry(
            Pose.from_rpy(0.0, 0.0, 0.73, yaw=0.5 * np.pi),
            BoundingBox(Pose.from_rpy(0.0, 0.0, 0.365, yaw=0.5 * np.pi), seen_m, 0.7, 0.73),
            None,
        )
        config = VerificationConfig()
        (verdict,) = verify("Table", geometry, [plane], views, CadLibrary((cad(bench),)), config)
        return float(np.sqrt(verdict.covariance[1, 1]))

    assert sigma_along_m((-1.3, 0.0, 1.4), 1.2) > 2.0 * sigma_along_m((-4.2, 0.0, 1.8), 3.6)


def test_boards_are_seen_through_the_front_of_a_shelf(make_plane: MakePlane) -> None:
    shelf = cad(furniture.shelf())
    depth, width = (shelf.mesh.bounds[1] - shelf.mesh.bounds[0])[:2].tolist()
    geometry, (top,) = hypothesis(make_plane, (depth, width), (0.0, 0.0, 1.75), 0.0)
    eye = np.array([2.0, 0.1, 1.4])
    boards = [
        replace(
            top,
            T_map_region=Transform.from_parts(np.eye(3), np.array([0.0, 0.0, height])),
            sensor_position=eye,
        )
        for height in (1.75, 1.0, 0.5)
    ]

    starts = possible_starts(shelf, geometry, boards, VerificationConfig())

    assert starts
    assert all(abs(start.yaw_rad) < 0.1 for start in starts)
