"""Prisms: the convex pieces of a thing as footprints with a height range."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fluentboard.model.geometry import FloatArray


@dataclass(frozen=True, eq=False)
class Prism:
    """A convex footprint between two heights.

    Attributes:
        outline: `(k, 2)`; counter-clockwise corners in the map frame.
        z_low: metres.
        z_high: metres.
    """

    outline: FloatArray
    z_low: float
    z_high: float

    @cached_property
    def bounds(self) -> FloatArray:
        """`(2, 3)`; lowest and highest coordinates."""
        low, high = self.outline.min(axis=0), self.outline.max(axis=0)
        return np.array([[*low, self.z_low], [*high, self.z_high]])


def convex_outline(points: FloatArray) -> FloatArray:
    """`(k, 2)`; the convex hull of the points `(n, 2)`, counter-clockwise (monotone chain)."""
    ordered = np.unique(np.round(points, 7), axis=0)
    if len(ordered) < 3:
        return ordered

    def chain(sequence: FloatArray) -> list[FloatArray]:
        hull: list[FloatArray] = []
        for point in sequence:
            while len(hull) > 1:
                a, b = hull[-2], hull[-1]
                cross = (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0])
                if cross > 0.0:
                    break
                hull.pop()
            hull.append(point)
        return hull[:-1]

    return np.array(chain(ordered) + chain(ordered[::-1]))


def prism_around(points: FloatArray) -> Prism:
    """The upright prism around the points `(n, 3)`."""
    heights = points[:, 2]
    return Prism(convex_outline(points[:, :2]), float(heights.min()), float(heights.max()))


def overlap_depth(a: Prism, b: Prism) -> float:
    """How deep two prisms reach into each other in metres; negative: at least so far apart."""
    height = min(a.z_high, b.z_high) - max(a.z_low, b.z_low)
    return min(height, _outline_depth(a.outline, b.outline))


def _outline_depth(a: FloatArray, b: FloatArray) -> float:
    """How far two convex outlines reach into each other; negative when a line parts them."""
    depth = np.inf
    for outline in (a, b):
        edges = np.roll(outline, -1, axis=0) - outline
        normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1)
        length = np.linalg.norm(normals, axis=1)
        normals = normals[length > 1e-9] / length[length > 1e-9, None]
        on_a, on_b = a @ normals.T, b @ normals.T
        overlap = np.minimum(on_a.max(axis=0), on_b.max(axis=0)) - np.maximum(
            on_a.min(axis=0), on_b.min(axis=0)
        )
        depth = min(depth, float(overlap.min()))
    return depth
