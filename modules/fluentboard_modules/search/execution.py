"""The search itself: sample views, plan, move, look, integrate, and again (Figure 5.4).

It knows a robot, a map and a region, and no board: what has been found is for others to say.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidInput, UnreachableView
from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.search.config import SearchConfig
from fluentboard_modules.search.frontiers import frontiers_of
from fluentboard_modules.search.occupancy import OccupancyMap
from fluentboard_modules.search.planners import Planner, bounded, planner_of
from fluentboard_modules.search.planning import Plan, PlanningProblem
from fluentboard_modules.search.record import Moment, SearchRecord, SearchStep
from fluentboard_modules.search.region import Region, exclude_small_gaps
from fluentboard_modules.search.travel_times import Routes, places_of, seconds_between
from fluentboard_modules.search.view_sampling import SampledViews, VisibleCells, sample_views
from fluentboard_modules.simulation.navigation import Costmap
from fluentboard_modules.simulation.robots import Robot, RobotModel, View

logger = logging.getLogger(__name__)

_SAME_PLACE_M = 0.02


@runtime_checkable
class WatchfulRobot(Protocol):
    """A robot that looks while it moves (Sections 5.1.5 and 5.2.1)."""

    def attend(self, point_map: FloatArray) -> None:
        """Keeps the camera turned to that point, as far as it can, on the way to the next view."""
        ...

    def frames_on_the_way(self) -> Iterable[tuple[float, SensorFrame]]:
        """What it saw on its last way: the share of the way's time by then, and the frame."""
        ...


class ObjectSearch:
    """A search in progress.

    Args:
        robot: who searches.
        occupancy: the map; the search adds what it sees.
        region: where the object may be.
        costmap: where the robot can drive (the 2D map is taken as known and static).
        config: when to end, and how to sample and plan.
        planner: the one that the config asks for if not given; by default greedy for a robot that
            looks while it moves, else local search: the best that were measured
            (docs/reference/search.md).
        rng: draws views.
        views: a first set of views, as experiments share it; drawn if not given.
        occlusion_is_known: whether the map has all that can stand in the way, so that what a view
            shows only ever shrinks by what has been seen, and no views are drawn after the first.
        clock: measures planning; seconds.

    Raises:
        InvalidInput: the robot sees nothing within the range of the detector.
    """

    def __init__(
        self,
        robot: Robot,
        occupancy: OccupancyMap,
        region: Region,
        costmap: Costmap,
        config: SearchConfig,
        rng: np.random.Generator,
        planner: Planner | None = None,
        views: Sequence[View] = (),
        occlusion_is_known: bool = False,
        clock: Callable[[], float] = time.thread_time,
    ) -> None:
        self._robot = robot
        self._model = _as_detector(robot.model, config.detector_range_m)
        self._occupancy = occupancy
        self._region = region
        self._costmap = costmap
        self._routes = Routes(costmap)
        self._config = config
        watches = isinstance(robot, WatchfulRobot)
        self._planner: Planner = planner or planner_of(config, looks_on_the_way=watches)
        self._rng = rng
        self._clock = clock
        self._views: list[View] = list(views)
        self._cells: list[NDArray[np.int64]] = []
        self._occlusion_is_known = occlusion_is_known
        self._path_costs = self._routes.among(places_of(self._views))
        self._previous: tuple[View, ...] = ()
        self._misses = np.zeros(len(region.cells), np.int64)
        self._at_first = region.unknown(occupancy)
        region.recall = config.recall
        self._last_frame_s: float | None = None
        self.record = SearchRecord(robot.view)
        self.elsewhere: NDArray[np.bool_] = np.zeros(len(region.cells), np.bool_)
        """`(cells,)`; cells that other robots have claimed: this one plans without them."""
        self.on_frame: Callable[[SensorFrame], object] | None = None
        """Is shown every frame once it is in the map."""
        if config.object_size_m > 0.0:
            exclude_small_gaps(region, occupancy, config.object_size_m)

    @property
    def region(self) -> Region:
        """Where the object may be."""
        return self._region

    @property
    def occupancy(self) -> OccupancyMap:
        """The map."""
        return self._occupancy

    def cells_seen_from(self, T_map_sensor: Transform) -> NDArray[np.int64]:
        """Numbers of the unknown cells that a pose of the sensor would show now."""
        visible = VisibleCells(self._region, self._occupancy, self._model, self._config.sampling)
        return visible.of_pose(T_map_sensor)

    def look_around(self) -> None:
        """Takes in what the robot sees from where it is, before any plan."""
        began = self._robot.time_s
        self._integrate(self._robot.sense())
        self._note(self._robot.time_s - began, 0.0)

    def step(
        self, before_moving: Callable[[SearchStep], object] | None = None
    ) -> SearchStep | None:
        """Plans, takes the first view, and looks; None when the search is over.

        Why it is over says the record's `outcome`. A view that cannot be reached is given up, and
        the step says so.

        Args:
            before_moving: is shown the step as planned (its outcome still open), to claim the view;
                False makes it plan again, without the cells that are `elsewhere` by then.
        """
        budget = self._config.time_budget_s
        if budget is not None and self.record.duration_s >= budget:
            return self._ended("out-of-time")
        views, problem = self._problem()
        planning_s = 0.0
        while True:
            if problem is None or problem.total_probability <= 0.0:
                return self._ended("exhausted")
            if problem.total_probability < self._config.threshold:
                return self._ended("below-threshold")
            begun = self._clock()
            plan = self._plan(views, problem)
            planning_s += self._clock() - begun
            plan = bounded(problem, plan)
            if not plan.views:
                return self._ended("exhausted")
            chosen = views.views[plan.views[0]]
            promised = views.cells_of(plan.views[0])
            start = self._robot.view
            step = self._as_planned(views, problem, plan, chosen, len(promised), start)
            if before_moving is None or before_moving(step) is not False:
                break
            problem = replace(problem, cell_p=np.where(self.elsewhere, 0.0, problem.cell_p))
        self._previous = tuple(views.views[v] for v in plan.views[1:])
        unknown = self._region.unknown(self._occupancy)
        reached = self._go(chosen, planning_s, step.path)
        left = self._region.unknown(self._occupancy)
        revealed = unknown & ~left  # before any are given up: those were not seen
        if reached:
            still = left[promised]
            self._misses[promised[still]] += 1
            self._region.excluded |= self._misses >= self._config.misses_max
        else:
            self._forget(chosen)
        left = self._region.unknown(self._occupancy)
        done = SearchStep(
            view=chosen,
            is_reached=reached,
            plan=step.plan,
            expected_time_s=step.expected_time_s,
            success_probability=step.success_probability,
            gap=step.gap,
            candidates=step.candidates,
            gains=step.gains,
            expected_cells=step.expected_cells,
            revealed_cells=int(revealed.sum()),
            unknown_cells=int(left.sum()),
            remaining_probability=step.remaining_probability,
            path=step.path,
            moment=self.record.moments[-1],
            stamp_s=self._robot.time_s,
            kept_cells=int(revealed[promised].sum()),
        )
        self.record.steps.append(done)
        return done

    def end(self, outcome: str) -> None:
        """Ends the search for a reason that lies outside of it: `found` or `cancelled`."""
        self.record.outcome = outcome

    # -- planning -------------------------------------------------------------------------------

    def _problem(self) -> tuple[SampledViews, PlanningProblem | None]:
        """The views that show something now, old and new, as a planning problem."""
        model = self._model
        visible = VisibleCells(self._region, self._occupancy, model, self._config.sampling)
        if self._occlusion_is_known and self._cells:
            wanted = self._region.wanted(self._occupancy)
            self._cells = [cells[wanted[cells]] for cells in self._cells]
        else:
            self._cells = [visible.of(view) for view in self._views]
        self._keep(np.array([len(cells) > 0 for cells in self._cells], np.bool_))
        self._draw(visible)
        views = SampledViews.joined(self._views, self._cells)
        if not len(views):
            return views, None
        here = self._robot.view
        times = np.zeros((len(views) + 1, len(views) + 1))
        times[1:, 1:] = seconds_between(model, views.views, views.views, self._path_costs)
        away = self._routes.between(places_of([here]), places_of(views.views))
        times[0, 1:] = seconds_between(model, [here], views.views, away)[0]
        times[1:, 0] = times[0, 1:]
        return views, PlanningProblem(
            np.where(self.elsewhere, 0.0, self._region.probability(self._occupancy)),
            views.ptr,
            views.cells,
            times,
            self._config.threshold,
            self._config.recall,
        )

    def _draw(self, visible: VisibleCells) -> None:
        """Draws new views where there is room for more, with the ways to all others."""
        config = self._config
        room = max(0, config.sampling.views - len(self._views))
        wanted = room if not self._views else min(config.new_views, room)
        if not wanted or (self._occlusion_is_known and self._views):
            return
        here = self._robot.view
        new = sample_views(
            frontiers_of(self._region, self._occupancy),
            visible,
            self._model,
            self._costmap,
            self._costmap.path_costs(here.x, here.y),
            config.sampling,
            self._rng,
            wanted,
        )
        if not len(new):
            return
        before, after = len(self._views), len(self._views) + len(new)
        self._views += new.views
        self._cells += [new.cells_of(n) for n in range(len(new))]
        costs = np.zeros((after, after))
        costs[:before, :before] = self._path_costs
        rows = self._routes.between(places_of(new.views), places_of(self._views))
        costs[before:] = rows
        costs[:, before:] = rows.T
        self._path_costs = costs

    def _keep(self, kept: NDArray[np.bool_]) -> None:
        self._views = [v for v, ok in zip(self._views, kept, strict=True) if ok]
        self._cells = [c for c, ok in zip(self._cells, kept, strict=True) if ok]
        self._path_costs = self._path_costs[np.ix_(kept, kept)]

    def _plan(self, views: SampledViews, problem: PlanningProblem) -> Plan:
        number = {view: n for n, view in enumerate(views.views)}
        previous = tuple(number[view] for view in self._previous if view in number)
        return self._planner.find(problem, previous)

    def _as_planned(
        self,
        views: SampledViews,
        problem: PlanningProblem,
        plan: Plan,
        chosen: View,
        promised: int,
        start: View,
    ) -> SearchStep:
        log_absent = np.log1p(-problem.cell_p)
        sums = np.concatenate([[0.0], np.cumsum(log_absent[views.cells])])
        try:
            path = self._costmap.path((start.x, start.y), (chosen.x, chosen.y)).points
        except UnreachableView:
            path = np.array([[start.x, start.y]])
        return SearchStep(
            view=chosen,
            is_reached=False,
            plan=tuple(views.views[v] for v in plan.views),
            expected_time_s=plan.expected_time_s,
            success_probability=plan.success_probability,
            gap=plan.gap,
            candidates=views.views,
            gains=-np.expm1(np.diff(sums[views.ptr])),
            expected_cells=promised,
            revealed_cells=0,
            unknown_cells=int(self._region.unknown(self._occupancy).sum()),
            remaining_probability=problem.total_probability,
            path=path,
            moment=self.record.moments[-1],
            stamp_s=self._robot.time_s,
        )

    # -- moving and looking ---------------------------------------------------------------------

    def _go(self, view: View, planning_s: float, way: FloatArray) -> bool:
        robot = self._robot
        # Planning happens before anything moves.
        self._note(0.0, planning_s)
        watchful = robot if isinstance(robot, WatchfulRobot) else None
        if watchful is not None:
            range_max_m = self._model.range_m[1]
            watchful.attend(self._region.worth_watching(self._occupancy, way, range_max_m))
        began = robot.time_s
        reached = True
        try:
            robot.move_to(view)
        except UnreachableView as problem:
            logger.info("view given up: %s", problem.message)
            reached = False
        moving = robot.time_s - began
        noted = 0.0
        if watchful is not None:
            for share, frame in watchful.frames_on_the_way():
                self._integrate(frame)
                self._note((share - noted) * moving, 0.0)
                noted = share
        if reached:
            began_look = robot.time_s
            frame = robot.sense()
            self._integrate(frame)
            self._note((1.0 - noted) * moving + robot.time_s - began_look, 0.0)
        else:
            self._note((1.0 - noted) * moving, 0.0)
        return reached

    def _integrate(self, frame: SensorFrame) -> None:
        half_life, last = self._config.fade_half_life_s, self._last_frame_s
        if half_life is not None and last is not None:
            self._occupancy.fade(frame.stamp_s - last, half_life)
        self._last_frame_s = frame.stamp_s
        if self._region.recall < 1.0:
            before = self._region.unknown(self._occupancy)
            self._occupancy.integrate_frame(frame, self._model.range_m[1])
            looked_at = before & ~self._region.unknown(self._occupancy)
            looked_at[self.cells_seen_from(frame.T_map_sensor)] = True
            self._region.looks += looked_at
        else:
            self._occupancy.integrate_frame(frame, self._model.range_m[1])
        if self.on_frame is not None:
            self.on_frame(frame)

    def _note(self, elapsed_s: float, planning_s: float) -> None:
        seen = self._at_first & ~(self._occupancy.states(self._region.cells) == -1)
        before = self.record.moments[-1]
        found = self._region.prior[seen]
        if self._region.recall < 1.0:
            found = found * (1.0 - (1.0 - self._region.recall) ** self._region.looks[seen])
        probability = 1.0 - float(np.exp(np.log1p(-found).sum()))
        self.record.moments.append(
            Moment(before.elapsed_s + elapsed_s, before.planning_s + planning_s, probability)
        )

    def _forget(self, view: View) -> None:
        """Gives up a view that could not be reached, and those that stand practically there."""
        near = np.array(
            [abs(v.x - view.x) + abs(v.y - view.y) < _SAME_PLACE_M for v in self._views]
        )
        self._keep(~near)

    def _ended(self, outcome: str) -> None:
        self.record.outcome = outcome


def _as_detector(model: RobotModel, range_max_m: float | None) -> RobotModel:
    """The robot as far as it recognises things, which may be nearer than its camera sees."""
    near, far = model.range_m
    if range_max_m is None or range_max_m >= far:
        return model
    if range_max_m <= near:
        raise InvalidInput(
            f"a detector range of {range_max_m} m; {model.name} sees nothing nearer than {near} m"
        )
    return model.model_copy(update={"range_m": (near, range_max_m)})
