"""Lists of stamped things in text files, and finding the entry nearest to a stamp."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fluentboard.errors import InvalidFrame
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.frames.calibration_files import read_text

ASSOCIATION_TOLERANCE_S = 0.02
"""How far stamps of what belongs together may be apart; of the TUM RGB-D benchmark's own tool."""


@dataclass(frozen=True, eq=False)
class StampedList:
    """Entries sorted by time.

    Attributes:
        stamps_s: `(n,)`; ascending.
        fields: what stands behind each stamp.
    """

    stamps_s: FloatArray
    fields: list[list[str]]

    def __len__(self) -> int:
        return len(self.fields)

    def nearest(
        self, stamp_s: float, tolerance_s: float = ASSOCIATION_TOLERANCE_S
    ) -> list[str] | None:
        """The fields of the entry nearest in time, None if it is further off than the tolerance."""
        position = nearest(self.stamps_s, stamp_s, tolerance_s)
        return None if position is None else self.fields[position]


def read_stamped_list(path: Path) -> StampedList:
    """The entries of a file with a stamp in seconds and other fields per line; `#` comments.

    Raises:
        InvalidFrame: a line has no stamp or nothing else; the message names it.
    """
    entries: list[tuple[float, list[str]]] = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        fields = line.replace(",", " ").split()
        if not fields or fields[0].startswith("#"):
            continue
        try:
            stamp_s = float(fields[0])
        except ValueError as error:
            raise InvalidFrame(f"{path}, line {number}: starts with no stamp ({error})") from error
        if not np.isfinite(stamp_s) or len(fields) < 2:
            raise InvalidFrame(f"{path}, line {number}: {line!r} is no finite stamp and what it is")
        entries.append((stamp_s, fields[1:]))
    entries.sort(key=lambda entry: entry[0])
    return StampedList(np.array([stamp for stamp, _ in entries]), [f for _, f in entries])


def nearest(stamps_s: FloatArray, stamp_s: float, tolerance_s: float) -> int | None:
    """Position of the nearest stamp, None if it is further off than the tolerance.

    Args:
        stamps_s: `(n,)`; ascending.
        stamp_s: the stamp looked for.
        tolerance_s: the farthest that counts.
    """
    if stamps_s.size == 0:
        return None
    after = int(np.searchsorted(stamps_s, stamp_s))
    candidates = [i for i in (after - 1, after) if 0 <= i < stamps_s.size]
    best = min(candidates, key=lambda i: abs(stamps_s[i] - stamp_s))
    # Stamps around 1.3e9 s are doubles of 2e-7 s, so the tolerance cannot be exact either.
    return best if abs(stamps_s[best] - stamp_s) <= tolerance_s + 1e-6 else None
