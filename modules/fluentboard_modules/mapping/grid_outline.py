"""Regions to the cells of a map plane, and its cells to the outline of a region."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from shapely.affinity import affine_transform
from shapely.geometry import MultiPolygon, Polygon

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.mapping.config import FusionConfig
from fluentboard_modules.mapping.contours import tidy
from fluentboard_modules.mapping.planar_region import PlanarRegion, as_multipolygon, upright_axes

_LEVEL_COS = np.cos(np.deg2rad(20.0))  # flatter, x follows the longer side


def covered_cells(region: PlanarRegion, T_map_grid: Transform, cell_m: float) -> NDArray[np.int32]:
    """Column and row numbers `(n, 2)` of the cells a region covers, seen along the grid's normal.

    Args:
        region: map frame.
        T_map_grid: grid frame to map frame.
        cell_m: edge of a cell.
    """
    rotation, translation = T_map_grid.rotation, T_map_grid.translation
    rings = [(ring - translation) @ rotation for ring in region.rings_map()]
    corners = np.concatenate(rings)[:, :2]
    low = np.floor(corners.min(axis=0) / cell_m).astype(int)
    size = np.floor(corners.max(axis=0) / cell_m).astype(int) - low + 1
    # Filling includes the pixels under the outline, so it is done with four pixels per cell, of
    # which two must be inside. Even-odd filling leaves the holes open.
    image = np.zeros((2 * int(size[1]), 2 * int(size[0])), np.uint8)
    pixels = [
        np.round(((ring[:, :2] / cell_m - low) * 2.0 - 0.5) * 16.0).astype(np.int32)
        for ring in rings
    ]
    cv2.fillPoly(image, pixels, 1, lineType=cv2.LINE_8, shift=4)
    quarters = image[::2, ::2] + image[1::2, ::2] + image[::2, 1::2] + image[1::2, 1::2]
    rows, columns = np.nonzero(quarters >= 2)
    if rows.size == 0:  # a sliver, thinner than a cell
        middle = (region.centroid - translation) @ rotation
        return np.floor(middle[None, :2] / cell_m).astype(np.int32)
    return np.column_stack([columns + low[0], rows + low[1]]).astype(np.int32)


def without_fringe(
    solid: NDArray[np.bool_], hits: NDArray[np.int32], config: FusionConfig
) -> NDArray[np.bool_]:
    """Cells without the fringe that only a stray frame saw, gaps of a cell closed.

    Args:
        solid: `(h, w)`; the cells.
        hits: `(h, w)`; frames that saw each.
        config: what is a fringe.
    """
    best = int(hits.max(initial=0))
    least = max(1, int(np.ceil(config.fringe_share * min(best, config.fringe_frames))))
    padded = np.pad((solid & (hits >= least)).astype(np.uint8), 2)
    closed = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    return closed[2:-2, 2:-2].astype(np.bool_)


def outline_of_cells(
    solid: NDArray[np.bool_], corner: tuple[int, int], config: FusionConfig
) -> MultiPolygon:
    """The outline of a set of cells in the grid's x and y, metres.

    Args:
        solid: `(h, w)`; the cells.
        corner: column and row number of the first.
        config: size of a cell and how outlines are simplified.
    """
    return tidy(_outline(solid, corner, config.cell_m), config.contours)


def placed_outline(
    contour: MultiPolygon,
    solid: NDArray[np.bool_],
    cell_m: float,
    T_map_grid: Transform,
    fit: FloatArray,
) -> tuple[Transform, MultiPolygon]:
    """A region's own frame at the centroid of an outline, and the outline in it.

    Args:
        contour: in the grid's x and y.
        solid: `(h, w)`; the cells it goes around.
        cell_m: edge of a cell.
        T_map_grid: grid frame to map frame.
        fit: `(3,)`; slopes a, b and height c of the plane z = a x + b y + c in the grid frame.
    """
    a, b, c = fit
    normal = T_map_grid.rotation @ (-a, -b, 1.0)
    normal /= np.sqrt(a * a + b * b + 1.0)
    direction = None
    if abs(normal[2]) > _LEVEL_COS:
        rows, columns = np.nonzero(solid)
        spread = np.column_stack([columns, rows]) * cell_m
        covariance = np.cov(spread.T) if len(spread) > 2 else np.eye(2)
        longest = np.linalg.eigh(covariance)[1][:, 1]
        direction = T_map_grid.rotate(np.array([longest[0], longest[1], 0.0]))
        direction *= 1.0 if direction[np.argmax(np.abs(direction))] > 0.0 else -1.0
    axes = upright_axes(normal, direction)
    centre = contour.centroid
    origin = np.array([centre.x, centre.y, a * centre.x + b * centre.y + c])
    T_map_region = Transform.from_parts(axes, T_map_grid.apply(origin))
    # The grid's slope against the fitted plane is a few degrees at most: lengths keep to 0.2 %.
    r = (T_map_region.inverse() @ T_map_grid).rotation
    contour = affine_transform(
        contour,
        [
            r[0, 0],
            r[0, 1],
            r[1, 0],
            r[1, 1],
            -float(r[0, :2] @ (centre.x, centre.y)),
            -float(r[1, :2] @ (centre.x, centre.y)),
        ],
    )
    return T_map_region, as_multipolygon(contour)


def _outline(solid: NDArray[np.bool_], corner: tuple[int, int], cell_m: float) -> MultiPolygon:
    """The boundary of a set of cells, along the cells' edges."""
    # Two pixels per cell: outlines run through pixel centres, a quarter of a cell inside the edge.
    bold = np.pad(solid, 1).repeat(2, axis=0).repeat(2, axis=1).astype(np.uint8)
    rings, hierarchy = cv2.findContours(bold, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    if hierarchy is None:
        return MultiPolygon()
    scaled = [
        ((ring[:, 0, :].astype(np.float64) + 0.5) / 2.0 - 1.0 + corner) * cell_m for ring in rings
    ]
    parts: list[Polygon] = []
    for ring, (_, _, _, parent) in enumerate(hierarchy[0]):
        if parent >= 0 or len(scaled[ring]) < 3:
            continue
        holes = [
            scaled[child]
            for child, (_, _, _, its_parent) in enumerate(hierarchy[0])
            if its_parent == ring and len(scaled[child]) >= 3
        ]
        parts.append(Polygon(scaled[ring], holes))
    return MultiPolygon(parts)
