"""What a search asks of the board, again and again while the board is away."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Collection, Iterable
from typing import TypeVar

import numpy as np

from fluentboard.errors import BoardUnreachable, UnknownFluent
from fluentboard.model.fluent import Fluent
from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_client import Client, Iri
from fluentboard_modules.geometry_fluents import pose_of
from fluentboard_modules.search.cooccurrence import Sighting
from fluentboard_modules.search.request import SearchRequest

logger = logging.getLogger(__name__)

_Answer = TypeVar("_Answer")

_OBJECTS = """
SELECT ?object ?class ?x ?y ?z ?ends WHERE {
  ?object upper:hasPose ?pose ; a ?own .
  ?own rdfs:subClassOf* ?class .
  ?pose upper:hasX ?x ; upper:hasY ?y ; upper:hasZ ?z ; upper:hasFinishEarliest ?ends .
  ?own rdfs:subClassOf* upper:PassiveObject .
}
"""


class BoardMemory:
    """Reads for one robot what searches need to know; a board that is away is waited for.

    Args:
        board: what it reads from.
        robot: name of the robot on the board.
        await_board: returns once the board is back, or False if the worker is to stop instead.

    Raises:
        BoardUnreachable: from every method, if the worker is to stop while the board is away.
    """

    def __init__(self, board: Client, robot: str, await_board: Callable[[], bool]) -> None:
        self._board = board
        self._robot = robot
        self._await_board = await_board

    def next_request(self, served: Collection[str]) -> Fluent | None:
        """An open search that has not been served, if there is one."""
        for activity in self._fluents("SearchObjectActivity"):
            if activity.name not in served:
                return activity
        return None

    def is_open(self, search: str) -> bool:
        """Whether the search still goes on."""
        return self._fluent(search).finish.is_unknown

    def has_result(self, search: str) -> bool:
        """Whether somebody has written how the search ended."""
        return bool(self._fluent(search).values("hasResult"))

    def placing_areas(self) -> list[Fluent]:
        """All that hold now."""
        return self._fluents("PlacingArea")

    def geometry(self, is_open: bool | None = None) -> dict[str, Fluent]:
        """Search volumes, boxes and poses by name."""
        classes = ("SearchVolume", "BBox", "Pose")
        return {f.name: f for cls in classes for f in self._fluents(cls, is_open)}

    def sightings(self) -> list[Sighting]:
        """Where objects are and were."""
        rows = self._patiently(lambda: list(self._board.select(_OBJECTS)))
        classes: dict[tuple[str, float, float, float, float], set[str]] = {}
        for row in rows:
            thing, above = row["object"], row["class"]
            if isinstance(thing, Iri) and isinstance(above, Iri):
                x, y, z, ends = (float(row[key] or 0.0) for key in ("x", "y", "z", "ends"))
                classes.setdefault((thing.name, x, y, z, ends), set()).add(above.name)
        return [
            Sighting(name, frozenset(above), np.array([x, y, z]), math.isinf(ends))
            for (name, x, y, z, ends), above in classes.items()
        ]

    def beliefs_on(self, search: str) -> dict[str, float]:
        """The newest open belief about every volume of a search."""
        beliefs = self._patiently(
            lambda: list(
                self._board.fluents(
                    "VolumeBelief", is_open=True, property_name="isBeliefOfSearch", value=search
                )
            )
        )
        found: dict[str, tuple[int, float]] = {}
        for belief in beliefs:
            for volume in belief.values("isBeliefAbout"):
                known = found.get(str(volume), (-1, 0.0))
                value = float(belief.values("hasProbability")[-1])
                found[str(volume)] = max(known, (belief.created, value))
        return {name: probability for name, (_, probability) in found.items()}

    def found(self, request: SearchRequest) -> Fluent | None:
        """The target: an open object with a pose; by class, one that is told surely enough."""
        if request.target_name:
            try:
                candidates: Iterable[Fluent] = [self._fluent(request.target_name)]
            except UnknownFluent:
                return None
        else:
            candidates = self._fluents(request.target_class)
        for fluent in candidates:
            if fluent.finish.is_unknown and fluent.values("hasPose"):
                least = request.config.confidence_min
                if request.target_name or not least or self._confidence_in(fluent) >= least:
                    return fluent
        return None

    def _confidence_in(self, thing: Fluent) -> float:
        """That it is of its class, by the newest open evidence; 1 if nobody says how he knows."""
        evidence = self._patiently(
            lambda: list(
                self._board.fluents(
                    "ClassEvidence", is_open=True, property_name="isEvidenceFor", value=thing.name
                )
            )
        )
        if not evidence:
            return 1.0
        newest = max(evidence, key=lambda fluent: fluent.created)
        return float(newest.values("hasConfidence")[-1])

    def place_of(self, thing: Fluent) -> FloatArray:
        """`(3,)`; where an object is, in metres, map frame."""
        pose = pose_of(self._fluent(str(thing.values("hasPose")[-1])))
        return np.array([pose.x, pose.y, pose.z])

    def others_at_work(self, search: str) -> bool:
        """Whether another robot has an open claim."""
        return any(view.finish.is_unknown for view in self._views_of_others(search))

    def taken_by_others(self, search: str, before: str = "") -> list[Transform]:
        """Poses of the sensor, in the map frame, of views that other robots claim or have taken.

        Args:
            search: the activity.
            before: name of a view; only what was claimed before it counts.
        """
        latest = self._fluent(before).created if before else None
        poses: list[Transform] = []
        for view in self._views_of_others(search):
            outcome = view.values("hasViewOutcome")
            is_earlier = latest is None or view.created < latest
            if is_earlier and view.values("hasPose") and (not outcome or outcome[-1] == "taken"):
                pose = pose_of(self._fluent(str(view.values("hasPose")[-1])))
                poses.append(pose.to_transform())
        return poses

    def _views_of_others(self, search: str) -> list[Fluent]:
        views = [self._fluent(str(name)) for name in self._fluent(search).values("hasView")]
        return [v for v in views if self._robot not in map(str, v.values("hasRobot"))]

    def _fluent(self, name: str) -> Fluent:
        return self._patiently(lambda: self._board.fluent(name))

    def _fluents(self, cls: str, is_open: bool | None = True) -> list[Fluent]:
        return self._patiently(lambda: list(self._board.fluents(cls, is_open=is_open)))

    def _patiently(self, ask: Callable[[], _Answer]) -> _Answer:
        while True:
            try:
                return ask()
            except BoardUnreachable as problem:
                logger.info("%s", problem)
                if not self._await_board():
                    raise
