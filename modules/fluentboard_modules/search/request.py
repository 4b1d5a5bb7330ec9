"""A search request, read from the fluents of a board (pure)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from fluentboard.errors import InvalidInput
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_modules.geometry_fluents import box_fluents, box_of
from fluentboard_modules.search.config import SearchConfig
from fluentboard_modules.search.region import SearchVolume

SOURCES = ("user", "co-occurrence", "context", "uniform")
"""Where the probabilities of volumes may come from (`race:hasProbabilitySource`)."""

_HEIGHT_M = 0.3  # above a placing area: what stands on a table is seldom higher


@dataclass(frozen=True, slots=True)
class SearchRequest:
    """What a `SearchObjectActivity` asks for.

    Attributes:
        name: of the activity.
        target_class: class of what is sought; empty if a name is given.
        target_name: name of what is sought; empty if a class is given.
        volumes: where to search; their probability is None where the request gives none.
        source: where probabilities shall come from.
        config: of the search, with what the request says.
        is_afresh: what the map knows of the volumes is forgotten before the search.
    """

    name: str
    target_class: str
    target_name: str
    volumes: tuple[tuple[str, BoundingBox, float | None], ...]
    source: str
    config: SearchConfig
    is_afresh: bool = False

    @property
    def target(self) -> str:
        """What is sought, in a word."""
        return self.target_name or self.target_class


def read_request(
    activity: Fluent, by_name: Mapping[str, Fluent], config: SearchConfig
) -> SearchRequest:
    """The request of an activity.

    Args:
        activity: of the class SearchObjectActivity.
        by_name: fluents among which its volumes, their boxes and poses are.
        config: for what the activity does not say.

    Raises:
        InvalidInput: it names neither a class nor a name, or a value is out of range.
    """
    target_class, target_name = (_text(activity, f"hasTarget{k}") for k in ("Class", "Name"))
    if not target_class and not target_name:
        raise InvalidInput(
            f"search {activity.name!r} names no target; give hasTargetClass or hasTargetName"
        )
    volumes: list[tuple[str, BoundingBox, float | None]] = []
    for name in activity.values("hasSearchVolume"):
        volume = by_name.get(str(name))
        boxes = [by_name[str(b)] for b in volume.values("hasBoundingBox")] if volume else []
        if volume is None or not boxes:
            raise InvalidInput(
                f"search volume {name!r} of {activity.name!r} has no bounding box on the board; "
                "assert the box and its pose with it"
            )
        volumes.append((str(name), box_of(boxes[-1], by_name), _number(volume, "hasProbability")))
    source = _text(activity, "hasProbabilitySource")
    if source and source not in SOURCES:
        raise InvalidInput(
            f"search {activity.name!r} wants probabilities from {source!r}; give one of "
            f"{', '.join(SOURCES)}"
        )
    given = all(p is not None for _, _, p in volumes) and volumes
    settings = {
        "time_budget_s": _number(activity, "hasTimeBudget"),
        "threshold": _number(activity, "hasProbabilityThreshold"),
        "recall": _number(activity, "hasDetectorRecall"),
        "object_size_m": _number(activity, "hasMinimumObjectSize"),
        "detector_range_m": _number(activity, "hasDetectorRange"),
        "confidence_min": _number(activity, "hasMinimumConfidence"),
    }
    told = {key: value for key, value in settings.items() if value is not None}
    try:
        merged = SearchConfig.model_validate({**config.model_dump(), **told})
    except ValueError as problem:
        raise InvalidInput(f"search {activity.name!r}: {problem}") from problem
    return SearchRequest(
        activity.name,
        target_class.rpartition("#")[2].rpartition(":")[2],
        target_name,
        tuple(volumes),
        source or ("user" if given else "uniform"),
        merged,
        any(bool(value) for value in activity.values("searchesAfresh")),
    )


def volumes_over(
    areas: Iterable[Fluent], by_name: Mapping[str, Fluent]
) -> list[tuple[str, BoundingBox, str]]:
    """A volume above every placing area: its name, its box, and the area's name.

    Args:
        areas: of the class PlacingArea.
        by_name: fluents among which their boxes and poses are; open ones, as a moved table has
            several.
    """
    found: list[tuple[str, BoundingBox, str]] = []
    for area in areas:
        boxes = [by_name[str(b)] for b in area.values("hasBoundingBox") if str(b) in by_name]
        if not boxes:
            continue
        box = box_of(boxes[-1], by_name)
        centre = box.pose
        raised = Pose(
            centre.x, centre.y, centre.z + 0.5 * (_HEIGHT_M - box.z_size) + 0.5 * box.z_size,
            centre.qx, centre.qy, centre.qz, centre.qw,
        )  # fmt: skip
        name = f"searchVolume{area.name[:1].upper()}{area.name[1:]}"
        found.append((name, replace(box, pose=raised, z_size=_HEIGHT_M), area.name))
    return found


def request_fluents(
    name: str,
    *,
    target_class: str = "",
    target_name: str = "",
    volumes: Iterable[SearchVolume] = (),
    source: str = "",
    settings: Mapping[str, float] | None = None,
    is_afresh: bool = False,
    start: Interval = UNKNOWN,
) -> list[Fluent]:
    """The fluents to assert for a search.

    Args:
        name: of the activity.
        target_class: what is sought, by class.
        target_name: what is sought, by name.
        volumes: where; none: above the placing areas on the board.
        source: where the probabilities shall come from; by default from the volumes.
        settings: values of `hasTimeBudget`, `hasProbabilityThreshold` and so on.
        is_afresh: forget before the search what maps know of the volumes.
        start: when the search was asked for.
    """
    properties: list[Property] = []
    fluents: list[Fluent] = []
    if target_class:
        properties.append(Property("hasTargetClass", "xsd:string", target_class))
    if target_name:
        properties.append(Property("hasTargetName", "xsd:string", target_name))
    if source:
        properties.append(Property("hasProbabilitySource", "xsd:string", source))
    for key, value in (settings or {}).items():
        properties.append(Property(key, "xsd:double", value))
    if is_afresh:
        properties.append(Property("searchesAfresh", "xsd:boolean", True))
    for volume in volumes:
        parts = volume_fluents(volume.name, volume.box, start, volume.probability)
        fluents += parts
        properties.append(Property("hasSearchVolume", "SearchVolume", volume.name))
    return [*fluents, Fluent(name, "SearchObjectActivity", start, UNKNOWN, tuple(properties))]


def volume_fluents(
    name: str, box: BoundingBox, start: Interval, probability: float | None = None, over: str = ""
) -> list[Fluent]:
    """A search volume with its box and pose as open fluents."""
    stem = f"{name[:1].upper()}{name[1:]}"
    parts = box_fluents(f"bBox{stem}", f"poseBB{stem}", box, start)
    properties = [Property("hasBoundingBox", "BBox", parts[0].name)]
    if probability is not None:
        properties.append(Property("hasProbability", "xsd:double", probability))
    if over:
        properties.append(Property("isVolumeOver", "PlacingArea", over))
    return [*parts, Fluent(name, "SearchVolume", start, UNKNOWN, tuple(properties))]


def _text(fluent: Fluent, key: str) -> str:
    values = fluent.values(key)
    return str(values[-1]) if values else ""


def _number(fluent: Fluent, key: str) -> float | None:
    values = fluent.values(key)
    return float(values[-1]) if values else None
