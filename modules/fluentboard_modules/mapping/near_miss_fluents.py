"""Near misses as fluents (pure): why is this not a chair?

At the end of a run the planes that are nearly furniture, and belong to no piece, are written with
the one condition that fails. Those of the run before are ended.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_modules.mapping.furniture_item import FurniturePlane
from fluentboard_modules.mapping.near_misses import NearMiss
from fluentboard_modules.mapping.plane_fluents import plane_properties
from fluentboard_modules.statements import Ending, Statement

_AT_MOST = 20  # the nearest ones; a cluttered room has hundreds


def near_miss_fluents(
    misses: Sequence[tuple[NearMiss, FurniturePlane]], known: Iterable[Fluent], now_s: float
) -> list[Statement]:
    """The statements that bring the board's near misses up to date.

    Args:
        misses: with the plane that each is about, the nearest first.
        known: all near misses on the board, ended ones too: their names are taken.
        now_s: time of the last frame.
    """
    now = Interval.at(now_s)
    before = list(known)
    statements: list[Statement] = [
        Ending(name, now)
        for miss in before
        if miss.is_open and not _is_later(miss, now_s)
        for name in (miss.name, *map(str, miss.values("isAboutPlane")))
    ]
    number = max((_number(miss.name) for miss in before), default=0)
    for offset, (miss, plane) in enumerate(misses[:_AT_MOST], 1):
        name = f"nearMiss{miss.class_name}_{number + offset}"
        plane_name = f"plane{name[0].upper()}{name[1:]}"
        about = (
            Property("isNearMissOf", "xsd:string", miss.class_name),
            Property("hasReason", "xsd:string", miss.reason),
            Property("hasShortfall", "xsd:double", round(miss.shortfall, 4)),
            Property("isAboutPlane", plane.label, plane_name),
        )
        statements.append(Fluent(plane_name, plane.label, now, UNKNOWN, plane_properties(plane)))
        statements.append(Fluent(name, "NearMiss", now, UNKNOWN, about))
    return statements


def _is_later(miss: Fluent, now_s: float) -> bool:
    """Whether it was written later than now: a recording is played again."""
    return miss.start.latest is not None and miss.start.latest > now_s


def _number(name: str) -> int:
    found = re.search(r"_(\d+)$", name)
    return int(found.group(1)) if found else 0
