"""Tops that objects stand on, as one frame shows them (Section 4.2.1).

RANSAC among level patches, with gravity as a prior: hypotheses come from three patches of about one
height, and those that are not nearly level are refused. Real depth cameras bend a table by a degree
or two, so the last fit is of second order. What lies in one plane may still be several tables:
inliers are separated by gaps, and every part gets an outline of its own, of any shape.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.config import SupportConfig
from fluentboard_modules.anchoring.extents import covered_cells, heights_above
from fluentboard_modules.anchoring.observation import SupportPlane
from fluentboard_modules.anchoring.organised import OrganisedPoints, patches

_STEP_PX = 4
_BIN_M = 0.01
_NARROW_GAP_M = 0.06
_CURVED_FROM_M = 0.5  # smaller tops are fitted by a plane: noise would bend them
_CURVATURE_RIDGE = 0.05
_LEAST_PATCHES = 12
_VOTERS = 600
_STEEP_COSINE = 0.5  # of the normal with the vertical: 60 degrees
_SHADOW_M = 0.03


@dataclass(frozen=True, slots=True, eq=False)
class Raster:
    """A region of the map's x and y as cells of a grid.

    Attributes:
        inside: `(nx, ny)`; which cells belong to the region.
        origin: index of the first cell in x and y; cell i covers `[i, i + 1) * cell_m`.
        cell_m: size of a cell.
    """

    inside: NDArray[np.bool_]
    origin: tuple[int, int]
    cell_m: float

    @property
    def area_m2(self) -> float:
        """Area of the region."""
        return float(self.inside.sum()) * self.cell_m**2

    @property
    def corner_map(self) -> FloatArray:
        """`(2,)`; where the first cell begins."""
        return np.array(self.origin) * self.cell_m

    def outline(self) -> FloatArray:
        """`(k, 2)`; corners of the outline of its largest part, in order, without holes."""
        contours, _ = cv2.findContours(
            self.inside.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
        )
        largest = max(contours, key=cv2.contourArea)
        simple = cv2.approxPolyDP(largest, 1.0, True)[:, 0, ::-1]  # OpenCV has columns first
        return (simple + 0.5) * self.cell_m + self.corner_map

    def centre(self) -> FloatArray:
        """`(2,)`; centre of area."""
        cells = np.argwhere(self.inside)
        return (cells.mean(axis=0) + 0.5) * self.cell_m + self.corner_map

    def covers(self, points_map: FloatArray) -> NDArray[np.bool_]:
        """`(n,)`; which points `(n, 2)` or `(n, 3)` lie in the region."""
        return covered_cells(points_map, self.cell_m, *self.origin, self.inside)

    def borders(self, points_map: FloatArray, width_m: float) -> bool:
        """Whether most of the points `(n, 2)` or `(n, 3)` lie within a strip along the border."""
        return bool(self.core(width_m).covers(points_map).mean() < 0.5)

    def core(self, width_m: float) -> Raster:
        """The region without a strip along its border."""
        size = 2 * math.ceil(width_m / self.cell_m) + 1
        core = cv2.erode(np.pad(self.inside.astype(np.uint8), 1), np.ones((size, size), np.uint8))
        return Raster(core[1:-1, 1:-1].astype(bool), self.origin, self.cell_m)


@dataclass(frozen=True, slots=True, eq=False)
class Top:
    """A support plane in one frame.

    Attributes:
        raster: its extent.
        centre_map: `(2,)`; origin of the fit.
        coefficients: `(6,)`; height = c0 + c1 x + c2 y + c3 x^2 + c4 x y + c5 y^2, with x and y
            from the centre.
        name: of its placing area on the board, or empty.
    """

    raster: Raster
    centre_map: FloatArray
    coefficients: FloatArray
    name: str = ""

    def height_at(self, points_map: FloatArray) -> FloatArray:
        """`(n,)`; height of the top at points `(n, 2)` or `(n, 3)`."""
        return heights_above(points_map, self.centre_map, self.coefficients)

    def support(self) -> SupportPlane:
        """The same for recognisers and context models."""
        centre = self.raster.centre()
        away = centre - self.centre_map
        _, bx, by, bxx, bxy, byy = self.coefficients.tolist()
        slope = (
            bx + 2.0 * bxx * away[0] + bxy * away[1],
            by + 2.0 * byy * away[1] + bxy * away[0],
        )
        height = float(self.height_at(centre[None])[0])
        return SupportPlane(height, self.raster.outline(), centre, self.name, slope)


def find_tops(
    points: OrganisedPoints, config: SupportConfig, rng: np.random.Generator
) -> list[Top]:
    """The tops in view, largest first, and parts of tops down to `known_area_min_m2`.

    Args:
        points: of the frame.
        config: what a top is.
        rng: draws the samples.
    """
    means = patches(points.points_map, points.depth_m, _STEP_PX).astype(np.float64)
    level, steep, area = _level_patches(means, points, config)
    centres, areas = means[level], area[level]
    everything = means[np.isfinite(means[..., 0]) & ~steep]
    tops: list[Top] = []
    for _ in range(2 * config.tops_max):
        if len(centres) < _LEAST_PATCHES:
            break
        near = _one_height(centres, areas, config)
        if near is None:
            break
        fitted = _fit(centres[near], config, rng)
        if fitted is None:
            keep = np.ones(len(centres), dtype=bool)
            keep[np.flatnonzero(near)] = False
            centres, areas = centres[keep], areas[keep]
            continue
        origin, coefficients = fitted
        away = centres[:, 2] - heights_above(centres, origin, coefficients)
        support = np.abs(away) < 2.0 * config.tolerance_m
        # Beside an object or an edge local normals are bad; being at the right height will do.
        off = everything[:, 2] - heights_above(everything, origin, coefficients)
        lying = everything[np.abs(off) < 2.0 * config.tolerance_m]
        for raster in _parts(centres[support], lying, config):
            if raster.area_m2 >= config.known_area_min_m2:
                top = Top(raster, origin, coefficients)
                tops.append(_with_shadows(top, points))
        taken = np.abs(away) < max(0.03, 3.0 * config.tolerance_m)
        if not taken.any():
            taken = near
        centres, areas = centres[~taken], areas[~taken]
    tops.sort(key=lambda top: -top.raster.area_m2)
    return tops[: config.tops_max]


def _level_patches(
    means: FloatArray, points: OrganisedPoints, config: SupportConfig
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], FloatArray]:
    """Which patches are level, which stand upright, and the horizontal area of the level ones."""
    across = np.full(means.shape, np.nan)
    down = np.full(means.shape, np.nan)
    across[:, 1:-1] = means[:, 2:] - means[:, :-2]
    down[1:-1] = means[2:] - means[:-2]
    normal = np.cross(across, down)
    length = np.linalg.norm(normal, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        steepness = np.abs(normal[..., 2]) / length
        height = means[..., 2]
        camera_m = points.viewpoint_map[2]
        is_top = (height > config.height_min_m) | (height > camera_m - config.floor_below_camera_m)
        level = (
            (steepness > math.cos(math.radians(config.level_deg)))
            & is_top
            & (height < min(config.height_max_m, camera_m))
        )
        steep = steepness < _STEEP_COSINE
    return level, steep, np.where(level, 0.25 * np.abs(normal[..., 2]), 0.0)


def _one_height(
    centres: FloatArray, areas: FloatArray, config: SupportConfig
) -> NDArray[np.bool_] | None:
    """Patches about the most frequent height; None if they are too few for a top."""
    low = centres[:, 2].min() - 5 * _BIN_M
    bins = ((centres[:, 2] - low) / _BIN_M).astype(np.int64)
    histogram = np.convolve(np.bincount(bins, areas), np.ones(5), mode="same")
    peak = int(np.argmax(histogram))
    if histogram[peak] < 0.5 * config.known_area_min_m2:
        return None
    return np.abs(centres[:, 2] - (low + (peak + 0.5) * _BIN_M)) < 0.07


def _fit(
    centres: FloatArray, config: SupportConfig, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray] | None:
    """RANSAC plane through patches, refined to second order; None if none is nearly level."""
    picks = rng.integers(0, len(centres), size=(config.samples, 3))
    a, b, c = (centres[picks[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    usable = lengths > 1e-4
    normals, a = normals[usable] / lengths[usable, None], a[usable]
    upright = np.abs(normals[:, 2]) > math.cos(math.radians(config.tilt_max_deg))
    # The level plane through the median height is one more hypothesis, and always a fair one.
    normals = np.vstack([normals[upright], [0.0, 0.0, 1.0]])
    middle = np.array([0.0, 0.0, float(np.median(centres[:, 2]))])
    anchors = np.vstack([a[upright], middle])
    offsets = np.sum(normals * anchors, axis=1)
    voters = centres[:: max(1, len(centres) // _VOTERS)]
    away = np.abs(voters @ normals.T - offsets)
    best = int(np.argmin(np.clip(away / (1.5 * config.tolerance_m), 0.0, 1.0).sum(axis=0)))
    inliers = centres[np.abs(centres @ normals[best] - offsets[best]) < 1.5 * config.tolerance_m]
    if len(inliers) < _LEAST_PATCHES:
        return None
    origin = inliers[:, :2].mean(axis=0)
    coefficients = np.zeros(6)
    for order in (3, 3, 6, 6):
        if order == 6 and np.ptp(inliers[:, :2], axis=0).max() < _CURVED_FROM_M:
            break
        terms = _terms(inliers[:, :2] - origin)[:, :order]
        ridge = np.diag([0.0, 0.0, 0.0, *[_CURVATURE_RIDGE] * 3][:order]) * len(inliers) * 0.01
        coefficients = np.zeros(6)
        coefficients[:order] = np.linalg.solve(
            terms.T @ terms + ridge + 1e-9 * np.eye(order), terms.T @ inliers[:, 2]
        )
        away = centres[:, 2] - heights_above(centres, origin, coefficients)
        kept = np.abs(away) < 2.0 * config.tolerance_m
        if kept.sum() < _LEAST_PATCHES:
            return None
        inliers = centres[kept]
    tilt = math.hypot(coefficients[1], coefficients[2])
    if tilt > math.tan(math.radians(config.tilt_max_deg)):
        return None
    return origin, coefficients


def _with_shadows(top: Top, points: OrganisedPoints) -> Top:
    """The top with what objects hide of it: where it would be convex and nothing denies it."""
    raster = top.raster
    cells = np.argwhere(raster.inside)[:, ::-1].astype(np.int32)
    hull = np.zeros(raster.inside.shape, dtype=np.uint8)
    cv2.fillConvexPoly(hull, cv2.convexHull(cells), 1)
    missing = np.argwhere((hull > 0) & ~raster.inside)
    if not len(missing):
        return top
    flat = (missing + 0.5) * raster.cell_m + raster.corner_map
    hidden = points.is_hidden(np.column_stack([flat, top.height_at(flat)]), _SHADOW_M)
    inside = raster.inside.copy()
    inside[tuple(missing[hidden].T)] = True
    whole = _closed(inside.astype(np.uint8), _NARROW_GAP_M / raster.cell_m).astype(bool)
    return replace(top, raster=replace(raster, inside=whole))


def _parts(seeds: FloatArray, lying: FloatArray, config: SupportConfig) -> list[Raster]:
    """Connected regions of patches, each with its gaps closed.

    Args:
        seeds: `(n, 3)`; level patches of the plane: a region has some.
        lying: `(m, 3)`; all patches at its height.
        config: size of cells and gaps.
    """
    if len(seeds) < _LEAST_PATCHES:
        return []
    cell = config.cell_m
    margin = math.ceil(config.gap_m / cell) + 1
    low = np.floor(seeds[:, :2].min(axis=0) / cell).astype(np.int64) - margin
    high = np.floor(seeds[:, :2].max(axis=0) / cell).astype(np.int64) + margin
    shape = high - low + 1
    level = _rasterise(seeds, low, shape, cell)
    count, parts = cv2.connectedComponents(_closed(level, _NARROW_GAP_M / cell), connectivity=4)
    rest = _rasterise(lying, low, shape, cell)
    found: list[Raster] = []
    for number in range(1, count):
        part = (parts == number).astype(np.uint8)
        if part.sum() * cell**2 < 0.5 * config.known_area_min_m2:
            continue
        reach = cv2.dilate(part, np.ones((3, 3), np.uint8))
        whole = _closed(part | (rest & reach), config.gap_m / cell)
        contours, _ = cv2.findContours(whole, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        filled = cv2.drawContours(np.zeros_like(whole), contours, -1, 1, cv2.FILLED)
        found.append(Raster(filled.astype(bool), (int(low[0]), int(low[1])), cell))
    return found


def _rasterise(
    points_map: FloatArray, low: NDArray[np.int64], shape: NDArray[np.int64], cell_m: float
) -> NDArray[np.uint8]:
    cells = np.floor(points_map[:, :2] / cell_m).astype(np.int64) - low
    within = np.all((cells >= 0) & (cells < shape), axis=1)
    raster = np.zeros(tuple(shape.tolist()), dtype=np.uint8)
    raster[tuple(cells[within].T)] = 1
    return raster


def _closed(raster: NDArray[np.uint8], cells: float) -> NDArray[np.uint8]:
    size = 2 * round(0.5 * cells) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    return np.asarray(cv2.morphologyEx(raster, cv2.MORPH_CLOSE, kernel), dtype=np.uint8)


def _terms(away: FloatArray) -> FloatArray:
    x, y = away[..., 0], away[..., 1]
    terms = np.ones((*x.shape, 6))
    terms[..., 1], terms[..., 2], terms[..., 3] = x, y, x * x
    terms[..., 4], terms[..., 5] = x * y, y * y
    return terms
