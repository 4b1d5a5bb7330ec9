"""Compiled loops of view sampling: poses by interval propagation, and what rays reveal."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from fluentboard_modules.search.occupancy_kernels import (
    block_at,
    cell_in_block,
)
from fluentboard_modules.search.plan_kernels import uniform
from fluentboard_modules.search.ray_kernels import (
    along_axis,
    end_of_block,
    enter_block,
    next_cell,
)

_jit: Any = numba.njit(cache=True, nogil=True, error_model="numpy")

OCCUPIED_BIT, UNKNOWN_BIT, WANTED_BIT = 1, 2, 4
CANDIDATE_COLUMNS = 6
_STOPS_AFTER = 0.98
"""Sides of a cell that a ray goes through occupied cells before it ends.

A surface fills only a part of the cells that it touches, so a ray that clips their corners mostly
gets past. A layer of occupied cells still stops all rays: none crosses it in less than a side.
"""


@_jit
def sample_poses(
    centres: Any,
    normals: Any,
    heights: Any,
    tilts: Any,
    ranges: Any,
    camera_x: float,
    costs: Any,
    resolution: float,
    corner: Any,
    tries: int,
    seed: Any,
    poses: Any,
    targets: Any,
) -> Any:
    """Sensor poses that look at frontier cells and obey all constraints of Section 5.2.1.

    The height difference, the distance and the azimuth are drawn one after the other, each from
    the interval that the constraints and the earlier draws leave: sensor range, camera height,
    pitch, and the side of the frontier's plane. Only where the base may stand is left to trial.

    Args:
        centres: `(n, 3)`; frontier cells.
        normals: `(n, 3)`; towards the known side.
        heights: `(2,)`; of the camera.
        tilts: `(2,)`; of the line of sight, positive downwards.
        ranges: `(2,)`; of the sensor.
        camera_x: of the camera ahead of the base.
        costs: `(rows, columns)`; path costs from where the robot is, infinite where it cannot go.
        resolution: of `costs`.
        corner: `(2,)`; of `costs`.
        tries: how many cells to draw at most.
        seed: `(1,)` uint64; state of the random numbers.
        poses: `(m, 6)`; filled with base x, base y, camera height, azimuth, tilt, distance.
        targets: `(m,)`; filled with the numbers of the cells aimed at.

    Returns:
        How many poses were found and how many cells were drawn.
    """
    found = 0
    drawn = 0
    while found < poses.shape[0] and drawn < tries:
        drawn += 1
        f = int(uniform(seed) * centres.shape[0])
        nx, ny, nz = normals[f, 0], normals[f, 1], normals[f, 2]
        # Height difference: the torso's reach, cut to what range and pitch allow.
        low = max(heights[0] - centres[f, 2], _lowest(ranges, tilts[0]))
        high = min(heights[1] - centres[f, 2], _highest(ranges, tilts[1]))
        if low > high:
            continue
        dz = low + uniform(seed) * (high - low)
        # Distance over ground: range and pitch, given the height difference.
        near = math.sqrt(max(0.0, ranges[0] * ranges[0] - dz * dz))
        far = math.sqrt(max(0.0, ranges[1] * ranges[1] - dz * dz))
        if dz > 0.0:
            if tilts[1] <= 0.0:
                continue
            if tilts[1] < 1.5707:
                near = max(near, dz / math.tan(tilts[1]))
            if tilts[0] > 0.0:
                far = min(far, dz / math.tan(tilts[0]))
        elif dz < 0.0:
            if tilts[0] >= 0.0:
                continue
            if tilts[0] > -1.5707:
                near = max(near, dz / math.tan(tilts[0]))
            if tilts[1] < 0.0:
                far = min(far, dz / math.tan(tilts[1]))
        elif tilts[0] > 0.0 or tilts[1] < 0.0:
            continue
        if near > far:
            continue
        # Uniform in area.
        away = math.sqrt(near * near + uniform(seed) * (far * far - near * near))
        # Azimuth of the sensor as seen from the cell: on the normal's side.
        across = math.hypot(nx, ny) * away
        middle = math.atan2(ny, nx)
        if across > 1e-9:
            cosine = -nz * dz / across
            if cosine >= 1.0:
                continue
            half = math.pi if cosine <= -1.0 else math.acos(cosine)
        elif nz * dz < 0.0:
            continue
        else:
            half = math.pi
        azimuth = middle + (2.0 * uniform(seed) - 1.0) * half
        c, s = math.cos(azimuth), math.sin(azimuth)
        # The camera looks back along the azimuth; the base is `camera_x` behind it.
        x = centres[f, 0] + (away + camera_x) * c
        y = centres[f, 1] + (away + camera_x) * s
        row = math.floor((y - corner[1]) / resolution)
        column = math.floor((x - corner[0]) / resolution)
        if row < 0 or column < 0 or row >= costs.shape[0] or column >= costs.shape[1]:
            continue
        if not costs[row, column] < np.inf:
            continue
        poses[found, 0] = x
        poses[found, 1] = y
        poses[found, 2] = centres[f, 2] + dz
        poses[found, 3] = math.atan2(-s, -c)
        poses[found, 4] = math.atan2(dz, away)
        poses[found, 5] = math.hypot(away, dz)
        targets[found] = f
        found += 1
    return found, drawn


@_jit
def _lowest(ranges: Any, tilt: float) -> float:
    """The least height difference that a pitch allows at any range."""
    return min(ranges[0] * math.sin(tilt), ranges[1] * math.sin(tilt))


@_jit
def _highest(ranges: Any, tilt: float) -> float:
    return max(ranges[0] * math.sin(tilt), ranges[1] * math.sin(tilt))


@_jit
def block_content(log_odds: Any, numbers: Any, content: Any) -> None:
    """Per block, which of the three bits above apply to it."""
    for b in range(log_odds.shape[0]):
        found = 0
        for c in range(512):
            value = log_odds[b, c]
            if value >= 0.0:
                found |= OCCUPIED_BIT
            elif value != value:
                found |= UNKNOWN_BIT
            if numbers[b, c] >= 0:
                found |= WANTED_BIT
        content[b] = found


@_jit
def number_cells(directory: Any, low: Any, cells: Any, numbers: Any, numbering: Any) -> None:
    """Enters numbers of cells into a per-block table."""
    for n in range(cells.shape[0]):
        i, j, k = cells[n, 0], cells[n, 1], cells[n, 2]
        b = block_at(directory, low, i >> 3, j >> 3, k >> 3)
        numbers[b, cell_in_block(i, j, k)] = numbering[n]


@_jit
def _reach_of(
    ox: float, oy: float, oz: float, ux: float, uy: float, uz: float, boxes: Any, limit: float
) -> float:
    """Length of a ray to where it leaves the last of some boxes; 0 if it passes none."""
    # No infinity, whose product with 0 would be no number.
    ix = 1.0 / ux if ux != 0.0 else 1e300
    iy = 1.0 / uy if uy != 0.0 else 1e300
    iz = 1.0 / uz if uz != 0.0 else 1e300
    reach = 0.0
    for n in range(boxes.shape[0]):
        ax, bx = (boxes[n, 0] - ox) * ix, (boxes[n, 3] - ox) * ix
        ay, by = (boxes[n, 1] - oy) * iy, (boxes[n, 4] - oy) * iy
        az, bz = (boxes[n, 2] - oz) * iz, (boxes[n, 5] - oz) * iz
        enter = max(0.0, min(ax, bx), min(ay, by), min(az, bz))
        leave = min(limit, max(ax, bx), max(ay, by), max(az, bz))
        if enter <= leave:
            reach = max(reach, leave)
    return reach


@_jit
def reveal(
    origin: Any,
    rotation: Any,
    rays: Any,
    range_min: float,
    range_max: float,
    boxes: Any,
    unknown_max: int,
    resolution: float,
    directory: Any,
    low: Any,
    log_odds: Any,
    numbers: Any,
    content: Any,
    stamp: Any,
    mark: int,
    out: Any,
) -> int:
    """Numbers of the wanted cells that a bundle of rays traverses, each once.

    A ray ends in occupied cells (see `_STOPS_AFTER`), at its range, or after `unknown_max` unknown
    cells.

    Args:
        origin: `(3,)`; of the sensor.
        rotation: `(3, 3)`; sensor to map.
        rays: `(n, 3)`; unit directions in the sensor frame.
        range_min: nearer cells are not seen.
        range_max: how far rays go.
        boxes: `(m, 6)`; low and high corners of boxes that hold all wanted cells: rays end behind
            the last of those they pass, and what passes none of them is no ray.
        unknown_max: how many unknown cells a ray passes.
        resolution: of the map.
        directory: of the map.
        low: of the map.
        log_odds: of the map.
        numbers: `(blocks, 512)`; number of each wanted cell, -1 for the others.
        content: `(blocks,)`; see `block_content`.
        stamp: `(cells,)`; last mark of each cell.
        mark: of this view.
        out: room for the numbers.

    Returns:
        How many there are.
    """
    count = 0
    ox, oy, oz = origin[0], origin[1], origin[2]
    per_metre = 1.0 / resolution
    solid_max = _STOPS_AFTER * resolution
    # Where there is nothing to stop at and nothing to see, a ray leaves the block at once.
    stops_in = OCCUPIED_BIT | WANTED_BIT | (UNKNOWN_BIT if unknown_max < 1_000_000 else 0)
    for r in range(rays.shape[0]):
        ux = rotation[0, 0] * rays[r, 0] + rotation[0, 1] * rays[r, 1] + rotation[0, 2] * rays[r, 2]
        uy = rotation[1, 0] * rays[r, 0] + rotation[1, 1] * rays[r, 1] + rotation[1, 2] * rays[r, 2]
        uz = rotation[2, 0] * rays[r, 0] + rotation[2, 1] * rays[r, 1] + rotation[2, 2] * rays[r, 2]
        reach = _reach_of(ox, oy, oz, ux, uy, uz, boxes, range_max)
        if reach <= 0.0:
            continue
        x, sx, tx, dx, ix = along_axis(ox, ux, resolution, per_metre)
        y, sy, ty, dy, iy = along_axis(oy, uy, resolution, per_metre)
        z, sz, tz, dz, iz = along_axis(oz, uz, resolution, per_metre)
        bx, by, bz = x >> 3, y >> 3, z >> 3
        ex = end_of_block(x, sx, tx, dx)
        ey = end_of_block(y, sy, ty, dy)
        ez = end_of_block(z, sz, tz, dz)
        travelled = 0.0
        passed = 0
        solid = 0.0
        while travelled <= reach:
            b = block_at(directory, low, bx, by, bz)
            inside = UNKNOWN_BIT if b < 0 else content[b]
            if inside & stops_in != 0:
                i, cx = enter_block(bx, travelled, x, sx, tx, dx, ix)
                j, cy = enter_block(by, travelled, y, sy, ty, dy, iy)
                k, cz = enter_block(bz, travelled, z, sz, tz, dz, iz)
                while (i | j | k) & ~7 == 0 and travelled <= reach:
                    value = np.float32(np.nan)
                    if b >= 0:
                        c = np.uint64((i << 6) | (j << 3) | k)
                        value = log_odds[np.uint64(b), c]
                        number = numbers[np.uint64(b), c]
                        if number >= 0 and travelled >= range_min and stamp[number] != mark:
                            stamp[number] = mark
                            out[count] = number
                            count += 1
                    if value >= 0.0:
                        solid += min(cx, cy, cz) - travelled
                    elif value != value:
                        passed += 1
                    if solid >= solid_max or passed > unknown_max:
                        break
                    i, j, k, cx, cy, cz, travelled = next_cell(
                        i, j, k, sx, sy, sz, cx, cy, cz, dx, dy, dz
                    )
                if solid >= solid_max or passed > unknown_max:
                    break
            bx, by, bz, ex, ey, ez, travelled = next_cell(
                bx, by, bz, sx, sy, sz, ex, ey, ez, 8.0 * dx, 8.0 * dy, 8.0 * dz
            )
    return count
