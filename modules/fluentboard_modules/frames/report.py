"""`fluentboard frames`: what is in a source, and the source as a recording on disk."""

from __future__ import annotations

import itertools
from pathlib import Path

from fluentboard_modules.frames.sources import open_source


def describe(text: str) -> str:
    """Lines about the source that a text names, taken from its first frames.

    Args:
        text: as for `open_source`.
    """
    source = open_source(text)
    lines = [f"{source.name}: {len(source)} frames"]
    for frame in itertools.islice(source, 1):
        camera = frame.camera
        colour = "no colour" if frame.colour is None else f"colour {frame.colour.shape[1]} x "
        if frame.colour is not None:
            colour += str(frame.colour.shape[0])
        lines += [
            f"depth {camera.width} x {camera.height}, f = {camera.fx:.1f}, {camera.fy:.1f} px, "
            f"c = ({camera.cx:.1f}, {camera.cy:.1f}) px; {colour}",
            f"first frame at {frame.stamp_s:.3f} s, {100.0 * frame.valid.mean():.0f} % of its "
            "pixels with depth",
        ]
    return "\n".join(lines)


def write(text: str, folder: Path) -> int:
    """Writes the frames of a source as a recording; returns how many.

    Args:
        text: as for `open_source`.
        folder: created if missing; must not hold a recording.
    """
    from fluentboard_modules.simulation.recording import record

    source = open_source(text)
    return record(source, folder, getattr(source, "scene", None))
