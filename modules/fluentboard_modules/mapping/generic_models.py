"""Models made up from a hypothesis, for classes without a CAD file.

They are the planes of the hypothesis, as far as a piece of that class can be so large, together
with what every piece of the class has: a worktop has a body below it, a seat has room below it. So
they cannot improve a pose, but they say what must be seen and what must not, and that rejects much
of what merely resembles furniture: a board on a wall, a waste bin beside a cupboard.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, box

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.mapping.cad_models import CadModel, Void
from fluentboard_modules.mapping.hypotheses import FurnitureGeometry
from fluentboard_modules.mapping.planar_region import PlanarRegion, as_multipolygon
from fluentboard_modules.simulation import mesh as solids
from fluentboard_modules.simulation.mesh import Mesh

_LEVEL = 0.7
# EN 1729-1 and catalogues: chairs are at most 0.6 m wide and deep and 1.1 m high.
_CHAIR_HALF_WIDTH_M, _CHAIR_TOP_M = 0.32, 1.15
_BACK_BELOW_SEAT_M = 0.15
_PLINTH_M = 0.12
_BOARDS_APART_M = 0.15
_BOARD_M = 0.02
_FRONT_DEPTH_M = 0.3  # of a body behind a front: so much of its top would be seen from above
_CLEAR_BELOW_M = 0.45  # boards of shelves are nearer to each other
_EDGE_M = 0.06  # outlines of planes reach beyond the true edges by pixels and by drift of poses


def generic_model(
    class_name: str, geometry: FurnitureGeometry, parts: Sequence[PlanarRegion]
) -> CadModel | None:
    """What a piece of that class looks like if it is as the hypothesis says.

    Args:
        class_name: of the furniture ontology.
        geometry: where the hypothesis puts it.
        parts: its planes, the main plane first.

    Returns:
        The model, its frame below the hypothesis's origin on the floor; None for a class that
        nothing general can be said about.
    """
    maker = _MAKERS.get(class_name)
    if maker is None:
        return None
    pose = geometry.pose
    T_map_model = Transform.from_parts(pose.to_transform().rotation, np.array([pose.x, pose.y, 0]))
    meshes, voids = maker(T_map_model.inverse(), parts)
    if not meshes:
        return None
    return CadModel(
        f"generic {class_name}", class_name, solids.merge(meshes), is_exact=False, voids=voids
    )


Made = tuple[list[Mesh], tuple[Void, ...]]
Maker = Callable[[Transform, Sequence[PlanarRegion]], Made]


def _seat_and_back(T_model_map: Transform, parts: Sequence[PlanarRegion]) -> Made:
    seats = [part for part in parts if abs(part.normal[2]) > _LEVEL and part is parts[0]]
    seat_m = seats[0].height_m if seats else 0.0
    meshes = [_sheet(part, T_model_map) for part in seats]
    middle = _extent(parts[0], T_model_map).mean(axis=0)
    meshes += [
        _sheet(part, T_model_map, _back_limits(part, T_model_map, middle, seat_m))
        for part in parts
        if abs(part.normal[2]) <= _LEVEL
    ]
    voids: tuple[Void, ...] = ()
    if seats:
        low, high = _extent(seats[0], T_model_map)
        inset = 0.05
        if (high - low)[:2].min() > 3.0 * inset:
            voids = (
                Void(
                    (float(low[0]) + inset, float(low[1]) + inset, 0.08),
                    (float(high[0]) - inset, float(high[1]) - inset, seat_m - 0.1),
                ),
            )
    return [mesh for mesh in meshes if mesh is not None], voids


def _back_limits(
    part: PlanarRegion, T_model_map: Transform, middle: FloatArray, seat_m: float
) -> MultiPolygon:
    """How far a backrest may reach, on the region's own axes (x level, y up)."""
    T_region_model = (T_model_map @ part.T_map_region).inverse()
    x = float(T_region_model.apply(np.array([[0.0, middle[1], part.height_m]]))[0, 0])
    rise = max(float(part.T_map_region.rotation[2, 1]), 0.5)
    top = (_CHAIR_TOP_M - part.height_m) / rise
    bottom = (max(seat_m - _BACK_BELOW_SEAT_M, 0.0) - part.height_m) / rise
    return MultiPolygon([box(x - _CHAIR_HALF_WIDTH_M, bottom, x + _CHAIR_HALF_WIDTH_M, top)])


def _top(T_model_map: Transform, parts: Sequence[PlanarRegion]) -> Made:
    """A top with room for legs below it."""
    sheet = _sheet(parts[0], T_model_map)
    low, high = _extent(parts[0], T_model_map)
    inset = np.minimum(0.15, 0.25 * (high - low)[:2])
    void = Void(
        (float(low[0] + inset[0]), float(low[1] + inset[1]), 0.12),
        (float(high[0] - inset[0]), float(high[1] - inset[1]), parts[0].height_m - 0.15),
    )
    return ([sheet] if sheet is not None else []), (void,)


def _closed(T_model_map: Transform, parts: Sequence[PlanarRegion]) -> Made:
    """A closed body below the top: worktops and cabinets stand on the floor, on a plinth."""
    if abs(parts[0].normal[2]) <= _LEVEL:
        return _behind_a_front(T_model_map, parts)
    low, high = _extent(parts[0], T_model_map)
    inset = np.minimum(0.06, 0.2 * (high - low)[:2])
    size = (high - low)[:2] - 2.0 * inset
    x, y = 0.5 * (low + high)[:2]
    rise = parts[0].height_m - 0.04 - _PLINTH_M
    top = _sheet(parts[0], T_model_map)
    meshes = [] if top is None else [top]
    if size.min() > 0.05 and rise > 0.1:
        body = solids.box(float(size[0]), float(size[1]), rise, (float(x), float(y), _PLINTH_M))
        meshes.append(body)
    return meshes, ()


def _behind_a_front(T_model_map: Transform, parts: Sequence[PlanarRegion]) -> Made:
    """A closed body behind a front that ends at a worktop, above which one sees farther.

    The model's x axis points to where the front is seen from. A wall that juts out goes on above,
    and so does a wall of which furniture hides a part.
    """
    low, high = _extent(parts[0], T_model_map)
    inset = min(_EDGE_M, 0.2 * float(high[1] - low[1]))
    top, width = float(high[2]), float(high[1] - low[1]) - 2.0 * inset
    front, y = 0.5 * float(low[0] + high[0]), 0.5 * float(low[1] + high[1])
    rise = top - _EDGE_M - _PLINTH_M
    if rise < 0.1:
        return [], ()
    body = solids.box(_FRONT_DEPTH_M, width, rise, (front - 0.5 * _FRONT_DEPTH_M, y, _PLINTH_M))
    # The edge of the worktop is mostly clear; further back things stand.
    above = Void(
        (front - 0.15, y - 0.5 * width, top + _EDGE_M),
        (front - _EDGE_M, y + 0.5 * width, top + 0.3),
        must_be_seen=True,
    )
    sheet = _sheet(parts[0], T_model_map)
    return ([body] if sheet is None else [sheet, body]), (above,)


def _fixed_board(T_model_map: Transform, parts: Sequence[PlanarRegion]) -> Made:
    """A board on a wall, with nothing below it."""
    sheet = _sheet(parts[0], T_model_map)
    low, high = _extent(parts[0], T_model_map)
    inset = np.minimum(0.1, 0.25 * (high - low)[:2])
    height = parts[0].height_m
    below = Void(
        (float(low[0] + inset[0]), float(low[1] + inset[1]), height - _CLEAR_BELOW_M),
        (float(high[0] - inset[0]), float(high[1] - inset[1]), height - 0.08),
        must_be_seen=True,
    )
    return ([sheet] if sheet is not None else []), (below,)


def _boards(T_model_map: Transform, parts: Sequence[PlanarRegion]) -> Made:
    """A shelf: its planes, and each board as wide and as deep as all of them together.

    Of a board that is hidden in part, the rest must not be seen through. A counter with a box in
    front of it and a rack above it are planes one above the other, but no shelf: the floor and the
    wall are seen where the boards would go on.
    """
    boards = [part for part in parts if abs(part.normal[2]) > _LEVEL]
    heights = sorted(board.height_m for board in boards)
    if not heights or heights[-1] - heights[0] < _BOARDS_APART_M:
        return [], ()  # one level face behind a front may be anything that stands beside it
    meshes = [sheet for part in parts if (sheet := _sheet(part, T_model_map)) is not None]
    extents = np.concatenate([_extent(board, T_model_map) for board in boards])[:, :2]
    low, high = extents.min(axis=0), extents.max(axis=0)
    size = high - low - 2.0 * np.minimum(_EDGE_M, 0.2 * (high - low))
    x, y = (0.5 * (low + high)).tolist()
    meshes += [
        solids.box(float(size[0]), float(size[1]), _BOARD_M, (x, y, height - _BOARD_M))
        for height in heights
        if size.min() > 0.05
    ]
    return meshes, ()


_MAKERS: dict[str, Maker] = {
    "Chair": _seat_and_back,
    "Table": _top,
    "Desk": _top,
    "CoffeeTable": _top,
    "Counter": _closed,
    "Cabinet": _closed,
    "Shelf": _boards,
    "WallShelf": _fixed_board,
}


def _extent(part: PlanarRegion, T_model_map: Transform) -> FloatArray:
    corners = T_model_map.apply(part.outline_map())
    return np.array([corners.min(axis=0), corners.max(axis=0)])


def _sheet(
    part: PlanarRegion, T_model_map: Transform, limits: MultiPolygon | None = None
) -> Mesh | None:
    """A region as a thin sheet in the model's frame; None if nothing is left within the limits."""
    contour = part.contour if part.contour.is_valid else shapely.make_valid(part.contour)
    if limits is not None:
        contour = contour.intersection(limits)
    contour = as_multipolygon(contour)
    corners: list[FloatArray] = []
    for polygon in contour.geoms:
        if polygon.area > 1e-4:
            pieces = shapely.constrained_delaunay_triangles(polygon)
            corners += [np.asarray(piece.exterior.coords)[:3, :2] for piece in pieces.geoms]
    if not corners:
        return None
    flat = np.concatenate(corners)
    T_model_region = T_model_map @ part.T_map_region
    vertices = T_model_region.apply(np.column_stack([flat, np.zeros(len(flat))]))
    return Mesh(vertices, np.arange(len(flat), dtype=np.int32).reshape(-1, 3))
