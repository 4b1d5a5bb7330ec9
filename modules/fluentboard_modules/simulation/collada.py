"""Read the triangles of a COLLADA (.dae) file, in metres with z up as its header says."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidGeometry
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.simulation.mesh import Mesh

_UP = {
    "X_UP": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
    "Y_UP": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "Z_UP": np.eye(3),
}
_FACES = ("triangles", "polylist", "polygons", "trifans", "tristrips")
_DEEPEST = 32

Triangles = NDArray[np.int64]


def read_collada(path: Path) -> Mesh:
    """All triangles of the file's scene: unit and up axis of its `asset`, nodes placed.

    Raises:
        InvalidGeometry: the file is not COLLADA, refers to something it does not contain, or has no
            triangles.
    """
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise InvalidGeometry(f"{path}: not well-formed XML ({error})") from error
    if not root.tag.endswith("COLLADA"):
        raise InvalidGeometry(f"{path}: the root element is {root.tag}, expected COLLADA")
    return _Reader(path, root).mesh()


class _Reader:
    """One file: its elements by id, and the walk through its scene."""

    def __init__(self, path: Path, root: ElementTree.Element) -> None:
        self._path = path
        self._root = root
        self._space = root.tag.removesuffix("COLLADA")
        self._by_id = {e.attrib["id"]: e for e in root.iter() if "id" in e.attrib}
        self._found: list[tuple[FloatArray, Triangles]] = []

    def mesh(self) -> Mesh:
        # The standard's defaults: metres, y up.
        unit = float(self._attribute("asset/unit", "meter", "1"))
        up = self._text("asset/up_axis", "Y_UP")
        if up not in _UP or not unit > 0.0:
            raise InvalidGeometry(f"{self._path}: up_axis {up!r} or unit {unit} m is not valid")
        to_map = np.eye(4)
        to_map[:3, :3] = unit * _UP[up]
        shown = self._find(self._root, "scene/instance_visual_scene")
        if shown is not None:
            for node in self._all(self._target(shown), "node"):
                self._walk(node, to_map, 0)
        else:  # a library of geometries without a scene
            for geometry in self._root.iter(f"{self._space}geometry"):
                self._take(geometry, to_map)
        if not self._found:
            raise InvalidGeometry(f"{self._path}: no triangles in the scene of this COLLADA file")
        first = np.cumsum([0, *(len(points) for points, _ in self._found)])
        return Mesh(
            np.concatenate([points for points, _ in self._found]),
            np.concatenate(
                [t + offset for (_, t), offset in zip(self._found, first[:-1], strict=True)]
            ).astype(np.int32),
        )

    def _walk(self, node: ElementTree.Element, to_map: FloatArray, depth: int) -> None:
        if depth > _DEEPEST:
            raise InvalidGeometry(f"{self._path}: nodes refer to each other in a circle")
        for child in node:
            kind = child.tag.removeprefix(self._space)
            if kind in ("matrix", "translate", "rotate", "scale", "lookat", "skew"):
                to_map = to_map @ self._placement(kind, child)
            elif kind == "node":
                self._walk(child, to_map, depth + 1)
            elif kind == "instance_node":
                self._walk(self._target(child), to_map, depth + 1)
            elif kind == "instance_geometry":
                self._take(self._target(child), to_map)
            elif kind == "instance_controller":
                skin = self._find(self._target(child), "skin")
                if skin is not None:
                    self._take(self._target(skin, "source"), to_map)

    def _placement(self, kind: str, element: ElementTree.Element) -> FloatArray:
        values = np.array((element.text or "").split(), dtype=np.float64)
        if kind in ("lookat", "skew"):
            raise InvalidGeometry(
                f"{self._path}: nodes placed by <{kind}> are not read; export with <matrix>"
            )
        placement = np.eye(4)
        if kind == "matrix":
            placement = values.reshape(4, 4)
        elif kind == "translate":
            placement[:3, 3] = values
        elif kind == "scale":
            placement[:3, :3] = np.diag(values)
        else:
            axis, angle = values[:3] / np.linalg.norm(values[:3]), math.radians(values[3])
            cross = np.array(
                [[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]]
            )
            placement[:3, :3] += math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
        return placement

    def _take(self, geometry: ElementTree.Element, to_map: FloatArray) -> None:
        mesh = self._find(geometry, "mesh")
        if mesh is None:
            return
        for kind in _FACES:
            for faces in self._all(mesh, kind):
                points, triangles = self._triangles(kind, faces)
                if len(triangles):
                    placed = points @ to_map[:3, :3].T + to_map[:3, 3]
                    # A mirroring node turns the surface inside out; turn it back.
                    if np.linalg.det(to_map[:3, :3]) < 0.0:
                        triangles = triangles[:, ::-1]
                    self._found.append((placed, triangles))

    def _triangles(self, kind: str, faces: ElementTree.Element) -> tuple[FloatArray, Triangles]:
        inputs = self._all(faces, "input")
        width = 1 + max((int(i.attrib.get("offset", "0")) for i in inputs), default=0)
        vertex = next((i for i in inputs if i.attrib.get("semantic") == "VERTEX"), None)
        if vertex is None:
            raise InvalidGeometry(f"{self._path}: <{kind}> has no VERTEX input")
        offset = int(vertex.attrib.get("offset", "0"))
        lists = [
            np.array((p.text or "").split(), dtype=np.int64)[offset::width]
            for p in self._all(faces, "p")
        ]
        index: list[Triangles] = []
        for corners in lists:
            if kind == "triangles":
                index.append(corners.reshape(-1, 3))
            elif kind == "polylist":
                counts = np.array(self._text("vcount", "", faces).split(), dtype=np.int64)
                index += [_fan(part) for part in np.split(corners, np.cumsum(counts)[:-1])]
            elif kind == "tristrips":
                strip = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
                strip[1::2] = strip[1::2, ::-1]
                index.append(strip)
            else:
                index.append(_fan(corners))
        merged = np.concatenate(index) if index else np.zeros((0, 3), dtype=np.int64)
        return self._points(self._target(vertex, "source")), merged

    def _points(self, vertices: ElementTree.Element) -> FloatArray:
        position = next(
            (i for i in self._all(vertices, "input") if i.attrib.get("semantic") == "POSITION"),
            None,
        )
        if position is None:
            raise InvalidGeometry(f"{self._path}: <vertices> has no POSITION input")
        source = self._target(position, "source")
        values = np.array(self._text("float_array", "", source).split(), dtype=np.float64)
        stride = int(self._attribute("technique_common/accessor", "stride", "3", source))
        return values[: len(values) // stride * stride].reshape(-1, stride)[:, :3]

    def _target(self, element: ElementTree.Element, key: str = "url") -> ElementTree.Element:
        name = element.attrib.get(key, "")
        try:
            return self._by_id[name.removeprefix("#")]
        except KeyError:
            raise InvalidGeometry(
                f"{self._path}: refers to {name!r}, which the file does not contain"
            ) from None

    def _steps(self, path: str) -> str:
        return "/".join(self._space + step for step in path.split("/"))

    def _find(self, start: ElementTree.Element, path: str) -> ElementTree.Element | None:
        return start.find(self._steps(path))

    def _all(self, start: ElementTree.Element, path: str) -> list[ElementTree.Element]:
        return start.findall(self._steps(path))

    def _text(self, path: str, default: str, start: ElementTree.Element | None = None) -> str:
        element = self._find(self._root if start is None else start, path)
        return default if element is None or element.text is None else element.text.strip()

    def _attribute(
        self, path: str, key: str, default: str, start: ElementTree.Element | None = None
    ) -> str:
        element = self._find(self._root if start is None else start, path)
        return default if element is None else element.attrib.get(key, default)


def _fan(corners: NDArray[np.int64]) -> Triangles:
    """Triangles `(k - 2, 3)` of a convex polygon."""
    first = np.repeat(corners[:1], max(len(corners) - 2, 0))
    return np.stack([first, corners[1:-1], corners[2:]], axis=1)
