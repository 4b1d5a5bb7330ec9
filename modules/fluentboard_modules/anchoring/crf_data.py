"""Labelled scene graphs in flat arrays: what a CRF is trained and tested on."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import FloatArray

IntArray = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class LabelledGraphs:
    """Scene graphs with the true classes of their nodes, one behind the other.

    Nodes and edges of graph g are those from `graph_ptr[g]` and `edge_ptr[g]` up to the next entry.

    Attributes:
        classes: names of the classes.
        x: `(nodes, Fn)`; unary features (Table 4.2); NaN where a feature is unknown.
        y: `(nodes,)`; true class of each node.
        confidence: `(nodes, classes)`; of local recognition, each in [0, 1].
        graph_ptr: `(G + 1,)`; first node of every graph.
        edges: `(E, 2)`; global node numbers, the first smaller than the second.
        e: `(E, Fe)`; pairwise features (Table 4.3) from the first node to the second.
        edge_ptr: `(G + 1,)`; first edge of every graph.
        fold: `(G,)`; what is left out together: a scene, a desk.
        node_names: what the columns of `x` are.
        edge_names: what the columns of `e` are.

    Raises:
        InvalidInput: the arrays do not fit together.
    """

    classes: tuple[str, ...]
    x: FloatArray
    y: IntArray
    confidence: FloatArray
    graph_ptr: IntArray
    edges: IntArray
    e: FloatArray
    edge_ptr: IntArray
    fold: IntArray
    node_names: tuple[str, ...] = ()
    edge_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        nodes, graphs = len(self.x), len(self.graph_ptr) - 1
        wrong = ""
        if len(self.y) != nodes or self.confidence.shape != (nodes, len(self.classes)):
            wrong = f"{nodes} nodes, {len(self.y)} classes, confidence {self.confidence.shape}"
        elif self.edges.shape != (len(self.e), 2) or len(self.edge_ptr) != graphs + 1:
            wrong = f"edges {self.edges.shape}, edge features {self.e.shape}"
        elif graphs < 0 or len(self.fold) != graphs or self.graph_ptr[-1] != nodes:
            wrong = f"{graphs} graphs, {len(self.fold)} folds, {nodes} nodes"
        elif nodes and not 0 <= self.y.min() <= self.y.max() < len(self.classes):
            wrong = f"classes {self.y.min()} to {self.y.max()} of {len(self.classes)}"
        elif len(self.edges) and not np.all(self.edges[:, 0] < self.edges[:, 1]):
            wrong = "an edge whose first node is not the smaller one"
        if wrong:
            raise InvalidInput(f"labelled graphs do not fit together: {wrong}")

    def __len__(self) -> int:
        return len(self.fold)

    @property
    def graph_of_node(self) -> IntArray:
        """`(nodes,)`; the graph each node belongs to."""
        return np.repeat(np.arange(len(self)), np.diff(self.graph_ptr))

    @property
    def fold_of_node(self) -> IntArray:
        """`(nodes,)`; the fold each node belongs to."""
        return self.fold[self.graph_of_node]

    def nodes_of(self, graph: int) -> slice:
        """The nodes of one graph."""
        return slice(int(self.graph_ptr[graph]), int(self.graph_ptr[graph + 1]))

    def edges_of(self, graph: int) -> slice:
        """The edges of one graph."""
        return slice(int(self.edge_ptr[graph]), int(self.edge_ptr[graph + 1]))

    def only(self, chosen: NDArray[np.bool_]) -> LabelledGraphs:
        """Those of the graphs for which `chosen` `(G,)` is true."""
        keep_node = np.repeat(chosen, np.diff(self.graph_ptr))
        keep_edge = np.repeat(chosen, np.diff(self.edge_ptr))
        renumbered = np.cumsum(keep_node) - 1
        return LabelledGraphs(
            self.classes,
            self.x[keep_node],
            self.y[keep_node],
            self.confidence[keep_node],
            _pointers(np.diff(self.graph_ptr)[chosen]),
            renumbered[self.edges[keep_edge]].reshape(-1, 2),
            self.e[keep_edge],
            _pointers(np.diff(self.edge_ptr)[chosen]),
            self.fold[chosen],
            self.node_names,
            self.edge_names,
        )

    def with_confidence(self, confidence: FloatArray) -> LabelledGraphs:
        """The same graphs with other confidences `(nodes, classes)`."""
        return replace(self, confidence=confidence)

    def fingerprint(self) -> str:
        """A short hash of everything in it: a model says with it what it was trained on."""
        digest = hashlib.sha256("\0".join(self.classes).encode())
        for array in (self.x, self.y, self.confidence, self.graph_ptr, self.edges, self.e):
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()[:16]

    def save(self, path: Path, **predictions: IntArray) -> None:
        """Writes an `.npz` that any CRF library can be trained on.

        Unknown features get the mean of the known ones: other libraries take no NaN.

        Args:
            path: of the file; its folder is made if it is missing.
            predictions: per name the classes `(nodes,)` that were predicted, kept as
                `prediction_<name>`.
        """
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(
            path,
            n_classes=np.int64(len(self.classes)),
            x=_completed(self.x),
            y=self.y.astype(np.int64),
            confidence=self.confidence.astype(np.float64),
            graph_ptr=self.graph_ptr.astype(np.int64),
            edges=self.edges.astype(np.int64),
            e=_completed(self.e),
            edge_ptr=self.edge_ptr.astype(np.int64),
            fold=self.fold.astype(np.int64),
            classes=np.array(self.classes, dtype=np.str_),
            node_names=np.array(self.node_names, dtype=np.str_),
            edge_names=np.array(self.edge_names, dtype=np.str_),
            **{f"prediction_{name}": array for name, array in predictions.items()},
        )


def load_graphs(path: Path) -> LabelledGraphs:
    """Graphs from an `.npz` file as `LabelledGraphs.save` writes it.

    Raises:
        InvalidInput: the file is missing, is no such file, or its arrays do not fit together.
    """
    try:
        with np.load(path, allow_pickle=False) as kept:
            arrays = {name: kept[name] for name in kept.files}
        count = int(arrays["n_classes"])
        return LabelledGraphs(
            tuple(str(c) for c in arrays.get("classes", np.arange(count))),
            arrays["x"],
            arrays["y"],
            arrays["confidence"],
            arrays["graph_ptr"],
            arrays["edges"],
            arrays["e"],
            arrays["edge_ptr"],
            arrays["fold"],
            tuple(str(name) for name in arrays.get("node_names", ())),
            tuple(str(name) for name in arrays.get("edge_names", ())),
        )
    except (OSError, KeyError, ValueError) as problem:
        raise InvalidInput(
            f"{path} holds no labelled scene graphs ({problem}); "
            "write them with: fluentboard evaluate anchoring --export DIR"
        ) from problem


@dataclass(slots=True)
class GraphCollector:
    """Puts labelled scene graphs one behind the other.

    Attributes:
        classes: names of the classes.
        node_names: what the unary features are.
        edge_names: what the pairwise features are.
    """

    classes: tuple[str, ...]
    node_names: tuple[str, ...]
    edge_names: tuple[str, ...]
    _x: list[FloatArray] = field(default_factory=list)
    _y: list[IntArray] = field(default_factory=list)
    _confidence: list[FloatArray] = field(default_factory=list)
    _edges: list[IntArray] = field(default_factory=list)
    _e: list[FloatArray] = field(default_factory=list)
    _fold: list[int] = field(default_factory=list)

    def add(
        self,
        x: FloatArray,
        y: Sequence[int] | IntArray,
        confidence: FloatArray | None,
        edges: IntArray,
        e: FloatArray,
        fold: int,
    ) -> None:
        """Adds a graph.

        Args:
            x: `(n, Fn)`; unary features.
            y: `(n,)`; true classes.
            confidence: `(n, classes)`; of local recognition; None: no class is likelier.
            edges: `(m, 2)`; node numbers within the graph, the first smaller than the second.
            e: `(m, Fe)`; pairwise features.
            fold: what is left out together.
        """
        uniform = np.full((len(x), len(self.classes)), 1.0 / max(len(self.classes), 1))
        self._x.append(np.asarray(x, dtype=np.float64).reshape(len(x), len(self.node_names)))
        self._y.append(np.asarray(y, dtype=np.int64))
        self._confidence.append(uniform if confidence is None else confidence)
        self._edges.append(np.asarray(edges, dtype=np.int64).reshape(-1, 2))
        self._e.append(np.asarray(e, dtype=np.float64).reshape(-1, len(self.edge_names)))
        self._fold.append(fold)

    def graphs(self) -> LabelledGraphs:
        """All graphs added so far."""
        graph_ptr = _pointers([len(x) for x in self._x])
        shifted = [edges + start for edges, start in zip(self._edges, graph_ptr[:-1], strict=True)]
        return LabelledGraphs(
            self.classes,
            np.concatenate([np.zeros((0, len(self.node_names))), *self._x]),
            np.concatenate([np.zeros(0, dtype=np.int64), *self._y]),
            np.concatenate([np.zeros((0, len(self.classes))), *self._confidence]),
            graph_ptr,
            np.concatenate([np.zeros((0, 2), dtype=np.int64), *shifted]),
            np.concatenate([np.zeros((0, len(self.edge_names))), *self._e]),
            _pointers([len(edges) for edges in self._edges]),
            np.asarray(self._fold, dtype=np.int64),
            self.node_names,
            self.edge_names,
        )


def _completed(features: FloatArray) -> FloatArray:
    known = np.isfinite(features)
    total = np.where(known, features, 0.0).sum(axis=0)
    return np.where(known, features, total / np.maximum(known.sum(axis=0), 1)).astype(np.float64)


def _pointers(counts: Sequence[int] | IntArray) -> IntArray:
    return np.concatenate([[0], np.cumsum(np.asarray(counts, dtype=np.int64))]).astype(np.int64)
