"""Answers to searches that ask anchoring where an unseen object would fit (pure)."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fluentboard.errors import FluentboardError
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.geometry import FloatArray
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_modules.anchoring.context_model import CrfContextModel
from fluentboard_modules.anchoring.context_prediction import CandidateVolume, volume_probabilities
from fluentboard_modules.anchoring.observation import SceneObject, SupportPlane
from fluentboard_modules.geometry_fluents import box_of
from fluentboard_modules.statements import Ending, Statement

_CHANGED = 0.01
"""Smaller changes of a probability are not worth a fluent."""


@dataclass(frozen=True, slots=True)
class SearchView:
    """What the board says about searches.

    Attributes:
        searches: open fluents of class SearchObjectActivity.
        volumes: open fluents of class SearchVolume.
        beliefs: open fluents of class VolumeBelief whose source is the context.
        geometry: open boxes and poses by name.
    """

    searches: Sequence[Fluent]
    volumes: Sequence[Fluent]
    beliefs: Sequence[Fluent]
    geometry: Mapping[str, Fluent]


def answers(
    view: SearchView, objects: Sequence[SceneObject], context: CrfContextModel, now_s: float
) -> list[Statement]:
    """Beliefs about the volumes of all searches that want them, and ends of outdated ones.

    A search is answered if its probability source is `context` and the model knows its target
    class. A belief is renewed when it changes by more than 0.01, and ended with its search.

    Args:
        view: of the board.
        objects: that are anchored.
        context: the trained model.
        now_s: time of the answer.
    """
    now = Interval.at(now_s)
    told = {_key(belief): belief for belief in view.beliefs}
    wanted: dict[tuple[str, str], float] = {}
    for search in view.searches:
        target = _local_name(_text(search, "hasTargetClass"))
        if _text(search, "hasProbabilitySource") != "context" or target not in context.classes:
            continue
        names = {str(name) for name in search.values("hasSearchVolume")}
        asked = [v for v in view.volumes if v.name in names]
        volumes = [c for v in asked if (c := _candidate(v, view.geometry, objects)) is not None]
        found = volume_probabilities(target, volumes, objects, context)
        wanted |= {(search.name, volume): value for volume, value in found.items()}
    statements: list[Statement] = []
    for key, belief in told.items():
        kept = wanted.get(key)
        if kept is not None and abs(float(belief.values("hasProbability")[-1]) - kept) < _CHANGED:
            del wanted[key]
        else:
            statements.append(Ending(belief.name, now))
    for (search_name, volume), value in sorted(wanted.items()):
        statements.append(
            Fluent(
                f"contextBelief_{search_name}_{volume}_{round(1000.0 * now_s)}",
                "VolumeBelief",
                now,
                UNKNOWN,
                (
                    Property("isBeliefOfSearch", "SearchObjectActivity", search_name),
                    Property("isBeliefAbout", "SearchVolume", volume),
                    Property("hasProbability", "xsd:double", round(value, 6)),
                    Property("hasProbabilitySource", "xsd:string", "context"),
                ),
            )
        )
    return statements


def _candidate(
    volume: Fluent, geometry: Mapping[str, Fluent], objects: Sequence[SceneObject]
) -> CandidateVolume | None:
    boxes = [geometry[str(n)] for n in volume.values("hasBoundingBox") if str(n) in geometry]
    if not boxes:
        return None
    try:
        box = box_of(boxes[-1], geometry)
    except FluentboardError:
        return None  # its pose is not there (yet)
    bottom = box.pose.z - 0.5 * box.z_size
    # The top that an anchored object over the volume stands on; else the volume's own outline.
    for one in objects:
        inside = box.contains(_centre(one))[0]
        if inside and one.support is not None:
            return CandidateVolume(volume.name, box, one.support)
    corners = box.corners()[[0, 4, 6, 2], :2]
    support = SupportPlane(bottom, corners, corners.mean(axis=0), volume.name)
    return CandidateVolume(volume.name, box, support)


def _centre(one: SceneObject) -> FloatArray:
    return np.array([[one.box.pose.x, one.box.pose.y, one.box.pose.z]])


def _text(fluent: Fluent, name: str) -> str:
    values = fluent.values(name)
    return str(values[-1]) if values else ""


def _local_name(name: str) -> str:
    return re.split(r"[:#/]", name)[-1]


def _key(belief: Fluent) -> tuple[str, str]:
    return _text(belief, "isBeliefOfSearch"), _text(belief, "isBeliefAbout")
