"""Pixels above a top, and which of them belong together (compiled)."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def rises(points, sigma, near, corner, cell, top, config):
    """Per pixel 0 for nothing, 1 on the top, 2 above it, 3 for anything else; and its rise.

    The rise is the height above the top, `(h, w)` float32, NaN where there is no point near it.

    Args:
        points: `(h, w, 3)` float32, NaN where unknown.
        sigma: `(h, w)` float32; standard deviation of the height.
        near: `(nx, ny)` uint8; cells that belong to the top or its surroundings.
        corner: `(2,)`; where the first cell begins.
        cell: size of a cell in metres.
        top: `(8,)`; centre and coefficients of the top.
        config: `(3,)`; rise, its factor on sigma, highest rise.
    """
    height, width = sigma.shape
    rise = np.full((height, width), np.nan, dtype=np.float32)
    kind = np.zeros((height, width), dtype=np.uint8)
    for v in range(height):
        for u in range(width):
            z = points[v, u, 2]
            if np.isnan(z):
                continue
            kind[v, u] = 3
            i = int(np.floor((points[v, u, 0] - corner[0]) / cell))
            j = int(np.floor((points[v, u, 1] - corner[1]) / cell))
            if i < 0 or j < 0 or i >= near.shape[0] or j >= near.shape[1] or near[i, j] == 0:
                continue
            x, y = points[v, u, 0] - top[0], points[v, u, 1] - top[1]
            level = top[2] + top[3] * x + top[4] * y + top[5] * x * x + top[6] * x * y
            level += top[7] * y * y
            rise[v, u] = z - level
    for v in range(height):
        for u in range(width):
            own = rise[v, u]
            if np.isnan(own):
                continue
            limit = config[0] + config[1] * sigma[v, u]
            near_m = 0.02 + 3.0 * sigma[v, u]
            # Where no mean of the neighbours could change it, none is taken.
            if own >= config[2] + near_m:
                kind[v, u] = 3
                continue
            if limit + near_m < own < config[2] - near_m:
                kind[v, u] = 2
                continue
            total, count = 0.0, 0
            for dv in range(-1, 2):
                for du in range(-1, 2):
                    a, b = v + dv, u + du
                    if a < 0 or b < 0 or a >= height or b >= width:
                        continue
                    # Across an edge the neighbours are no better readings of this pixel.
                    if abs(rise[a, b] - own) < near_m:
                        total += rise[a, b]
                        count += 1
            mean = total / count
            if mean >= config[2] or mean < -near_m:
                kind[v, u] = 3
            elif mean > limit:
                kind[v, u] = 2
            else:
                kind[v, u] = 1
    return kind, rise


@njit(cache=True)
def _root(parent, index):
    while parent[index] != index:
        parent[index] = parent[parent[index]]
        index = parent[index]
    return index


@njit(cache=True)
def join_pixels(kind, points, depth, step, gap):
    """Connected parts of the pixels of kind 2: labels `(h, w)` int32 from 1, and their number.

    Args:
        kind: `(h, w)` uint8, as `rises` gives it.
        points: `(h, w, 3)` float32.
        depth: `(h, w)` float32.
        step: `(2,)`; largest step in depth between neighbours, and what adds per square metre.
        gap: how many pixels apart two neighbours may be.
    """
    height, width = kind.shape
    parent = np.arange(height * width, dtype=np.int32)
    for v in range(height):
        for u in range(width):
            if kind[v, u] != 2:
                continue
            here = v * width + u
            d = depth[v, u]
            limit = step[0] + step[1] * d * d
            for direction in range(4):
                for away in range(1, gap + 1):
                    if direction == 0:
                        a, b = v, u + away
                    elif direction == 1:
                        a, b = v + away, u
                    elif direction == 2:
                        a, b = v + away, u + away
                    else:
                        a, b = v + away, u - away
                    if a >= height or b < 0 or b >= width:
                        break
                    if kind[a, b] != 2:
                        continue
                    if abs(depth[a, b] - d) < limit * away:
                        first, second = _root(parent, here), _root(parent, a * width + b)
                        if first != second:
                            parent[max(first, second)] = min(first, second)
                    break  # what lies behind the next point is not a neighbour
    labels = np.zeros((height, width), dtype=np.int32)
    number = 0
    for v in range(height):
        for u in range(width):
            if kind[v, u] != 2:
                continue
            root = _root(parent, v * width + u)
            a, b = root // width, root % width
            if labels[a, b] == 0:
                number += 1
                labels[a, b] = number
            labels[v, u] = labels[a, b]
    return labels, number


@njit(cache=True)
def windows(labels, count):
    """`(count + 1, 5)` int64; per label its pixels, first and last row, first and last column.

    Args:
        labels: `(h, w)` int32; 0 is nothing.
        count: the highest label.
    """
    height, width = labels.shape
    found = np.zeros((count + 1, 5), dtype=np.int64)
    found[:, 1], found[:, 3] = height, width
    for v in range(height):
        for u in range(width):
            label = labels[v, u]
            if label == 0:
                continue
            found[label, 0] += 1
            found[label, 1], found[label, 2] = min(found[label, 1], v), max(found[label, 2], v)
            found[label, 3], found[label, 4] = min(found[label, 3], u), max(found[label, 4], u)
    return found


@njit(cache=True)
def nearest_distance(first, second, enough):
    """Least distance between points `(n, 3)` and `(m, 3)`; stops when it is below `enough`."""
    least = np.inf
    for i in range(first.shape[0]):
        for j in range(second.shape[0]):
            x = first[i, 0] - second[j, 0]
            y = first[i, 1] - second[j, 1]
            z = first[i, 2] - second[j, 2]
            least = min(least, x * x + y * y + z * z)
        if least < enough * enough:
            break
    return np.sqrt(least)
