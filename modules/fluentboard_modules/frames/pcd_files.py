"""PCD files of the Point Cloud Library: ascii, binary and binary_compressed, with organisation.

Own reader, because the usual ones drop the rows of an organised cloud, or fields such as `label`.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import FluentboardError, InvalidFrame
from fluentboard.model.geometry import FloatArray, Pose, Transform
from fluentboard_modules.frames.lzf import decompress_lzf
from fluentboard_modules.frames.point_cloud import PointCloud, unpacked_rgb

_KEYS = frozenset(
    {
        *("VERSION", "FIELDS", "COLUMNS", "SIZE", "TYPE", "COUNT"),
        *("WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA"),
    }
)
_KINDS = {"F": "f", "U": "u", "I": "i"}
_LABEL_FIELDS = ("label", "object", "instance")


@dataclass(frozen=True)
class _Header:
    """What the text at the top says.

    Attributes:
        row: structure of one point.
        width: points per row.
        height: rows.
        viewpoint: seven numbers, tx ty tz qw qx qy qz, or None.
        data: `ascii`, `binary` or `binary_compressed`.
        begins: offset of the points in the file.
    """

    row: np.dtype[np.void]
    width: int
    height: int
    viewpoint: list[float] | None
    data: str
    begins: int


def read_pcd(path: Path) -> PointCloud:
    """The cloud in a file.

    Raises:
        InvalidFrame: the file is missing, truncated, damaged, or has no x, y and z.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InvalidFrame(f"{path}: cannot be read ({error.strerror})") from error
    try:
        header = _parse_header(content)
        rows = _rows(content[header.begins :], header)
        return _cloud(rows, header)
    except FluentboardError as error:
        raise InvalidFrame(f"{path}: {error.message}") from error


def _parse_header(content: bytes) -> _Header:
    entries: dict[str, list[str]] = {}
    at = 0
    while "DATA" not in entries:
        end = content.find(b"\n", at)
        if end < 0 or end - at > 100_000:
            raise InvalidFrame("the header has no DATA line; the file is no PCD or is truncated")
        words = content[at:end].decode("ascii", "replace").split()
        at = end + 1
        if not words or words[0].startswith("#"):
            continue
        if words[0] not in _KEYS:
            raise InvalidFrame(f"the header has the line {words[0][:40]!r}; the file is no PCD")
        entries[words[0]] = words[1:]
    names = entries.get("FIELDS", entries.get("COLUMNS", []))
    sizes, kinds = entries.get("SIZE", []), entries.get("TYPE", [])
    counts = entries.get("COUNT", ["1"] * len(names))
    if not names or not len(names) == len(sizes) == len(kinds) == len(counts):
        raise InvalidFrame(
            f"the header has {len(names)} FIELDS, {len(sizes)} SIZE, {len(kinds)} TYPE and "
            f"{len(counts)} COUNT; they must be as many"
        )
    try:
        fields = [
            # Padding is called "_" as often as it occurs.
            (f"{name}.{place}" if name == "_" else name, f"<{_KINDS[kind]}{size}", (int(count),))
            for place, (name, size, kind, count) in enumerate(
                zip(names, sizes, kinds, counts, strict=True)
            )
        ]
        row = np.dtype(fields)
        width = int(entries["WIDTH"][0])
        height = int(entries.get("HEIGHT", ["1"])[0])
        viewpoint = [float(number) for number in entries.get("VIEWPOINT", [])] or None
        points = int(entries.get("POINTS", [str(width * height)])[0])
        data = entries["DATA"][0]
    except (KeyError, IndexError, ValueError, TypeError) as error:
        raise InvalidFrame(f"the header is damaged ({error!r})") from error
    if width < 0 or height < 1 or points != width * height:
        raise InvalidFrame(f"the header says {points} points for {width} x {height} of them")
    return _Header(row, width, height, viewpoint, data, at)


def _rows(body: bytes, header: _Header) -> NDArray[np.void]:
    count = header.width * header.height
    if header.data == "ascii":
        return _ascii_rows(body, header, count)
    size = count * header.row.itemsize
    if header.data == "binary":
        if len(body) < size:
            raise InvalidFrame(
                f"holds {len(body) // header.row.itemsize} of {count} points; the file is truncated"
            )
        return np.frombuffer(body, header.row, count)
    if header.data != "binary_compressed":
        raise InvalidFrame(f"DATA is {header.data!r}; expected ascii, binary or binary_compressed")
    if len(body) < 8:
        raise InvalidFrame("ends before its points; the file is truncated")
    packed_size, unpacked_size = struct.unpack_from("<II", body)
    if len(body) - 8 < packed_size:
        raise InvalidFrame(
            f"holds {len(body) - 8} of {packed_size} compressed bytes; the file is truncated"
        )
    if unpacked_size != size:
        raise InvalidFrame(f"is packed from {unpacked_size} bytes, but its points have {size}")
    unpacked = decompress_lzf(body[8 : 8 + packed_size], size)
    rows = np.zeros(count, header.row)
    at = 0
    for name in header.row.names or ():  # all x, then all y, and so on
        field = rows[name]
        rows[name] = np.frombuffer(unpacked, field.dtype, field.size, at).reshape(field.shape)
        at += field.nbytes
    return rows


def _ascii_rows(body: bytes, header: _Header, count: int) -> NDArray[np.void]:
    columns = [(name, k) for name in header.row.names or () for k in range(_width(header, name))]
    try:
        numbers = np.array(body.split(), dtype=np.float64)
    except ValueError as error:
        raise InvalidFrame(f"holds something that is not a number ({error})") from error
    if numbers.size != count * len(columns):
        raise InvalidFrame(
            f"holds {numbers.size // max(1, len(columns))} of {count} points; the file is "
            "truncated or its header wrong"
        )
    table = numbers.reshape(count, len(columns))
    rows = np.zeros(count, header.row)
    with np.errstate(invalid="ignore"):  # NaN in a column of integers
        for place, (name, k) in enumerate(columns):
            rows[name][:, k] = table[:, place]
    return rows


def _width(header: _Header, name: str) -> int:
    return int(np.prod(header.row[name].shape))


def _cloud(rows: NDArray[np.void], header: _Header) -> PointCloud:
    names = header.row.names or ()
    missing = [axis for axis in "xyz" if axis not in names]
    if missing:
        raise InvalidFrame(f"has no field {missing[0]}; its fields are {' '.join(names)}")
    points = np.stack([rows[axis][:, 0].astype(np.float64) for axis in "xyz"], axis=-1)
    labels = next((rows[name][:, 0] for name in _LABEL_FIELDS if name in names), None)
    return PointCloud(
        points=points,
        width=header.width,
        height=header.height,
        colours=_colours(rows, names),
        labels=None if labels is None else labels.astype(np.int32),
        T_cloud_sensor=_viewpoint(header.viewpoint),
    )


def _colours(rows: NDArray[np.void], names: tuple[str, ...]) -> NDArray[np.uint8] | None:
    for name in ("rgba", "rgb"):
        if name in names and rows[name].dtype.itemsize == 4:
            # A float's bits are the colour: PCL had no integer fields at first.
            packed = np.ascontiguousarray(rows[name][:, 0])
            colours = unpacked_rgb(packed.view(np.uint32))
            if packed.dtype.kind == "f":
                colours[np.isnan(packed)] = 0  # "no point here", and its bits are a loud red
            return colours
    return None


def _viewpoint(numbers: list[float] | None) -> Transform | None:
    if numbers is None:
        return None
    array: FloatArray = np.array(numbers)
    length = float(np.linalg.norm(array[3:])) if array.shape == (7,) else 0.0
    if not (np.isfinite(array).all() and length > 1e-6):
        raise InvalidFrame(f"VIEWPOINT is {numbers}; expected tx ty tz qw qx qy qz")
    qw, qx, qy, qz = array[3:] / length
    return Pose(*(float(x) for x in array[:3]), qx, qy, qz, qw).to_transform()
