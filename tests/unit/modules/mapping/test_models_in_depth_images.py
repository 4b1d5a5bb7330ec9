"""Models drawn into depth images: the same as rays cast, and poses to the millimetre."""

from __future__ import annotations

from dataclasses import astuple, replace

import numpy as np
import pytest

from fluentboard.model.geometry import Pose, Transform
from fluentboard_modules.mapping.alignment import Standing
from fluentboard_modules.mapping.alignment_kernels import OUTSIDE, nearest_sample
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.config import (
    DepthNoiseConfig,
    EvidenceConfig,
    RefinementConfig,
    VerificationConfig,
    VisibilityConfig,
)
from fluentboard_modules.mapping.depth_views import DepthView, thin_view
from fluentboard_modules.mapping.draw_kernels import draw
from fluentboard_modules.mapping.evidence import Evidence, gather_evidence
from fluentboard_modules.mapping.nearest_samples import CELL_M, REACH_M, VOXEL_M
from fluentboard_modules.mapping.placement import Looker
from fluentboard_modules.mapping.refinement import Heading, refine
from fluentboard_modules.mapping.view_stack import ViewStack
from fluentboard_modules.mapping.visibility import compare_with_views, scene_points
from fluentboard_modules.simulation import furniture
from fluentboard_modules.simulation.mesh import Mesh
from fluentboard_modules.simulation.noise import NoiseConfig
from fluentboard_modules.simulation.scene import Instance, Scene
from fluentboard_modules.simulation.sensor import RgbdSensor
from fluentboard_modules.simulation.viewpoint import kinect_camera, look_at

CHAIR = furniture.chair()
CHAIR_CAD = CadModel(CHAIR.name, CHAIR.cls, CHAIR.mesh)
CAMERA = kinect_camera(160)


def look(eye: tuple[float, float, float], seed: int = 0) -> DepthView:
    """A noisy view of the chair, which stands at the origin and faces +x."""
    scene = Scene(
        (
            Instance("floor", furniture.floor(8.0, 8.0), Pose(0.0, 0.0, 0.0)),
            Instance("chair", CHAIR, Pose(0.0, 0.0, 0.0)),
        )
    )
    frame = RgbdSensor(CAMERA, NoiseConfig()).look(
        scene,
        look_at(np.array(eye), np.array([0.0, 0.0, 0.5])),
        1.0,
        np.random.default_rng(seed),
    )
    return thin_view(frame, DepthNoiseConfig())


@pytest.mark.parametrize("eye", [(1.5, 0.4, 1.3), (0.35, 0.1, 0.6)], ids=["ahead", "beside"])
@pytest.mark.parametrize("step", [1, 2])
def test_drawing_a_model_is_casting_rays_at_it(eye: tuple[float, float, float], step: int) -> None:
    T_map_sensor = look_at(np.array(eye), np.array([0.0, 0.0, 0.5]))
    corners = T_map_sensor.inverse().apply(CHAIR.mesh.vertices)[CHAIR.mesh.triangles]
    intrinsics = np.array([CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy])
    window = np.array([10, 110, 20, 150])

    depth, triangle = draw(corners, intrinsics, window, step)

    rays = CAMERA.rays()[10:110:step, 20:150:step]
    origin = np.broadcast_to(T_map_sensor.translation, rays.shape)
    both = np.concatenate([origin, T_map_sensor.rotate(rays)], axis=-1)
    hits = CHAIR_CAD.caster.cast(both.astype(np.float32))
    same = np.isclose(depth, hits.distance, atol=1e-4) | (np.isinf(depth) & np.isinf(hits.distance))
    assert same.mean() > 0.999  # rays along an edge may miss either way
    assert ((triangle >= 0) == np.isfinite(depth)).all()


def test_a_triangle_seen_edge_on_beside_the_sensor_is_not_drawn() -> None:
    # Found in a drive past a shelf: its edge crosses the rows 5e18 columns away, and less a row's
    # tilt more than 64 bits count.
    corners = np.array(
        [
            [-2.589092610606709, -0.00018455521669635822, 0.0001506575687617584],
            [-2.277678853485972, -0.15781510362473783, 0.12882886895097845],
            [-2.277678853485972, -0.1704626459675268, 0.11333565518858024],
        ]
    )
    camera = np.array([131.25, 131.25, 79.25, 59.25])

    for turn in range(3):
        turned = np.roll(corners, turn, axis=0)[None]
        depth, _ = draw(turned, camera, np.array([0, 120, 0, 160]), 1)
        assert np.isinf(depth).all()


def test_pixels_find_a_chair_to_the_millimetre() -> None:
    views = [look((1.6, 0.9, 1.4)), look((-0.4, -1.7, 1.4), seed=1)]

    found = refine(
        CHAIR_CAD, Standing(0.02, -0.015, 0.03), views, VisibilityConfig(), RefinementConfig()
    )

    assert np.hypot(found.standing.x, found.standing.y) < 0.004
    assert abs(found.standing.yaw_rad) < np.deg2rad(0.5)
    assert 0.2 < found.misfit < 2.0
    assert (np.linalg.eigvalsh(found.information) > 0.0).all()


def test_what_shows_no_pixel_stays_where_it_is() -> None:
    start = Standing(0.3, 3.0, 1.0)
    away = [look((1.6, 0.9, 1.4))]

    found = refine(CHAIR_CAD, start, away, VisibilityConfig(), RefinementConfig())

    assert found.standing == start
    assert found.n_pixels < RefinementConfig().pixels_least


def test_a_level_sheet_binds_no_place() -> None:
    sheet = Mesh(
        np.array([[-0.4, -0.4, 0.0], [0.4, -0.4, 0.0], [0.4, 0.4, 0.0], [-0.4, 0.4, 0.0]]),
        np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
    )
    start = Standing(0.0, 0.0, 0.2)
    model = CadModel("sheet", "Table", sheet)

    found = refine(model, start, [look((1.6, 0.9, 1.4))], VisibilityConfig(), RefinementConfig())

    assert found.n_pixels > RefinementConfig().pixels_least
    assert (found.standing.x, found.standing.y) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_a_heading_that_is_known_exactly_is_kept() -> None:
    view = look((1.6, 0.9, 1.4))
    heading = Heading(np.pi, 1e-5, may_be_reversed=True)

    found = refine(
        CHAIR_CAD,
        Standing(0.0, 0.0, 0.02),
        [view],
        VisibilityConfig(),
        RefinementConfig(),
        heading,
    )

    assert abs(found.standing.yaw_rad) < 1e-4


@pytest.mark.parametrize("hint", [OUTSIDE, 0])
def test_nearest_samples_are_those_of_a_search(hint: int) -> None:
    samples, nearest = CHAIR_CAD.surface.points, CHAIR_CAD.nearest
    extent = np.array(nearest.field.shape) * VOXEL_M
    places = np.random.default_rng(0).random((300, 3)) * extent
    distances = np.linalg.norm(samples - (nearest.low + places)[:, None], axis=2)
    expected = np.where(distances.min(axis=1) < REACH_M, distances.argmin(axis=1), OUTSIDE)

    table = nearest.members, nearest.firsts, CELL_M, REACH_M
    found: list[int] = [
        nearest_sample(x, y, z, hint, nearest.low, samples, *table) for x, y, z in places.tolist()
    ]

    assert found == expected.tolist()
    assert OUTSIDE in found


def test_views_of_different_sizes_are_looked_at_together() -> None:
    near, far = look((1.6, 0.9, 1.4)), look((-1.4, 1.9, 1.2), seed=1)
    small = replace(far, depth_m=far.depth_m[:100, :120].copy())
    at, config = Standing(0.01, 0.0, 0.02).transform, VisibilityConfig()

    both = compare_with_views(CHAIR_CAD, at, [near, small], config)

    each = [compare_with_views(CHAIR_CAD, at, [view], config) for view in (near, small)]
    assert astuple(both) == pytest.approx(astuple(each[0] + each[1]))
    assert each[1].explained > 0.0
    first = compare_with_views(CHAIR_CAD, at, ViewStack([near, small]), config, n_views=1)
    assert first == each[0]


def test_points_of_two_views_of_one_place_are_kept_once() -> None:
    view = look((1.6, 0.9, 1.4))
    half = np.array([0.5, 0.5, 1.0])

    once = scene_points([view], Transform.identity(), half, 0.025)
    twice = scene_points([view, view], Transform.identity(), half, 0.025)

    assert len(once) > 100
    assert len(once) == len(twice)


def evidence_of(things: tuple[Instance, ...], at: Standing, *, is_front: bool = False) -> Evidence:
    """What one view of some things says about a chair at a place."""
    scene = Scene((Instance("floor", furniture.floor(8.0, 8.0), Pose(0.0, 0.0, 0.0)), *things))
    frame = RgbdSensor(CAMERA, NoiseConfig()).look(
        scene,
        look_at(np.array([1.6, 0.9, 1.4]), np.array([0.0, 0.0, 0.5])),
        1.0,
        np.random.default_rng(0),
    )
    looker = Looker(CHAIR_CAD, [thin_view(frame, DepthNoiseConfig())], VerificationConfig())
    return gather_evidence(looker, looker.look(at), looker.misfit(at), is_front=is_front)


def test_a_chair_is_likelier_than_a_block_of_its_size() -> None:
    low, high = CHAIR.mesh.bounds
    block = furniture.cabinet(width=float(high[1] - low[1]), height=0.95)
    at = Standing(0.0, 0.0, 0.0)

    chair = evidence_of((Instance("chair", CHAIR, Pose(0.0, 0.0, 0.0)),), at)
    other = evidence_of((Instance("block", block, Pose(0.0, 0.0, 0.0)),), at)

    config = EvidenceConfig()
    assert chair.probability(config) > 0.95
    assert other.probability(config) < 0.1
    assert chair.outline > 0.8


def test_a_surface_that_goes_on_leaves_no_outline() -> None:
    config = EvidenceConfig()
    sure = Evidence(explained=0.9, closeness=0.8, outline=0.9, misfit=1.0)
    on_a_wall = Evidence(explained=0.9, closeness=0.8, outline=0.1, misfit=1.0)

    assert sure.probability(config) > 0.7
    assert on_a_wall.probability(config) < 0.5


def test_a_front_without_relief_is_none() -> None:
    flat = Evidence(explained=1.0, closeness=1.0, outline=1.0, misfit=0.5, relief=0.0)

    assert flat.probability(EvidenceConfig()) == 0.0
