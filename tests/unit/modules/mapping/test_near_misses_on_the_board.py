"""What nearly was furniture is on the board with the reason why it is not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Interval
from fluentboard_modules.mapping.furniture_item import FurniturePlane
from fluentboard_modules.mapping.near_miss_fluents import near_miss_fluents
from fluentboard_modules.mapping.near_misses import NearMiss
from fluentboard_modules.statements import Ending

REASON = "no chair seat plane: height above the floor 0.61 m, must be less than 0.53 m"


def a_miss(make_plane: Any) -> tuple[NearMiss, FurniturePlane]:
    seat = FurniturePlane(4, "HorizontalPlane", make_plane((1.0, 2.0, 0.61), size=(0.4, 0.4)), 9)
    return NearMiss("Chair", 0, REASON, 0.15), seat


def test_a_near_miss_says_of_what_why_and_where(make_plane: Any) -> None:
    statements = near_miss_fluents([a_miss(make_plane)], [], 7.0)
    plane, miss = (s for s in statements if isinstance(s, Fluent))
    assert (miss.class_name, miss.values("isNearMissOf")) == ("NearMiss", ("Chair",))
    assert miss.values("hasReason") == (REASON,)
    assert miss.values("isAboutPlane") == (plane.name,)
    assert (plane.class_name, plane.values("hasPosY")) == ("HorizontalPlane", (0.61,))
    assert "1.200 1.800 0.610" in str(plane.values("hasContour")[0])


def test_those_of_the_run_before_end_and_their_names_are_not_used_again(make_plane: Any) -> None:
    first = [s for s in near_miss_fluents([a_miss(make_plane)], [], 7.0) if isinstance(s, Fluent)]
    known = [fluent for fluent in first if fluent.class_name == "NearMiss"]
    second = near_miss_fluents([a_miss(make_plane)], known, 20.0)
    ended = {s.name: s.finish for s in second if isinstance(s, Ending)}
    assert ended == dict.fromkeys((fluent.name for fluent in first), Interval.at(20.0))
    assert not {s.name for s in second if isinstance(s, Fluent)} & {fluent.name for fluent in first}


def test_a_recording_played_again_ends_nothing_that_came_later(make_plane: Any) -> None:
    later = Fluent("nearMissChair_1", "NearMiss", start=Interval.at(50.0))
    assert near_miss_fluents([], [later], 7.0) == []
    assert near_miss_fluents([], [replace(later, finish=Interval.at(60.0))], 70.0) == []
