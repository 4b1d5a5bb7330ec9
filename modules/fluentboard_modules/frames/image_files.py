"""Encoded images to arrays and back, with every kind of damage turned into InvalidFrame.

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
# A camera's pixels are not turned for viewing: its intrinsics are those of the image as stored.
_AS_STORED = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION


def read_depth_m(path: Path, units_per_m: float) -> NDArray[np.float32]:
    """`(h, w)` float32; depth in metres, 0 where the sensor saw nothing.

    Args:
        path: a 16-bit, one-channel PNG; the values 0 and 65535 mean "no measurement".
        units_per_m: how many of the file's units make a metre (1000 for millimetres).

    Raises:
        InvalidFrame: the file is missing, damaged, or not a 16-bit image of one channel.
    """
    return decode_depth_m(_content(path), str(path), units_per_m)


def decode_depth_m(content: bytes, where: str, units_per_m: float) -> NDArray[np.float32]:
    """The same of a PNG in memory.

    Args:
        content: of the file.
        where: names it in errors.
        units_per_m: how many of its units make a metre.

    Raises:
        InvalidFrame: as `read_depth_m`.
    """
    return depth_in_m(decode_u16(content, where), units_per_m)


def depth_in_m(raw: NDArray[np.uint16], units_per_m: float) -> NDArray[np.float32]:
    """`(h, w)` float32; raw depth in metres; 0 and 65535, "no measurement", become 0."""
    depth_m = raw.astype(np.float32) / np.float32(units_per_m)
    depth_m[raw == np.iinfo(np.uint16).max] = 0.0
    return depth_m


def decode_u16(content: bytes, where: str) -> NDArray[np.uint16]:
    """`(h, w)` uint16; the image of a PNG in memory.

    Raises:
        InvalidFrame: it is damaged or not a 16-bit image of one channel.
    """
    image = _decode(content, where, cv2.IMREAD_UNCHANGED)
    if image.dtype != np.uint16 or image.ndim != 2:
        channels = 1 if image.ndim == 2 else image.shape[2]
        raise InvalidFrame(
            f"{where}: a depth image is a 16-bit image of one channel, this one has {channels} "
            f"channel(s) of {8 * image.dtype.itemsize} bits"
        )
    return image


def read_labels(path: Path) -> NDArray[np.int32]:
    """`(h, w)` int32; the instance labels of a PNG of 8 or 16 bits.

    Raises:
        InvalidFrame: the file is missing, damaged, or has more than one channel.
    """
    image = _decode(_content(path), str(path), cv2.IMREAD_UNCHANGED)
    if image.ndim != 2:
        raise InvalidFrame(f"{path}: a label image has one channel, this one {image.shape[2]}")
    return image.astype(np.int32)


def read_colour(path: Path) -> NDArray[np.uint8]:
    """`(h, w, 3)` uint8; the RGB image of a PNG or JPEG file.

    Raises:
        InvalidFrame: the file is missing, damaged, or no image.
    """
    return decode_colour(_content(path), str(path))


def decode_colour(content: bytes, where: str) -> NDArray[np.uint8]:
    """`(h, w, 3)` uint8; the RGB image of a PNG or JPEG in memory.

    Raises:
        InvalidFrame: it is damaged or no image.
    """
    return np.ascontiguousarray(_decode(content, where, _AS_STORED)[..., ::-1])


def encode_depth_mm(depth_m: NDArray[np.float32]) -> bytes:
    """A 16-bit PNG of millimetres, 0 where the depth is unknown or beyond 65.534 m."""
    millimetres = np.rint(np.nan_to_num(depth_m, posinf=0.0, neginf=0.0) * np.float32(1000.0))
    millimetres[(millimetres < 0.0) | (millimetres >= np.iinfo(np.uint16).max)] = 0.0
    return encode_u16(millimetres.astype(np.uint16))


def encode_u16(image: NDArray[np.uint16]) -> bytes:
    """A 16-bit PNG of one channel."""
    # Level 1 is half the time of the default for a few percent more bytes.
    return _encode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])


def encode_colour(colour: NDArray[np.uint8], ending: str = ".jpg", quality: int = 90) -> bytes:
    """A JPEG or PNG of an RGB image.

    Args:
        colour: `(h, w, 3)` uint8.
        ending: `.jpg` is small, `.png` exact.
        quality: of the JPEG, 1 to 100.
    """
    options = [cv2.IMWRITE_JPEG_QUALITY, quality] if ending == ".jpg" else []
    return _encode(ending, np.ascontiguousarray(colour[..., ::-1]), options)


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


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InvalidFrame(
            f"{path}: cannot be read ({error.strerror}); restore the file"
        ) from error


def _decode(content: bytes, where: str, flags: int) -> NDArray[Any]:
    problem = _damage(content)
    if problem is not None:
        raise InvalidFrame(f"{where}: {problem}; record or download it again")
    try:
        image = cv2.imdecode(np.frombuffer(content, dtype=np.uint8), flags)
    except cv2.error as error:
        raise InvalidFrame(f"{where}: cannot be decoded ({error}); convert it") from error
    if image is None:
        raise InvalidFrame(f"{where}: cannot be decoded as an image; convert it to PNG")
    return image


def _encode(ending: str, image: NDArray[Any], options: list[int]) -> bytes:
    is_encoded, content = cv2.imencode(ending, image, options)
    if not is_encoded:
        raise InvalidFrame(f"an image of shape {image.shape} cannot be encoded as {ending}")
    return content.tobytes()


def _damage(content: bytes) -> str | None:
    """What is wrong with the bytes of an image file, None if nothing shows."""
    if not content:
        return "is empty"
    if content.startswith(_PNG_SIGNATURE):
        return _png_damage(content)
    if content.startswith(_JPEG_START):
        # Some cameras pad their files, so the end marker need not be the very last two bytes.
        return None if _JPEG_END in content[-64:] else "the JPEG is truncated: it has no end marker"
    return "is neither a PNG nor a JPEG image"


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
