"""PLY files: the vertices as a point cloud; ascii and binary of either byte order."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import FluentboardError, InvalidFrame
from fluentboard_modules.frames.point_cloud import PointCloud

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
_LABEL_PROPERTIES = ("label", "instance", "objectId", "class", "scalar_Label", "scalar_label")
_COLOUR_PROPERTIES = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"))


@dataclass
class _Element:
    """A kind of thing in the file: so many of them, each with these properties."""

    name: str
    count: int
    properties: list[tuple[str, str]] = field(default_factory=list[tuple[str, str]])
    has_lists: bool = False


def read_ply(path: Path) -> PointCloud:
    """The vertices of a file; faces are left aside.

    Organised if the file has a `camera` element whose viewport has as many pixels as there are
    vertices, as those written by the Point Cloud Library.

    Raises:
        InvalidFrame: the file is missing, truncated, damaged, or its vertices have no x, y and z.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InvalidFrame(f"{path}: cannot be read ({error.strerror})") from error
    try:
        order, elements, begins = _parse_header(content)
        tables = _tables(content[begins:], order, elements)
        return _cloud(tables)
    except FluentboardError as error:
        raise InvalidFrame(f"{path}: {error.message}") from error


def _parse_header(content: bytes) -> tuple[str, list[_Element], int]:
    if not content.startswith(b"ply"):
        raise InvalidFrame("does not begin with 'ply'; the file is no PLY")
    order: str | None = None
    elements: list[_Element] = []
    at = 0
    while True:
        end = content.find(b"\n", at)
        if end < 0:
            raise InvalidFrame("the header has no end_header; the file is truncated")
        words = content[at:end].decode("ascii", "replace").split()
        at = end + 1
        try:
            match words:
                case ["format", kind, _]:
                    order = _ORDERS[kind]
                    order = "" if kind == "ascii" else order
                case ["element", name, count]:
                    elements.append(_Element(name, int(count)))
                case ["property", "list", _, _, _]:
                    elements[-1].has_lists = True
                case ["property", kind, name]:
                    elements[-1].properties.append((name, _TYPES[kind]))
                case ["end_header"]:
                    break
                case _:
                    continue  # comments, obj_info, the magic word
        except (KeyError, ValueError, IndexError) as error:
            raise InvalidFrame(f"the header is damaged in line {' '.join(words)!r}") from error
    if order is None:
        raise InvalidFrame("the header names no format; the file is damaged")
    return order, elements, at


def _tables(body: bytes, order: str, elements: list[_Element]) -> dict[str, NDArray[np.void]]:
    """Rows of the elements up to the first one whose rows differ in length."""
    tables: dict[str, NDArray[np.void]] = {}
    words = body.split() if not order else []
    at = 0
    for element in elements:
        if element.has_lists:
            if element.name == "vertex":
                raise InvalidFrame("its vertices have lists; convert it to plain vertices")
            break
        row = np.dtype([(name, (order or "=") + kind) for name, kind in element.properties])
        if order:
            held = (len(body) - at) // max(1, row.itemsize)
            if held >= element.count:
                tables[element.name] = np.frombuffer(body, row, element.count, at)
            at += row.itemsize * element.count
        else:
            width = len(element.properties)
            held = (len(words) - at) // max(1, width)
            if held >= element.count:
                tables[element.name] = _ascii_table(words[at : at + width * element.count], row)
            at += width * element.count
        if element.name not in tables:
            raise InvalidFrame(
                f"holds {held} of {element.count} rows of {element.name}; the file is truncated"
            )
    return tables


def _ascii_table(words: list[bytes], row: np.dtype[np.void]) -> NDArray[np.void]:
    names = row.names or ()
    try:
        numbers = np.array(words, dtype=np.float64).reshape(-1, len(names))
    except ValueError as error:
        raise InvalidFrame(f"holds something that is not a number ({error})") from error
    table = np.zeros(len(numbers), row)
    for place, name in enumerate(names):
        table[name] = numbers[:, place]
    return table


def _cloud(tables: dict[str, NDArray[np.void]]) -> PointCloud:
    vertices = tables.get("vertex")
    names: tuple[str, ...] = () if vertices is None else vertices.dtype.names or ()
    if vertices is None or not {"x", "y", "z"} <= set(names):
        raise InvalidFrame(f"its vertices have no x, y and z, only {' '.join(names) or 'nothing'}")
    points = np.stack([vertices[axis].astype(np.float64) for axis in "xyz"], axis=-1)
    label = next((name for name in _LABEL_PROPERTIES if name in names), None)
    width, height = _organisation(tables, len(points))
    return PointCloud(
        points=points,
        width=width,
        height=height,
        colours=_colours(vertices, names),
        labels=None if label is None else vertices[label].astype(np.int32),
    )


def _colours(vertices: NDArray[np.void], names: tuple[str, ...]) -> NDArray[np.uint8] | None:
    for channels in _COLOUR_PROPERTIES:
        if set(channels) <= set(names):
            colours = np.stack([vertices[channel] for channel in channels], axis=-1)
            if colours.dtype.kind == "f":  # from 0 to 1
                colours = np.rint(np.clip(np.nan_to_num(colours), 0.0, 1.0) * 255.0)
            return colours.astype(np.uint8)
    return None


def _organisation(tables: dict[str, NDArray[np.void]], count: int) -> tuple[int, int]:
    camera = tables.get("camera")
    if (
        camera is not None
        and len(camera)
        and {"viewportx", "viewporty"} <= set(camera.dtype.names or ())
    ):
        width, height = int(camera["viewportx"][0]), int(camera["viewporty"][0])
        if height > 1 and width * height == count:
            return width, height
    return count, 1
