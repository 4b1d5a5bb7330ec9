"""What a piece without a CAD file has to look like: the boards of a shelf go all the way."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from fluentboard.model.geometry import Pose
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.cad_library import CadLibrary
from fluentboard_modules.mapping.config import DepthNoiseConfig, VerificationConfig
from fluentboard_modules.mapping.depth_views import thin_view
from fluentboard_modules.mapping.hypotheses import FurnitureGeometry, upright_box
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.verify import verify

Box = tuple[Sequence[float], Sequence[float]]
Render = Callable[..., SensorFrame]
MakePlane = Callable[..., PlanarRegion]

WALL: Box = ((-3.0, 2.0, 0.0), (3.0, 2.1, 2.5))
EYES = ((-0.3, -0.2, 1.5), (0.4, 0.0, 1.5))


def is_shelf(render: Render, boxes: list[Box], boards: list[PlanarRegion]) -> bool:
    """Whether two views confirm a shelf of these boards, the main plane first."""
    noise = DepthNoiseConfig()
    views = [
        thin_view(render([WALL, *boxes], eye=eye, target=(0.0, 1.8, 0.6), stamp_s=k), noise)
        for k, eye in enumerate(EYES, start=1)
    ]
    main = boards[0].centroid
    geometry = FurnitureGeometry(Pose(*main), upright_box(boards, 0.0), None)
    verdicts = verify("Shelf", geometry, boards, views, CadLibrary(), VerificationConfig())
    return any(verdict.is_accepted for verdict in verdicts)


def test_boards_of_one_shelf_go_on_where_they_are_hidden(
    render: Render, make_plane: MakePlane
) -> None:
    shelf: list[Box] = [
        ((-0.5, 1.65, height - 0.02), (0.5, 2.0, height)) for height in (0.12, 0.6, 1.1)
    ]
    books: Box = ((-0.5, 1.7, 0.12), (0.1, 2.0, 0.45))
    # Of the lowest board only the part without books was seen.
    boards = [
        make_plane((0.3, 1.75, 0.12), size=(0.35, 0.2)),
        make_plane((0.0, 1.825, 0.6), size=(1.0, 0.35)),
        make_plane((0.0, 1.825, 1.1), size=(1.0, 0.35)),
    ]

    assert is_shelf(render, [*shelf, books], boards)


def test_planes_one_above_the_other_are_no_shelf_where_floor_and_wall_show(
    render: Render, make_plane: MakePlane
) -> None:
    """As in the 7-Scenes red kitchen: all planes are there, and no shelf."""
    crate: Box = ((-0.8, 1.3, 0.0), (-0.4, 1.6, 0.12))
    counter: Box = ((-0.8, 1.6, 0.0), (0.8, 2.0, 0.9))
    oven: Box = ((-0.6, 1.65, 0.9), (-0.2, 2.0, 1.2))
    boards = [
        make_plane((-0.6, 1.45, 0.12), size=(0.4, 0.3)),
        make_plane((0.0, 1.8, 0.9), size=(1.6, 0.4)),
        make_plane((-0.4, 1.825, 1.2), size=(0.4, 0.35)),
    ]

    assert not is_shelf(render, [crate, counter, oven], boards)
