"""OctoMap files: `.bt` (free or occupied) and `.ot` (log-odds), read into blocks and written back.

An octree of depth 16 in depth-first order is nothing but its cells sorted by Morton code, so both
directions work on sorted codes and need no tree.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidInput
from fluentboard_modules.search.config import SensorModelConfig
from fluentboard_modules.search.occupancy import OccupancyMap

_DEPTH = 16
_OFFSET = 1 << 15  # OctoMap's key of the cell at the origin
_CELLS_MAX = 1 << 27  # a pruned leaf high up in the tree stands for very many cells
_HEADERS = {
    ".bt": "# Octomap OcTree binary file\n"
    "# (feel free to add / change comments, but leave the first line as it is!)\n#\n",
    ".ot": "# Octomap OcTree file\n"
    "# (feel free to add / change comments, but leave the first line as it is!)\n#\n",
}
_jit: Any = numba.njit(cache=True, error_model="numpy")


@dataclass(frozen=True, slots=True)
class _Leaves:
    """Leaves of an octree: lowest cell as a key `(n, 3)`, depth `(n,)` and log-odds `(n,)`."""

    keys: NDArray[np.int64]
    depth: NDArray[np.int64]
    log_odds: NDArray[np.float32]


def read_octomap(path: str | Path, model: SensorModelConfig | None = None) -> OccupancyMap:
    """The map of a `.bt` or `.ot` file of type OcTree.

    Args:
        path: of the file; the first line decides what it is.
        model: of the map; a `.bt` file gets the log-odds of its clamping limits.

    Raises:
        InvalidInput: the file is missing, truncated, of another type, or absurdly large.
    """
    path = Path(path)
    try:
        content = path.read_bytes()
    except OSError as problem:
        raise InvalidInput(f"cannot read the map {path}: {problem.strerror}") from problem
    header, found, data = content.partition(b"\ndata\n")
    lines = header.decode("ascii", "replace").splitlines()
    if not found or not lines or not lines[0].startswith("# Octomap OcTree"):
        raise InvalidInput(f"{path} is not an OctoMap file; save it with write or writeBinary")
    entries = dict(line.split(maxsplit=1) for line in lines if len(line.split()) > 1)
    if entries.get("id") != "OcTree":
        raise InvalidInput(
            f"{path} holds a tree of type {entries.get('id')!r}; only OcTree is understood, save "
            "the occupancy alone"
        )
    try:
        occupancy = OccupancyMap(float(entries["res"]), model or SensorModelConfig())
        size = int(entries["size"])
    except (KeyError, ValueError) as problem:
        raise InvalidInput(f"{path} does not state its resolution and size: {problem}") from None
    stream = np.frombuffer(data, np.uint8)
    if size:
        _fill(occupancy, _decoded(stream, size, "binary" in lines[0], occupancy.model, path), path)
    return occupancy


def write_octomap(occupancy: OccupancyMap, path: str | Path) -> None:
    """Writes the map, pruned as OctoMap does: `.bt` keeps free and occupied, `.ot` the log-odds.

    Raises:
        InvalidInput: the name ends in neither, the map is too large for OctoMap's 16 levels, or
            the file cannot be written.
    """
    path = Path(path)
    if path.suffix not in _HEADERS:
        raise InvalidInput(f"a map file ends in .bt or .ot, not {path.name!r}")
    cells, values = occupancy.known_cells()
    keys = cells + _OFFSET
    if len(keys) and (keys.min() < 0 or keys.max() >= 1 << _DEPTH):
        reach = _OFFSET * occupancy.resolution_m
        raise InvalidInput(f"OctoMap files reach {reach:.0f} m from the origin; the map is larger")
    binary = path.suffix == ".bt"
    if binary:
        values = np.where(values >= 0.0, np.float32(1.0), np.float32(-1.0))
    codes = _morton(keys)
    order = np.argsort(codes)
    codes, values = codes[order], values[order]
    inner = sum(
        int(np.count_nonzero(np.diff(codes >> np.uint64(3 * level)))) + 1
        for level in range(1, _DEPTH + 1)
    )
    out = np.zeros(2 * inner if binary else 5 * (inner + len(codes)), np.uint8)
    length, size = (
        _encode(codes, values, _run_ends(codes, values), binary, out) if len(codes) else (0, 0)
    )
    header = (
        f"{_HEADERS[path.suffix]}id OcTree\nsize {size}\nres {occupancy.resolution_m:g}\ndata\n"
    )
    try:
        path.write_bytes(header.encode("ascii") + out[:length].tobytes())
    except OSError as problem:
        raise InvalidInput(f"cannot write the map {path}: {problem.strerror}") from problem


def _decoded(
    stream: NDArray[np.uint8], size: int, binary: bool, model: SensorModelConfig, path: Path
) -> _Leaves:
    # The size counts all nodes; a file cannot have more of them than bits (or 5 bytes) allow.
    if size > (4 * len(stream) + 1 if binary else len(stream) // 5 + 1):
        raise InvalidInput(f"{path} is truncated: {len(stream)} bytes for {size} nodes")
    keys = np.zeros((size, 3), np.int64)
    depth = np.zeros(size, np.int64)
    values = np.zeros(size, np.float32)
    _, _, low, high = model.log_odds_updates
    if binary:
        count = _decode_bt(stream, low, high, keys, depth, values)
    else:
        count = _decode_ot(stream, keys, depth, values)
    if count < 0:
        raise InvalidInput(f"{path} is damaged or truncated: its tree does not end")
    return _Leaves(keys[:count], depth[:count], values[:count])


def _fill(occupancy: OccupancyMap, leaves: _Leaves, path: Path) -> None:
    sides = 1 << (_DEPTH - leaves.depth)
    if float((sides.astype(np.float64) ** 3).sum()) > _CELLS_MAX:
        raise InvalidInput(
            f"{path} knows more than {_CELLS_MAX} cells; cut it to the rooms in question"
        )
    corners = leaves.keys - _OFFSET
    for side in np.unique(sides):
        chosen = sides == side
        steps = np.arange(side)
        offset = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
        cells = (corners[chosen][:, None, :] + offset[None]).reshape(-1, 3)
        occupancy.set_cells(cells, np.repeat(leaves.log_odds[chosen], len(offset)))


def _morton(keys: NDArray[np.int64]) -> NDArray[np.uint64]:
    code = np.zeros(len(keys), np.uint64)
    for axis in range(3):
        spread = keys[:, axis].astype(np.uint64)
        for shift, mask in (
            (32, 0x1F00000000FFFF),
            (16, 0x1F0000FF0000FF),
            (8, 0x100F00F00F00F00F),
            (4, 0x10C30C30C30C30C3),
            (2, 0x1249249249249249),
        ):
            spread = (spread | (spread << np.uint64(shift))) & np.uint64(mask)
        code |= spread << np.uint64(axis)
    return code


def _run_ends(codes: NDArray[np.uint64], values: NDArray[np.float32]) -> NDArray[np.int64]:
    """`(n,)`; where the run of neighbouring cells with the same value ends that each is in."""
    breaks = np.flatnonzero((np.diff(codes) != 1) | (np.diff(values) != 0.0)) + 1
    ends = np.append(breaks, len(codes))
    return ends[np.searchsorted(breaks, np.arange(len(codes)), side="right")]


@_jit
def _decode_bt(stream: Any, low: float, high: float, keys: Any, depths: Any, values: Any) -> int:
    count = 0
    position = 0
    # Per level: the key of the node and the two bytes of its children, and the next child.
    node = np.zeros((17, 3), np.int64)
    pattern = np.zeros(17, np.int64)
    child = np.zeros(17, np.int64)
    level = 0
    if stream.shape[0] < 2:
        return -1
    pattern[0] = int(stream[0]) | (int(stream[1]) << 8)
    position = 2
    while level >= 0:
        if child[level] == 8:
            level -= 1
            continue
        c = child[level]
        child[level] += 1
        kind = (pattern[level] >> (2 * c)) & 3
        if kind == 0:
            continue
        half = 1 << (15 - level)
        x = node[level, 0] + half * (c & 1)
        y = node[level, 1] + half * ((c >> 1) & 1)
        z = node[level, 2] + half * (c >> 2)
        if kind == 3:
            level += 1
            if level > 15 or position + 2 > stream.shape[0]:
                return -1
            node[level, 0], node[level, 1], node[level, 2] = x, y, z
            pattern[level] = int(stream[position]) | (int(stream[position + 1]) << 8)
            position += 2
            child[level] = 0
        else:
            if count == keys.shape[0]:
                return -1
            keys[count, 0], keys[count, 1], keys[count, 2] = x, y, z
            depths[count] = level + 1
            values[count] = low if kind == 1 else high
            count += 1
    return count


@_jit
def _decode_ot(stream: Any, keys: Any, depths: Any, values: Any) -> int:
    count = 0
    position = 0
    node = np.zeros((18, 3), np.int64)
    pattern = np.zeros(18, np.int64)
    child = np.zeros(18, np.int64)
    level = 0
    child[0] = -1  # the node itself has not been read yet
    while level >= 0:
        if child[level] == -1:
            if position + 5 > stream.shape[0]:
                return -1
            pattern[level] = stream[position + 4]
            if pattern[level] == 0:
                if count == keys.shape[0]:
                    return -1
                for axis in range(3):
                    keys[count, axis] = node[level, axis]
                depths[count] = level
                values[count] = stream[position : position + 4].view(np.float32)[0]
                count += 1
            position += 5
            child[level] = 0
        if child[level] == 8:
            level -= 1
            continue
        c = child[level]
        child[level] += 1
        if (pattern[level] >> c) & 1:
            if level == 16:
                return -1
            half = 1 << (15 - level)
            node[level + 1, 0] = node[level, 0] + half * (c & 1)
            node[level + 1, 1] = node[level, 1] + half * ((c >> 1) & 1)
            node[level + 1, 2] = node[level, 2] + half * (c >> 2)
            level += 1
            child[level] = -1
    return count


@_jit
def _encode(codes: Any, values: Any, run_ends: Any, binary: bool, out: Any) -> Any:
    """Writes the tree of sorted codes; returns bytes written and nodes counted."""
    length = 0
    size = 0
    first = np.zeros(18, np.int64)
    last = np.zeros(18, np.int64)
    bounds = np.zeros((18, 9), np.int64)
    child = np.zeros(18, np.int64)
    number = np.zeros(1, np.float32)
    level = 0
    first[0], last[0] = 0, codes.shape[0]
    child[0] = -1
    while level >= 0:
        if child[level] == -1:
            size += 1
            shift = 3 * (16 - level)
            count = last[level] - first[level]
            leaf = run_ends[first[level]] >= last[level] and count == (1 << shift)
            mask = 0
            pair = 0
            if not leaf:
                at = first[level]
                for c in range(8):
                    bounds[level, c] = at
                    while (
                        at < last[level]
                        and int((codes[at] >> np.uint64(shift - 3)) & np.uint64(7)) == c
                    ):
                        # Whole runs at once where they stay inside the child.
                        at += 1
                    start = bounds[level, c]
                    if at > start:
                        mask |= 1 << c
                        whole = run_ends[start] >= at and at - start == (1 << (shift - 3))
                        kind = 3
                        if whole:
                            kind = 2 if values[start] >= 0.0 else 1
                        pair |= kind << (2 * c)
                bounds[level, 8] = at
            if binary:
                if not leaf or level == 0:
                    if leaf:  # OctoMap cannot say that the whole world is one leaf
                        kind = 2 if values[0] >= 0.0 else 1
                        for c in range(8):
                            pair |= kind << (2 * c)
                    out[length] = pair & 255
                    out[length + 1] = pair >> 8
                    length += 2
            else:
                most = values[first[level]]
                if not leaf:
                    for n in range(first[level], last[level]):
                        most = max(most, values[n])
                number[0] = most
                raw = number.view(np.uint8)
                for n in range(4):
                    out[length + n] = raw[n]
                out[length + 4] = mask
                length += 5
            if leaf:
                level -= 1
                continue
            child[level] = 0
        if child[level] == 8:
            level -= 1
            continue
        c = child[level]
        child[level] += 1
        if bounds[level, c + 1] > bounds[level, c]:
            first[level + 1] = bounds[level, c]
            last[level + 1] = bounds[level, c + 1]
            level += 1
            child[level] = -1
    return length, size
