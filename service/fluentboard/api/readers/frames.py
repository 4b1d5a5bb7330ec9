"""Frames: what the service and a reader say to each other over a pair of pipes.

A frame is a header in JSON and a body of bytes, each preceded by its length.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import IO, Any

import orjson

_LENGTHS = struct.Struct("<II")


def write_frame(pipe: IO[bytes], header: Mapping[str, Any], body: bytes = b"") -> None:
    """Sends a frame.

    Raises:
        OSError: nobody reads any more.
    """
    packed = orjson.dumps(header)
    pipe.write(_LENGTHS.pack(len(packed), len(body)) + packed + body)
    pipe.flush()


def read_frame(pipe: IO[bytes]) -> tuple[dict[str, Any], bytes]:
    """Waits for the next frame.

    Raises:
        EOFError: the other side has ended.
    """
    header_bytes, body_bytes = _LENGTHS.unpack(_exactly(pipe, _LENGTHS.size))
    header = orjson.loads(_exactly(pipe, header_bytes))
    return header, _exactly(pipe, body_bytes)


def _exactly(pipe: IO[bytes], count: int) -> bytes:
    found = pipe.read(count)
    if len(found) < count:
        raise EOFError("the other side has ended")
    return found
