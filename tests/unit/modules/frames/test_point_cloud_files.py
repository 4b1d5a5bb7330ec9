"""PCD and PLY files: every kind is read, damage is named."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fluentboard.errors import InvalidFrame
from fluentboard_modules.frames.lzf import decompress_lzf
from fluentboard_modules.frames.pcd_files import read_pcd
from fluentboard_modules.frames.ply_files import read_ply

ROW = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<u4"), ("label", "<u4")])
ROWS = np.array(
    [
        (0.5, -0.25, 1.0, 0x112233, 7),
        (np.nan, np.nan, np.nan, 0, 0),
        (1.5, 0.25, 2.0, 0xFFEEDD, 8),
        (2.5, 0.75, 4.0, 0x010203, 9),
    ],
    ROW,
)


def pcd(data: str, body: bytes, *, width: int = 2, height: int = 2, points: int = 4) -> bytes:
    return (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z rgb label\n"
        f"SIZE 4 4 4 4 4\nTYPE F F F U U\nCOUNT 1 1 1 1 1\nWIDTH {width}\nHEIGHT {height}\n"
        f"VIEWPOINT 1 2 3 0 1 0 0\nPOINTS {points}\nDATA {data}\n"
    ).encode() + body


def ascii_body() -> bytes:
    return "\n".join(" ".join(str(value) for value in row.tolist()) for row in ROWS).encode()


def compressed_body() -> bytes:
    columns = b"".join(np.ascontiguousarray(ROWS[name]).tobytes() for name in ROW.names or ())
    runs = [columns[at : at + 32] for at in range(0, len(columns), 32)]
    packed = b"".join(bytes([len(run) - 1]) + run for run in runs)
    return struct.pack("<II", len(packed), len(columns)) + packed


BODIES: dict[str, Callable[[], bytes]] = {
    "ascii": ascii_body,
    "binary": ROWS.tobytes,
    "binary_compressed": compressed_body,
}


@pytest.mark.parametrize("data", BODIES)
def test_pcd_of_every_kind_reads_the_same(data: str, tmp_path: Path) -> None:
    (tmp_path / "a.pcd").write_bytes(pcd(data, BODIES[data]()))
    cloud = read_pcd(tmp_path / "a.pcd")
    assert (cloud.width, cloud.height, cloud.is_organised) == (2, 2, True)
    assert np.allclose(cloud.points[[0, 2, 3]], [[0.5, -0.25, 1], [1.5, 0.25, 2], [2.5, 0.75, 4]])
    assert cloud.valid.tolist() == [True, False, True, True]
    assert np.asarray(cloud.colours)[0].tolist() == [0x11, 0x22, 0x33]
    assert np.asarray(cloud.labels).tolist() == [7, 0, 8, 9]


def test_pcd_viewpoint_is_the_pose_of_the_sensor(tmp_path: Path) -> None:
    (tmp_path / "a.pcd").write_bytes(pcd("binary", ROWS.tobytes()))
    T_cloud_sensor = read_pcd(tmp_path / "a.pcd").T_cloud_sensor
    assert T_cloud_sensor is not None
    # w = 0, x = 1: half a turn about x.
    assert np.allclose(T_cloud_sensor.apply(np.array([0.0, 0.0, 1.0])), [1.0, 2.0, 2.0])


@pytest.mark.parametrize("data", BODIES)
def test_truncated_pcd_says_so(data: str, tmp_path: Path) -> None:
    (tmp_path / "a.pcd").write_bytes(pcd(data, BODIES[data]()[:-21]))
    with pytest.raises(InvalidFrame, match=r"a\.pcd: holds .* the file is truncated"):
        read_pcd(tmp_path / "a.pcd")


def test_pcd_with_float_colours_has_the_bits_of_the_float(tmp_path: Path) -> None:
    content = pcd("binary", ROWS.tobytes()).replace(b"TYPE F F F U U", b"TYPE F F F F U")
    (tmp_path / "a.pcd").write_bytes(content)
    colours = np.asarray(read_pcd(tmp_path / "a.pcd").colours)
    assert colours[2].tolist() == [0xFF, 0xEE, 0xDD]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"FIELDS x y z", b"FIELDS x y w", "has no field z; its fields are x y w rgb label"),
        (b"SIZE 4 4 4", b"SIZE 4 4", "has 5 FIELDS, 4 SIZE"),
        (b"TYPE F F F", b"TYPE F F Q", "the header is damaged"),
        (b"POINTS 4", b"POINTS 9", "says 9 points for 2 x 2 of them"),
        (b"DATA binary", b"DATA zipped", "DATA is 'zipped'; expected ascii"),
        (b"VIEWPOINT 1 2 3 0 1 0 0", b"VIEWPOINT 1 2 3 0 0 0 0", "VIEWPOINT is"),
        (b"DATA binary\n", b"", "DATA line|has the line"),
    ],
)
def test_damaged_pcd_header_is_explained(
    old: bytes, new: bytes, message: str, tmp_path: Path
) -> None:
    (tmp_path / "a.pcd").write_bytes(pcd("binary", ROWS.tobytes()).replace(old, new))
    with pytest.raises(InvalidFrame, match=message):
        read_pcd(tmp_path / "a.pcd")


def test_lzf_copies_may_overlap_what_they_write() -> None:
    # "ab", then 10 bytes copied from 2 bytes back; length 10 = 2 + 7 + 1 takes an extra byte.
    assert decompress_lzf(bytes([1]) + b"ab" + bytes([7 << 5, 1, 1]), 12) == b"ab" * 6
    # 3 bytes copied from 4 bytes back.
    assert decompress_lzf(bytes([3]) + b"wxyz" + bytes([1 << 5, 3]), 7) == b"wxyzwxy"


@pytest.mark.parametrize(
    ("packed", "size"),
    [(bytes([1 << 5, 3]), 3), (b"\x03abcd" + bytes([7 << 5]), 20), (b"\x01ab", 3)],
)
def test_damaged_lzf_is_an_error(packed: bytes, size: int) -> None:
    with pytest.raises(InvalidFrame, match="the compressed data"):
        decompress_lzf(packed, size)


PLY_HEADER = (
    "ply\nformat {format} 1.0\ncomment made by a test\nelement vertex 3\nproperty float x\n"
    "property float y\nproperty float z\nproperty uchar red\nproperty uchar green\n"
    "property uchar blue\nproperty int label\nelement face 1\n"
    "property list uchar int vertex_indices\nend_header\n"
)
VERTICES = [(0.5, 1.0, 2.0, 1, 2, 3, 4), (1.5, 0.0, 1.0, 5, 6, 7, 8), (0.0, 0.0, 4.0, 9, 9, 9, 0)]
KINDS = {"binary_little_endian": "<", "binary_big_endian": ">"}


def ply(kind: str) -> bytes:
    header = PLY_HEADER.format(format=kind).encode()
    if kind == "ascii":
        lines = [" ".join(str(value) for value in vertex) for vertex in VERTICES]
        return header + "\n".join([*lines, "3 0 1 2", ""]).encode()
    order = KINDS[kind]
    rows = b"".join(struct.pack(f"{order}3f3Bi", *vertex) for vertex in VERTICES)
    return header + rows + struct.pack(f"{order}B3i", 3, 0, 1, 2)


@pytest.mark.parametrize("kind", ["ascii", *KINDS])
def test_ply_of_every_kind_reads_the_same(kind: str, tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_bytes(ply(kind))
    cloud = read_ply(tmp_path / "a.ply")
    assert np.array_equal(cloud.points, [[0.5, 1, 2], [1.5, 0, 1], [0, 0, 4]])
    assert np.asarray(cloud.colours).tolist() == [[1, 2, 3], [5, 6, 7], [9, 9, 9]]
    assert np.asarray(cloud.labels).tolist() == [4, 8, 0]
    assert not cloud.is_organised


def test_ply_with_a_camera_is_organised(tmp_path: Path) -> None:
    text = (
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\n"
        "property double z\nelement camera 1\nproperty int viewportx\nproperty int viewporty\n"
        "end_header\n0 0 1\n1 0 1\n0 1 1\nnan nan nan\n2 2\n"
    )
    (tmp_path / "a.ply").write_text(text)
    cloud = read_ply(tmp_path / "a.ply")
    assert (cloud.width, cloud.height) == (2, 2)


@pytest.mark.parametrize("kind", ["ascii", *KINDS])
def test_truncated_ply_says_so(kind: str, tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_bytes(ply(kind)[:-32])
    with pytest.raises(
        InvalidFrame, match=r"holds [12] of 3 rows of vertex; the file is truncated"
    ):
        read_ply(tmp_path / "a.ply")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"ply\n", b"off\n", "the file is no PLY"),
        (b"end_header\n", b"", "no end_header"),
        (b"property float z", b"property float w", "its vertices have no x, y and z"),
        (b"format ascii", b"format zipped", "the header is damaged in line 'format zipped 1.0'"),
    ],
)
def test_damaged_ply_header_is_explained(
    old: bytes, new: bytes, message: str, tmp_path: Path
) -> None:
    (tmp_path / "a.ply").write_bytes(ply("ascii").replace(old, new))
    with pytest.raises(InvalidFrame, match=message):
        read_ply(tmp_path / "a.ply")


def test_missing_cloud_is_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidFrame, match=r"none\.pcd: cannot be read"):
        read_pcd(tmp_path / "none.pcd")
    with pytest.raises(InvalidFrame, match=r"none\.ply: cannot be read"):
        read_ply(tmp_path / "none.ply")
