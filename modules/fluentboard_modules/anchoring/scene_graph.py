"""The scene graph: objects as nodes, neighbours as edges, and their features (Tables 4.2, 4.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from fluentboard.errors import InvalidConfiguration
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.crf_data import IntArray
from fluentboard_modules.anchoring.observation import SceneObject, SupportPlane
from fluentboard_modules.anchoring.table_geometry import (
    angle_about,
    border_distance,
    inward_direction,
)

# Smallest edge of a box in metres: a knife seen by a depth camera may have no height at all.
_THINNEST_M = 0.002

THESIS_NODE_FEATURES = (
    "bias",
    "volume",
    "area_h",
    "area_v",
    "elong_h",
    "elong_v",
    "table_border_distance",
    "table_center_distance",
)
"""Table 4.2, and a bias (E10)."""

# Deviates from Tables 4.2 and 4.3: the features below are not in them.
SIZE_FEATURES = ("log_length", "log_width", "log_height")
"""Sizes as magnitudes: the difference between a fork and a dish is a factor, not a volume."""

SQUARE_FEATURES = ("log_length_squared", "log_width_squared", "log_height_squared")
"""With these a linear score has its maximum at the usual size of a class, as a Gaussian has."""

THESIS_EDGE_FEATURES = (
    "bias",
    "volume_ratio",
    "hdist_centroids",
    "table_border_diff",
    "table_center_diff",
    "table_angle_diff",
)
"""Table 4.3; the volume ratio as its logarithm (E10)."""

SIDE_FEATURES = ("side_offset", "abs_side_offset", "abs_volume_ratio", "abs_table_border_diff")
"""Left and right as seen from the nearest border, and how unequal two objects are."""

SIZE_DEPENDENT = frozenset(
    {
        *THESIS_NODE_FEATURES[1:6],
        *SIZE_FEATURES,
        *SQUARE_FEATURES,
        "volume_ratio",
        "abs_volume_ratio",
        "height_diff",
    }
)
"""Features that are unknown as long as the size of an object is."""

_ODD = {
    "volume_ratio",
    "table_border_diff",
    "table_center_diff",
    "table_angle_diff",
    "side_offset",
    "height_diff",
}
_NODE_FEATURES = {*THESIS_NODE_FEATURES, *SIZE_FEATURES, *SQUARE_FEATURES}
_EDGE_FEATURES = {*THESIS_EDGE_FEATURES, *SIDE_FEATURES, "height_diff"}


def edge_parity(names: Sequence[str]) -> FloatArray:
    """`(Fe,)`; -1 for the features that change their sign with the order of the two objects."""
    return np.array([-1.0 if name in _ODD else 1.0 for name in names])


@dataclass(frozen=True, slots=True)
class SceneGraphConfig:
    """What makes two objects neighbours, and which features describe them.

    Attributes:
        context_range_m: objects whose centres are nearer than this are neighbours. The thesis
            gives no number; 0.4 m is the width of a place setting. With a metre the neighbours
            across the table outnumber those that tell something.
        neighbours_max: an object keeps edges to so many nearest neighbours at most, so that a
            crowded table does not make inference slow.
        node_features: names of the unary features.
        edge_features: names of the pairwise features.

    Raises:
        InvalidConfiguration: a feature is unknown, or the range is not positive.
    """

    context_range_m: float = 0.4
    neighbours_max: int = 12
    node_features: tuple[str, ...] = (*THESIS_NODE_FEATURES, *SIZE_FEATURES, *SQUARE_FEATURES)
    edge_features: tuple[str, ...] = (*THESIS_EDGE_FEATURES, *SIDE_FEATURES)

    def __post_init__(self) -> None:
        unknown = (
            set(self.node_features) - _NODE_FEATURES | set(self.edge_features) - _EDGE_FEATURES
        )
        if unknown:
            known = sorted(_NODE_FEATURES | _EDGE_FEATURES)
            raise InvalidConfiguration(
                f"no feature {', '.join(sorted(unknown))}; there are {', '.join(known)}"
            )
        if self.context_range_m <= 0.0 or self.neighbours_max < 1:
            raise InvalidConfiguration(
                f"context range {self.context_range_m} m with {self.neighbours_max} neighbours; "
                "both must be positive"
            )

    @classmethod
    def of_the_thesis(cls, context_range_m: float = 0.4) -> SceneGraphConfig:
        """The features of Tables 4.2 and 4.3 and no others."""
        return cls(context_range_m, 12, THESIS_NODE_FEATURES, THESIS_EDGE_FEATURES)


@dataclass(frozen=True, slots=True, eq=False)
class SceneGraph:
    """A scene graph with its features.

    Attributes:
        members: `(n,)`; which of the objects are its nodes, in their order.
        x: `(n, Fn)`; unary features; NaN where one is unknown, as without a table.
        edges: `(m, 2)`; node numbers, the first smaller than the second.
        e: `(m, Fe)`; pairwise features from the first to the second; NaN where one is unknown.
    """

    members: IntArray
    x: FloatArray
    edges: IntArray
    e: FloatArray


def build_scene_graph(
    objects: Sequence[SceneObject], config: SceneGraphConfig | None = None
) -> SceneGraph:
    """The scene graph of what is seen and what is known to stand nearby (Section 4.2.3.2).

    Every tracked object is a node; an object out of view becomes one if it is within the context
    range of a node, and so on. Neighbours within the range are joined by edges.

    Args:
        objects: in any order; the graph does not depend on it but for the numbering of its nodes.
        config: the context range and the features.
    """
    config = config if config is not None else SceneGraphConfig()
    centres = np.array([[o.box.pose.x, o.box.pose.y, o.box.pose.z] for o in objects])
    centres = centres.reshape(-1, 3)
    pairs = cKDTree(centres).query_pairs(config.context_range_m, output_type="ndarray")
    members = _reached(np.array([o.is_tracked for o in objects], dtype=bool), pairs)
    number = np.full(len(objects), -1)
    number[members] = np.arange(len(members))
    edges = number[np.asarray(pairs, dtype=np.int64).reshape(-1, 2)]
    edges = np.sort(edges[np.all(edges >= 0, axis=1)], axis=1)
    edges = _nearest_edges(edges, centres[members], config.neighbours_max)
    columns = _Columns([objects[i] for i in members])
    return SceneGraph(
        members,
        columns.node_features(config.node_features),
        edges,
        columns.edge_features(edges, config.edge_features),
    )


def object_features(objects: Sequence[SceneObject], names: Sequence[str]) -> FloatArray:
    """`(n, Fn)`; unary features of objects."""
    return _Columns(objects).node_features(names)


def pair_features(
    objects: Sequence[SceneObject], edges: IntArray, names: Sequence[str]
) -> FloatArray:
    """`(m, Fe)`; pairwise features of the objects that edges `(m, 2)` join."""
    return _Columns(objects).edge_features(edges, names)


def _reached(tracked: np.ndarray, pairs: np.ndarray) -> IntArray:
    """Numbers of the objects that are tracked or joined to a tracked one by a chain of pairs."""
    found = tracked.copy()
    while len(pairs):
        either = found[pairs].any(axis=1)
        grown = found.copy()
        grown[pairs[either].ravel()] = True
        if np.array_equal(grown, found):
            break
        found = grown
    return np.flatnonzero(found).astype(np.int64)


def _nearest_edges(edges: IntArray, centres: FloatArray, count: int) -> IntArray:
    """The edges that are among the `count` shortest of at least one of their ends, sorted."""
    if not len(edges):
        return np.zeros((0, 2), dtype=np.int64)
    length = np.linalg.norm(centres[edges[:, 0]] - centres[edges[:, 1]], axis=1)
    keep = np.zeros(len(edges), dtype=bool)
    for node in range(len(centres)):
        own = np.flatnonzero(np.any(edges == node, axis=1))
        keep[own[np.argsort(length[own], kind="stable")[:count]]] = True
    edges = edges[keep]
    return np.asarray(edges[np.lexsort((edges[:, 1], edges[:, 0]))], dtype=np.int64)


class _Columns:
    """Sizes, places and supports of objects as arrays, and the features made of them."""

    def __init__(self, objects: Sequence[SceneObject]) -> None:
        sizes = np.array([o.box.sizes for o in objects]).reshape(-1, 3)
        sizes = np.maximum(sizes, _THINNEST_M)
        self._long = np.max(sizes[:, :2], axis=1)
        self._wide = np.min(sizes[:, :2], axis=1)
        self._high = sizes[:, 2]
        self._xy = np.array([[o.box.pose.x, o.box.pose.y] for o in objects]).reshape(-1, 2)
        self._z = np.array([o.box.pose.z for o in objects])
        self._supports = [o.support for o in objects]
        self._border = np.full(len(objects), np.nan)
        self._centre = np.full((len(objects), 2), np.nan)
        for i, support in enumerate(self._supports):
            if support is not None:
                self._border[i] = border_distance(support.boundary_map, self._xy[i : i + 1])[0]
                self._centre[i] = support.centre_map
        self._centre_distance = np.linalg.norm(self._xy - self._centre, axis=1)
        self._log_volume = np.log(self._long * self._wide * self._high)

    def node_features(self, names: Sequence[str]) -> FloatArray:
        diagonal = np.hypot(self._long, self._wide)
        logs = {
            "log_length": np.log(self._long),
            "log_width": np.log(self._wide),
            "log_height": np.log(self._high),
        }
        columns = {
            "bias": np.ones(len(self._long)),
            "volume": self._long * self._wide * self._high,
            "area_h": self._long * self._wide,
            "area_v": self._high * diagonal,
            "elong_h": self._long / self._wide,
            "elong_v": self._high / diagonal,
            "table_border_distance": self._border,
            "table_center_distance": self._centre_distance,
            **logs,
            # About the size of a hand, so that a size and its square are not nearly the same.
            **{f"{name}_squared": (log - np.log(0.1)) ** 2 for name, log in logs.items()},
        }
        return np.stack([columns[name] for name in names], axis=1).reshape(-1, len(names))

    def edge_features(self, edges: IntArray, names: Sequence[str]) -> FloatArray:
        a, b = edges[:, 0], edges[:, 1]
        apart = self._xy[b] - self._xy[a]
        same = np.array([_same_table(self._supports[i], self._supports[j]) for i, j in edges])
        same = same.reshape(-1).astype(bool)
        side = np.full(len(edges), np.nan)
        for k in np.flatnonzero(same):
            middle = 0.5 * (self._xy[a[k]] + self._xy[b[k]])[None]
            # The mean of both views of the table, so that the order of the two does not matter.
            inward = np.mean(
                [inward_direction(s.boundary_map, middle)[0] for s in self._pair(a[k], b[k])],
                axis=0,
            )
            # Positive to the right of someone who stands at the border and looks at the table.
            side[k] = apart[k, 0] * inward[1] - apart[k, 1] * inward[0]
        border = np.where(same, self._border[a] - self._border[b], np.nan)
        ratio = self._log_volume[a] - self._log_volume[b]
        centre = 0.5 * (self._centre[a] + self._centre[b])
        angle = angle_about(centre, self._xy[a], self._xy[b])
        columns = {
            "bias": np.ones(len(edges)),
            "volume_ratio": ratio,
            "abs_volume_ratio": np.abs(ratio),
            "hdist_centroids": np.linalg.norm(apart, axis=1),
            "table_border_diff": border,
            "abs_table_border_diff": np.abs(border),
            "table_center_diff": np.where(
                same, self._centre_distance[a] - self._centre_distance[b], np.nan
            ),
            "table_angle_diff": np.where(same, angle, np.nan),
            "side_offset": side,
            "abs_side_offset": np.abs(side),
            "height_diff": self._z[a] - self._z[b],
        }
        return np.stack([columns[name] for name in names], axis=1).reshape(-1, len(names))

    def _pair(self, i: int, j: int) -> list[SupportPlane]:
        return [s for s in (self._supports[i], self._supports[j]) if s is not None]


def _same_table(a: SupportPlane | None, b: SupportPlane | None) -> bool:
    if a is None or b is None:
        return False
    if a is b or (a.name and a.name == b.name):
        return True
    # The same table seen at different times: its visible part and so its centre may differ.
    apart = float(np.linalg.norm(a.centre_map - b.centre_map))
    return apart < 0.5 and abs(a.height_m - b.height_m) < 0.1
