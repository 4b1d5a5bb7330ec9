"""Walls: upright planes behind which nothing is seen. They are no furniture and hold none.

A shelf fits a piece of wall beside a door, and a chair's back fits the door, if nothing says that
the piece would stand in the wall. So the walls are moved back in the images: then nothing in the
room is explained by them, and what reaches into them is contradicted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from shapely.geometry import LineString, Polygon

from fluentboard.model.geometry import BoundingBox
from fluentboard_modules.mapping.depth_views import DepthView
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.wall_kernels import add_points_behind

_UPRIGHT = 0.15
_LEAST_M2 = 0.2
_PARALLEL = 0.8
_CERTAIN_M2 = 0.6  # smaller ones may be the back of a shelf
_INTO_M, _ACROSS_M = 0.1, 0.1  # poses are wrong by so much; so much of a wall runs through a piece
_BEHIND_M, _BEHIND_SIGMAS = 0.08, 3.0
_BEHIND_SHARE = 0.005  # noise; gaps between and above the books of a shelf are more of an image
_ON_M, _ON_SIGMAS = 0.015, 1.5
_AROUND_M = 0.4  # further along a plane that is slightly turned, it is somewhere else
_BACK_M = 20.0  # so far that nothing in the room is near
_VIEWS_MAX = 60


def room_walls(
    regions: Sequence[PlanarRegion], views: Sequence[DepthView], every: int = 1
) -> list[PlanarRegion]:
    """Those of the regions that are walls.

    Args:
        regions: planar regions in the map frame.
        views: depth images; all of a single look, or of a whole room.
        every: how many points one of them stands for.
    """
    upright = [
        region
        for region in regions
        if abs(float(region.normal[2])) < _UPRIGHT and region.area_m2 >= _LEAST_M2
    ]
    chosen = views[:: max(1, -(-len(views) // _VIEWS_MAX))]
    total = sum(len(view.points_map[::every]) for view in chosen)
    planes = np.array([[*one.normal, one.normal @ one.centroid] for one in upright])
    behind = np.zeros(len(upright), dtype=np.int64)
    for view in chosen if upright else ():
        points = np.ascontiguousarray(view.points_map[::every])
        sigma = view.sigma_m[view.depth_m > 0.0][::every]
        limits = np.maximum(_BEHIND_M, _BEHIND_SIGMAS * sigma)
        add_points_behind(points, limits, planes, behind, _BEHIND_SHARE * total)
    return [
        region
        for region, count in zip(upright, behind.tolist(), strict=True)
        if count < _BEHIND_SHARE * total
    ]


def is_in_wall(
    piece: BoundingBox, walls: Sequence[PlanarRegion], *, may_touch: bool = False
) -> bool:
    """Whether a wall runs through the room that a piece takes up, or its middle is behind one.

    Args:
        piece: upright box in the map frame.
        walls: from `room_walls`.
        may_touch: whether a small one along its front may run through it: the backs of shelves
            look like walls.
    """
    inner = Polygon(piece.corners()[[0, 2, 6, 4], :2]).buffer(-_INTO_M)
    middle = (piece.pose.x, piece.pose.y)
    front = piece.pose.to_transform().rotation[:2, 0]
    for wall in walls:
        low, _, high, _ = wall.contour.bounds
        ends = wall.T_map_region.apply(np.array([[low, 0.0, 0.0], [high, 0.0, 0.0]]))
        line = LineString(ends[:, :2])
        depth = float(wall.normal[:2] @ (np.array(middle) - wall.centroid[:2]))
        faces = float(wall.normal[:2] @ front)
        # Nothing at all was seen behind a wall: a back is at a large one, and never beyond it.
        is_large = wall.area_m2 >= _CERTAIN_M2
        is_beyond = depth < 0.5 * piece.x_size - _INTO_M
        may_cross = may_touch and abs(faces) > _PARALLEL and not (is_large and is_beyond)
        crosses = line.intersection(inner).length > _ACROSS_M and not may_cross
        is_sunk = may_touch and faces > _PARALLEL and is_large and is_beyond
        if crosses or is_sunk or depth < -_INTO_M:
            return True
    return False


def without_walls(views: Sequence[DepthView], walls: Sequence[PlanarRegion]) -> list[DepthView]:
    """The images with the certain ones of the walls moved back."""
    certain = [wall for wall in walls if wall.area_m2 >= _CERTAIN_M2]
    if not certain:
        return list(views)
    return [_moved_back(view, certain) for view in views]


def _moved_back(view: DepthView, walls: Sequence[PlanarRegion]) -> DepthView:
    seen = view.depth_m > 0.0
    points = view.points_map
    near = np.maximum(_ON_M, _ON_SIGMAS * view.sigma_m[seen])
    is_wall = np.zeros(len(points), dtype=np.bool_)
    for wall in walls:
        local = wall.T_map_region.inverse().apply(points)
        x_low, y_low, x_high, y_high = wall.contour.bounds
        is_wall |= (
            (np.abs(local[:, 2]) < near)
            & (local[:, 0] > x_low - _AROUND_M)
            & (local[:, 0] < x_high + _AROUND_M)
            & (local[:, 1] > y_low - _AROUND_M)
            & (local[:, 1] < y_high + _AROUND_M)
        )
    if not is_wall.any():
        return view
    depth = view.depth_m.copy()
    depth[seen] += np.where(is_wall, np.float32(_BACK_M), np.float32(0.0))
    return replace(view, depth_m=depth)
