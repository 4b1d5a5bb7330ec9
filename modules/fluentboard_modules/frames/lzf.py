"""LZF decompression: what PCD files of the kind `binary_compressed` are packed with."""

from __future__ import annotations

from fluentboard.errors import InvalidFrame

_LONGEST_LITERAL = 32


def decompress_lzf(packed: bytes, size: int) -> bytes:
    """The data that LZF packed.

    Args:
        packed: the compressed data.
        size: how many bytes it expands to.

    Raises:
        InvalidFrame: the data is damaged or expands to another size.
    """
    out = bytearray()
    at, end = 0, len(packed)
    try:
        while at < end:
            control = packed[at]
            at += 1
            if control < _LONGEST_LITERAL:  # a run of bytes as they are
                out += packed[at : at + control + 1]
                at += control + 1
                continue
            length = control >> 5
            if length == 7:
                length += packed[at]
                at += 1
            length += 2
            distance = ((control & 0x1F) << 8 | packed[at]) + 1
            at += 1
            start = len(out) - distance
            if start < 0 or len(out) + length > size:
                raise InvalidFrame(f"the compressed data is damaged at byte {at}")
            if distance >= length:
                out += out[start : start + length]
            else:  # the copy overlaps what it writes: the last bytes repeat
                out += (out[start:] * (length // distance + 1))[:length]
    except IndexError:
        raise InvalidFrame("the compressed data ends in the middle of a piece") from None
    if len(out) != size:
        raise InvalidFrame(f"the compressed data holds {len(out)} bytes, expected {size}")
    return bytes(out)
