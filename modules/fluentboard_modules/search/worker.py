"""The search worker: takes requests from the board, searches, and writes what came of it."""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fluentboard.errors import (
    BoardUnreachable,
    FluentboardError,
    NotARefinement,
)
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.geometry import BoundingBox
from fluentboard.model.interval import Interval
from fluentboard_client import AssertFluent, Client, Command, EndFluent
from fluentboard_modules.frames.live import FramePublisher
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.progress import FrameProgress
from fluentboard_modules.search.board_memory import BoardMemory
from fluentboard_modules.search.config import SearchConfig
from fluentboard_modules.search.cooccurrence import probabilities_from_memory
from fluentboard_modules.search.execution import ObjectSearch
from fluentboard_modules.search.occupancy import OccupancyMap
from fluentboard_modules.search.octomap_files import read_octomap, write_octomap
from fluentboard_modules.search.pictures import SearchAlbum
from fluentboard_modules.search.recognition import recognised
from fluentboard_modules.search.record import SearchRecord, SearchStep
from fluentboard_modules.search.region import SearchVolume, region_of
from fluentboard_modules.search.request import (
    SearchRequest,
    read_request,
    volume_fluents,
    volumes_over,
)
from fluentboard_modules.search.search_fluents import (
    SearchFluents,
    belief_fluents,
    map_fluent,
    result_fluent,
    story,
)
from fluentboard_modules.search.worlds import IdleRobot, SearchWorld
from fluentboard_modules.statements import Ending, Statement
from fluentboard_modules.worker import BatchWriter, StopRequest

logger = logging.getLogger(__name__)

_IDLE_S = 0.5
_STILL_S = 0.2  # between frames of a robot that waits, on its own clock
_CONTEXT_WAIT_S = 10.0
_CLAIMED_SHARE = 0.5  # of what a view shows; with more of it claimed by others, it is theirs
_DEFAULT_PROBABILITY = 0.2  # P_i of Section 5.3


class SearchWorker:
    """One robot that searches for whatever the board asks for.

    Args:
        world: the robot and where it is.
        board: takes requests from it.
        stop: how to ask it to stop.
        name: of the robot on the board; several robots share a search by claiming views.
        config: for what requests leave open.
        seed: of the views drawn.
        map_file: an OctoMap that is read at the beginning, if it exists, and written after every
            search.
        publisher: sends all frames to the board, so that anchoring sees them.
        recognition_s: after every look, waits so long for somebody to write what is sought.
        plot: pictures of every search go to a folder of its name there.
        recognise: in simulation, write what is sought to the board as soon as a frame shows it; for
            searches without an anchoring worker.
    """

    def __init__(
        self,
        world: SearchWorld,
        board: Client,
        stop: StopRequest,
        *,
        name: str,
        config: SearchConfig | None = None,
        seed: int = 0,
        map_file: Path | None = None,
        publisher: FramePublisher | None = None,
        recognition_s: float = 0.0,
        plot: Path | None = None,
        recognise: bool = False,
    ) -> None:
        self._world = world
        self._stop = stop
        self._name = name
        self._config = config or SearchConfig()
        self._seed = seed
        self._map_file = map_file
        self._publisher = publisher
        self._recognition_s = recognition_s
        self._recognise = recognise
        self._plot = plot
        self._writer = BatchWriter(board, FrameProgress(), stop)
        self._memory = BoardMemory(board, name, self._writer.await_board)
        self._left: set[str] = set()
        self._recognised_in: set[str] = set()
        if map_file is not None and map_file.exists():
            self._map = read_octomap(map_file, self._config.sensor)
        else:
            self._map = OccupancyMap(self._config.resolution_m, self._config.sensor)
        self.records: list[SearchRecord] = []
        """Of all searches served."""

    def run(self, once: bool = False) -> None:
        """Serves requests until asked to stop, or, with `once`, until one has been served."""
        while not self._stop.is_asked:
            activity = self._memory.next_request(self._left)
            if activity is None:
                self._stop.wait(_IDLE_S)
            else:
                self._serve(activity)
                if once:
                    return

    # -- one search -----------------------------------------------------------------------------

    def _serve(self, activity: Fluent) -> None:
        told = SearchFluents(activity.name, self._name, self._world.robot.model)
        asked_s = activity.start.latest
        if asked_s is not None and isinstance(self._world.robot, IdleRobot):
            self._world.robot.idle_until(asked_s)
        self._left.add(activity.name)
        try:
            request, volumes = self._prepared(activity)
            if request.is_afresh:
                forgotten = sum(self._map.reset(volume.box) for volume in volumes)
                logger.info("search %s: forgot %d cells", request.name, forgotten)
            search = ObjectSearch(
                self._world.robot,
                self._map,
                region_of(self._map, volumes, request.config.count_unknown_only),
                self._world.costmap,
                request.config,
                np.random.default_rng([self._seed, len(self._left)]),
            )
        except FluentboardError as problem:
            if isinstance(problem, BoardUnreachable):
                raise
            logger.warning("search %s failed: %s", activity.name, problem)
            self._write(told.result("failed", self._world.robot.time_s))
            return
        self.records.append(search.record)
        album = None
        if self._plot is not None:
            album = SearchAlbum(self._world.costmap, self._world.robot.model)
        self._search(search, request, told, album)
        if album is not None and self._plot is not None:
            for path in album.draw(search.record, self._plot / activity.name):
                logger.info("drew %s", path)
        logger.info("search %s for %s: %s", request.name, request.target, story(search.record))
        if self._map_file is not None:
            write_octomap(self._map, self._map_file)
            self._write([map_fluent(self._name, self._map_file, self._map.resolution_m)])

    def _search(
        self,
        search: ObjectSearch,
        request: SearchRequest,
        told: SearchFluents,
        album: SearchAlbum | None,
    ) -> None:
        robot = self._world.robot
        shown: list[SensorFrame] = []
        search.on_frame = shown.append
        self._write(told.begin(robot.time_s))
        is_known = self._memory.found(request) is not None
        if not is_known:
            search.look_around()

        def claim(planned: SearchStep) -> bool:
            self._write(told.claim(planned, robot.time_s))
            if not self._is_first(search, request, told, planned):
                self._write(told.release(robot.time_s))
                return False
            if album is not None:
                album.look(search, planned)
            return True

        while True:
            self._take_note(shown, request)
            found = self._recognised_in_time(request, 0.0 if is_known else self._recognition_s)
            if found is not None:
                search.end("found")
                if album is not None:
                    album.sought_map = self._memory.place_of(found)
                self._conclude(told, request.name, "found", found)
                return
            if self._stop.is_asked or not self._memory.is_open(request.name):
                search.end("cancelled")
                self._write(told.leave(robot.time_s))
                if not self._stop.is_asked and not self._memory.has_result(request.name):
                    self._write([result_fluent(request.name, "cancelled")])
                return
            self._mind_others(search, request)
            self._hear_beliefs(search, request)
            step = search.step(claim)
            if step is None:
                others = self._memory.others_at_work(request.name)
                if others:
                    self._write(told.leave(robot.time_s))
                else:
                    self._conclude(told, request.name, search.record.outcome)
                return
            self._say(step, request)
            self._write(told.done(step))

    def _recognised_in_time(self, request: SearchRequest, timeout_s: float) -> Fluent | None:
        """The target on the board; waits so long for who recognises it.

        Meanwhile the robot goes on looking: anchoring believes what it sees in several frames.
        """
        deadline = time.monotonic() + timeout_s
        stamp_s = self._world.robot.time_s
        while (found := self._memory.found(request)) is None:
            left_s = deadline - time.monotonic()
            if left_s <= 0.0 or self._stop.wait(min(left_s, _IDLE_S)):
                return None
            stamp_s = self._go_on_looking(stamp_s)
        return found

    def _go_on_looking(self, stamp_s: float) -> float:
        """Sends another frame of where the robot stands, and says the next stamp."""
        if self._publisher is None:
            return stamp_s
        # A camera that stands still delivers at once what a first look takes seconds for.
        stamp_s += _STILL_S
        self._send(replace(self._world.robot.sense(), stamp_s=stamp_s))
        return stamp_s

    def _conclude(
        self, told: SearchFluents, search: str, outcome: str, found: Fluent | None = None
    ) -> None:
        """Writes how the search ended, unless another robot has just done so."""
        time_s = self._world.robot.time_s
        self._write(told.leave(time_s))
        try:
            self._write(told.result(outcome, time_s, found))
        except NotARefinement:
            if self._memory.is_open(search):
                raise
            logger.info("search %s was ended by another robot", search)

    def _say(self, step: SearchStep, request: SearchRequest) -> None:
        logger.info(
            "search %s: at %.0f s %s %d of %d cells promised, %d in all; %.0f %% seen, %d views "
            "planned",
            request.name,
            step.moment.elapsed_s,
            "saw" if step.is_reached else "could not reach",
            step.kept_cells,
            step.expected_cells,
            step.revealed_cells,
            100.0 * step.moment.probability,
            len(step.plan),
        )

    # -- what the board knows -------------------------------------------------------------------

    def _prepared(self, activity: Fluent) -> tuple[SearchRequest, list[SearchVolume]]:
        """The request and its volumes with probabilities; volumes are written if it names none."""
        request = read_request(activity, self._memory.geometry(), self._config)
        places = [(name, box) for name, box, _ in request.volumes]
        if not places:
            places = self._own_volumes(request.name, activity.start)
        given = {name: p for name, _, p in request.volumes if p is not None}
        believed: dict[str, float] = {}
        if request.source == "co-occurrence" and request.target_class:
            boxes = [box for _, box in places]
            sightings = self._memory.sightings()
            found = probabilities_from_memory(request.target_class, boxes, sightings)
            believed = {name: p for (name, _), p in zip(places, found, strict=True)}
            time_s = self._world.robot.time_s
            self._write(belief_fluents(request.name, believed, self._name, time_s))
        elif request.source == "context":
            believed = self._await_beliefs(request.name, [name for name, _ in places])
        return request, [
            SearchVolume(name, box, believed.get(name, given.get(name, _DEFAULT_PROBABILITY)))
            for name, box in places
        ]

    def _own_volumes(self, search: str, since: Interval) -> list[tuple[str, BoundingBox]]:
        """Volumes above the placing areas, or those of the world; written to the board.

        All robots that serve the search write the same.
        """
        areas = self._memory.placing_areas()
        over = [
            volume
            for volume in volumes_over(areas, self._memory.geometry(is_open=True))
            if self._holds_cells(*volume[:2])
        ]
        if not over:
            logger.info("no placing areas on the board; searching the volumes of the world")
            over = [(name, box, "") for name, box in self._world.volumes.items()]
        statements: list[Statement] = []
        links: list[Property] = []
        for name, box, area in over:
            own = f"{name}_{search}"
            statements += volume_fluents(own, box, since, over=area)
            links.append(Property("hasSearchVolume", "SearchVolume", own))
        statements.append(Fluent(search, "SearchObjectActivity", properties=tuple(links)))
        self._write(statements)
        return [(f"{name}_{search}", box) for name, box, _ in over]

    def _holds_cells(self, name: str, box: BoundingBox) -> bool:
        """The map is fine enough for a volume; one that it is not is left out, with a warning."""
        if len(self._map.cells_in(box)):
            return True
        logger.warning(
            "volume %s of %s m holds no cell of the map and is left out", name, box.sizes.round(3)
        )
        return False

    def _await_beliefs(self, search: str, volumes: Sequence[str]) -> dict[str, float]:
        """What the anchoring module believes about the volumes; what it knows after 10 s."""
        deadline = time.monotonic() + _CONTEXT_WAIT_S
        stamp_s = self._world.robot.time_s
        while True:
            believed = self._memory.beliefs_on(search)
            if set(volumes) <= believed.keys():
                return believed
            if time.monotonic() > deadline or self._stop.wait(_IDLE_S):
                logger.warning(
                    "search %s: nobody answered about %d of %d volumes; the rest is as given",
                    search,
                    len(set(volumes) - believed.keys()),
                    len(volumes),
                )
                return believed
            # Anchoring answers with the next frame it sees.
            stamp_s = self._go_on_looking(stamp_s)

    def _hear_beliefs(self, search: ObjectSearch, request: SearchRequest) -> None:
        if request.source != "context":
            return
        believed = self._memory.beliefs_on(request.name)
        region = search.region
        region.believe([believed.get(v.name, v.probability) for v in region.volumes])

    def _mind_others(self, search: ObjectSearch, request: SearchRequest) -> None:
        """Leaves to other robots what they have claimed or taken."""
        search.elsewhere[:] = False  # what somebody could not reach is everybody's again
        for T_map_sensor in self._memory.taken_by_others(request.name):
            search.elsewhere[search.cells_seen_from(T_map_sensor)] = True

    def _is_first(
        self, search: ObjectSearch, request: SearchRequest, told: SearchFluents, step: SearchStep
    ) -> bool:
        """Whether nobody has claimed most of what a view shows while it was being planned."""
        earlier = self._memory.taken_by_others(request.name, before=told.claimed)
        if not earlier:
            return True
        own = search.cells_seen_from(self._world.robot.model.T_map_sensor(step.view))
        own = own[~search.elsewhere[own]]
        for T_map_sensor in earlier:
            search.elsewhere[search.cells_seen_from(T_map_sensor)] = True
        return not len(own) or bool(search.elsewhere[own].mean() <= _CLAIMED_SHARE)

    # -- frames ---------------------------------------------------------------------------------

    def _send(self, frame: SensorFrame) -> None:
        if self._publisher is not None:
            try:
                self._publisher.send(frame)
            except BoardUnreachable as problem:
                logger.info("a frame was not sent: %s", problem)

    def _take_note(self, frames: list[SensorFrame], request: SearchRequest) -> None:
        for frame in frames:
            self._send(frame)
            if self._recognise and request.name not in self._recognised_in:
                seen = recognised(frame, request, self._world)
                if seen:
                    self._recognised_in.add(request.name)
                    self._write(seen)
        frames.clear()

    # -- board ----------------------------------------------------------------------------------

    def _write(self, statements: Sequence[Statement]) -> None:
        commands: list[Command] = [
            EndFluent(s.name, s.finish) if isinstance(s, Ending) else AssertFluent(s, merge=True)
            for s in statements
        ]
        if commands:
            self._writer.write(commands)
