"""Image files to arrays, with every kind of damage turned into InvalidFrame.

OpenCV alone is not enough: it returns a half-decoded picture for a truncated file and says so on
the C library's stderr only, so the file's structure is checked before it is decoded.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidFrame

_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_JPEG_START, _JPEG_END = b"\xff\xd8\xff", b"\xff\xd9"


def read_depth_m(path: Path, units_per_m: float) -> NDArray[np.float32]:
    """`(h, w)` float32; depth in metres, 0 where the sensor saw nothing.

    Args:
        path: a 16-bit, one-channel PNG; the values 0 and 65535 mean "no measurement".
        units_per_m: how many of the file's units make a metre (1000 for millimetres).

    Raises:
        InvalidFrame: the file is missing, damaged, or not a 16-bit image of one channel.
    """
    image = _decode(path, cv2.IMREAD_UNCHANGED)
    if image.dtype != np.uint16 or image.ndim != 2:
        channels = 1 if image.ndim == 2 else image.shape[2]
        raise InvalidFrame(
            f"{path}: a depth image is a 16-bit image of one channel, this one has {channels} "
            f"channel(s) of {8 * image.dtype.itemsize} bits"
        )
    depth_m = image.astype(np.float32) / np.float32(units_per_m)
    depth_m[image == np.iinfo(np.uint16).max] = 0.0
    return depth_m


def read_colour(path: Path) -> NDArray[np.uint8]:
    """`(h, w, 3)` uint8; the RGB image of a PNG or JPEG file.

    Raises:
        InvalidFrame: the file is missing, damaged, or no image.
    """
    return np.ascontiguousarray(_decode(path, cv2.IMREAD_COLOR)[..., ::-1])


def png_size(path: Path) -> tuple[int, int] | None:
    """Width and height in pixels from the header of a PNG, None if it has no such header."""
    try:
        with path.open("rb") as file:
            header = file.read(24)
    except OSError:
        return None  # reading the frame itself will say what is wrong with the file
    if len(header) < 24 or not header.startswith(_PNG_SIGNATURE):
        return None
    width, height = struct.unpack_from(">II", header, 16)
    return width, height


def _decode(path: Path, flags: int) -> NDArray[Any]:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InvalidFrame(
            f"{path}: cannot be read ({error.strerror}); restore the file"
        ) from error
    problem = _damage(content)
    if problem is not None:
        raise InvalidFrame(f"{path}: {problem}; record or download the file again")
    try:
        image = cv2.imdecode(np.frombuffer(content, dtype=np.uint8), flags)
    except cv2.error as error:
        raise InvalidFrame(f"{path}: cannot be decoded ({error}); convert the file") from error
    if image is None:
        raise InvalidFrame(f"{path}: cannot be decoded as an image; convert the file to PNG")
    return image


def _damage(content: bytes) -> str | None:
    """What is wrong with the bytes of an image file, None if nothing shows."""
    if not content:
        return "the file is empty"
    if content.startswith(_PNG_SIGNATURE):
        return _png_damage(content)
    if content.startswith(_JPEG_START):
        # Some cameras pad their files, so the end marker need not be the very last two bytes.
        return None if _JPEG_END in content[-64:] else "the JPEG ends before its end marker"
    return "neither a PNG nor a JPEG image"


def _png_damage(content: bytes) -> str | None:
    """Walks the chunks of a PNG and checks their lengths and checksums."""
    at = len(_PNG_SIGNATURE)
    while at + 12 <= len(content):
        (length,) = struct.unpack_from(">I", content, at)
        end = at + 12 + length
        kind = content[at + 4 : at + 8]
        if end > len(content):
            break
        (checksum,) = struct.unpack_from(">I", content, end - 4)
        if zlib.crc32(content[at + 4 : end - 4]) != checksum:
            return f"the checksum of PNG chunk {kind.decode('ascii', 'replace')} is wrong"
        if kind == b"IEND":
            return None
        at = end
    return f"the PNG is truncated after {len(content)} bytes"
