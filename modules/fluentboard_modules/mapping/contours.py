"""Pixels of a planar segment to its contour on the plane.

No union of grid boxes: an organised image already knows its outline, so the outline is traced in
the image and its vertices are cast onto the plane. A ray meets a plane in one point, so the contour
neither breaks up where the points thin out with distance nor takes over their depth noise.
"""

from __future__ import annotations

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import GeometryCollection, MultiPolygon, Polygon

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.frames.sensor_frame import Camera
from fluentboard_modules.mapping.config import ContourConfig
from fluentboard_modules.mapping.planar_region import as_multipolygon


def trace_contour(
    mask: NDArray[np.bool_],
    origin_cell: tuple[int, int],
    step_px: int,
    camera: Camera,
    plane: FloatArray,
    T_camera_region: FloatArray,
    config: ContourConfig,
) -> MultiPolygon:
    """The outline with holes of a segment, in metres on its plane.

    Args:
        mask: `(h, w)`; cells of the segment within its bounding rectangle.
        origin_cell: row and column of the rectangle in the image of cells.
        step_px: pixels per cell.
        camera: the depth camera.
        plane: `(3,)`; m = n / d of the segment in the camera frame.
        T_camera_region: `(4, 4)`; region coordinates to camera coordinates.
        config: tolerances.
    """
    # One cell becomes 2x2 with an empty frame, so that the traced outline runs half a cell outside
    # the centres, and closing bridges single missing cells.
    bold = np.pad(mask.repeat(2, axis=0).repeat(2, axis=1).astype(np.uint8), 4)
    bold = cv2.morphologyEx(bold, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    rings, hierarchy = cv2.findContours(bold, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    if hierarchy is None:
        return MultiPolygon()
    on_plane = [
        _cast(
            ring[:, 0, :].astype(np.float64), origin_cell, step_px, camera, plane, T_camera_region
        )
        for ring in rings
    ]
    parts: list[Polygon] = []
    for ring, (_, _, _, parent) in enumerate(hierarchy[0]):
        if parent >= 0 or len(rings[ring]) < 3:
            continue
        holes = [
            on_plane[child]
            for child, (_, _, _, its_parent) in enumerate(hierarchy[0])
            if its_parent == ring and len(rings[child]) >= 3
        ]
        parts.append(Polygon(on_plane[ring], holes))
    return tidy(MultiPolygon(parts), config)


def tidy(contour: MultiPolygon, config: ContourConfig) -> MultiPolygon:
    """Valid, simplified, without specks and pinholes."""
    pieces = shapely.get_parts(contour)
    is_valid = shapely.is_valid(pieces)
    if not is_valid.all():  # outlines that touch themselves in a corner
        mended = as_multipolygon(
            GeometryCollection(shapely.make_valid(pieces[~is_valid], method="structure").tolist())
        )
        contour = MultiPolygon([*pieces[is_valid], *mended.geoms])
        if not contour.is_valid:
            contour = as_multipolygon(shapely.make_valid(contour))
    simple = as_multipolygon(contour.simplify(config.simplify_m, preserve_topology=True))
    pieces = shapely.get_parts(simple)
    whole = shapely.polygons(shapely.get_exterior_ring(pieces)) if len(pieces) else pieces
    kept = shapely.area(whole) >= config.smallest_part_m2
    n_holes = shapely.get_num_interior_rings(pieces)
    return MultiPolygon(
        [
            without_pinholes(piece, config.smallest_hole_m2) if holes else piece
            for piece, holes in zip(pieces[kept], n_holes[kept], strict=True)
        ]
    )


def without_pinholes(polygon: Polygon, smallest_m2: float) -> Polygon:
    """The polygon with its larger holes only."""
    holes = np.array(polygon.interiors, dtype=object)
    large = shapely.area(shapely.polygons(holes)) >= smallest_m2
    return polygon if large.all() else Polygon(polygon.exterior, list(holes[large]))


def _cast(
    vertices: FloatArray,
    origin_cell: tuple[int, int],
    step_px: int,
    camera: Camera,
    plane: FloatArray,
    T_camera_region: FloatArray,
) -> FloatArray:
    """Where the rays through vertices `(n, 2)` of the bold mask meet the plane, region x and y."""
    row, column = origin_cell
    # Undo padding and doubling; cell k covers the pixels around k * step_px.
    u = ((vertices[:, 0] - 4.0) / 2.0 - 0.25 + column) * step_px
    v = ((vertices[:, 1] - 4.0) / 2.0 - 0.25 + row) * step_px
    rays = np.column_stack(
        [(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(len(u))]
    )
    # Near the horizon of the plane the ray meets it far away or behind; 10 m bounds the damage.
    inverse_depth = np.maximum(rays @ plane, 0.1)
    points = rays / inverse_depth[:, None]
    return (points - T_camera_region[:3, 3]) @ T_camera_region[:3, :2]
