"""The three experiments of Section 5.3, and what is measured in them.

Offline: one plan with a full map. Known: plan, move, look and plan again with a full map. Unknown:
the same when only the walls are known. All planners of a trial get the same start, the same views
and the same transition times. As in the original experiments, the robot looks at its views only;
that it also looks while it drives (Section 5.1.5) is an option.

The expected time of an executed search is Eq. 5.4 with what was really seen: every second counts
with the probability that the object has not been in anything seen by then. No object is hidden, so
a trial needs no repetition.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.search.config import (
    BranchAndBoundConfig,
    PlannerConfig,
    SearchConfig,
    ViewSamplingConfig,
)
from fluentboard_modules.search.execution import ObjectSearch
from fluentboard_modules.search.frontiers import frontiers_of
from fluentboard_modules.search.known_world import map_of_scene
from fluentboard_modules.search.occupancy import OccupancyMap
from fluentboard_modules.search.planners import (
    BranchAndBound,
    Greedy,
    IteratedLocalSearch,
    Planner,
    bounded,
)
from fluentboard_modules.search.planning import Plan, PlanningProblem
from fluentboard_modules.search.record import SearchRecord
from fluentboard_modules.search.region import Region, SearchVolume, region_of
from fluentboard_modules.search.travel_times import transition_times_s
from fluentboard_modules.search.view_sampling import VisibleCells, sample_views
from fluentboard_modules.simulation.navigation import Costmap, costmap
from fluentboard_modules.simulation.robots import (
    PR2,
    PR2_SEARCH_HEIGHT_M,
    PR2_SEARCH_TILT_RAD,
    RobotModel,
    View,
)
from fluentboard_modules.simulation.rooms import with_floor
from fluentboard_modules.simulation.scene import Scene
from fluentboard_modules.simulation.watchful_robot import WatchfulSimulatedRobot

EXPERIMENTS = ("offline", "known", "unknown")
_STEPS_MAX = 80  # of a continual search; none has needed half of them
_IMAGE_WIDTH = 160  # pixels; a cell of 5 cm at 3 m is three of them wide

OFFLINE_GRID = tuple(
    BranchAndBoundConfig(
        depth_limit=depth, branch_limit=branch, prune_dominated=prune, nodes_max=2_000
    )
    for depth in (1, 2, 3, 4)
    for branch in (1.1, 1.3, 1.6)
    for prune in (False, True)
)
CONTINUAL_GRID = tuple(
    BranchAndBoundConfig(
        depth_limit=depth, branch_limit=branch, prune_dominated=prune, nodes_max=500
    )
    for depth, branch, prune in (
        (1, 1.3, False),
        (2, 1.1, False),
        (2, 1.3, False),
        (2, 1.3, True),
        (3, 1.3, False),
    )
)


@dataclass(frozen=True, eq=False)
class World:
    """Where the experiments take place.

    Attributes:
        scene: with search volumes.
        model: of the robot.
        costmap: where it can drive.
        starts: `(n, 2)`; places it can start from, all connected.
        config: of the searches.
        probability: P_i of every volume.
        known: the full map.
        walls: the map of the walls alone.
        looks_on_the_way: whether the robot also looks while it drives (Section 5.1.5).
    """

    scene: Scene
    model: RobotModel
    costmap: Costmap
    starts: FloatArray
    config: SearchConfig
    probability: float
    known: OccupancyMap
    walls: OccupancyMap
    looks_on_the_way: bool = False

    def region(self, occupancy: OccupancyMap) -> Region:
        """The search volumes, each with the same probability."""
        volumes = [SearchVolume(v.name, v.box, self.probability) for v in self.scene.search_volumes]
        return region_of(occupancy, volumes)


@dataclass(frozen=True, slots=True)
class Result:
    """What a planner achieved in a trial.

    Attributes:
        moving_s: E[T] of moving and looking.
        planning_s: E[T] of planning.
        looks: views taken.
        gap: of the plan, at most; the mean over its plans in a continual search.
        bound_s: time it took to bound a plan from below; it is not part of planning.
        probability: prior probability that the object was in what the search saw.
        promised: cells that the views taken were expected to reveal (continual only).
        revealed: cells that they revealed (continual only).
        moments: what had been seen when: elapsed seconds, seconds of planning, and probability
            (continual only).
    """

    moving_s: float
    planning_s: float
    looks: int
    gap: float
    bound_s: float
    probability: float
    promised: int = 0
    revealed: int = 0
    moments: tuple[tuple[float, float, float], ...] = ()

    @property
    def total_s(self) -> float:
        """E[T] of the whole search."""
        return self.moving_s + self.planning_s

    def total_until_s(self, probability: float) -> float:
        """E[T] of the search up to where it has seen so much; all of it where it never has.

        Searches end when their own views promise too little, some sooner than others (E18): this
        compares them at equal termination.
        """
        if not self.moments:
            return self.total_s
        total = 0.0
        for before, after in zip(self.moments, self.moments[1:], strict=False):
            if before[2] >= probability:
                break
            total += (1.0 - before[2]) * (after[0] - before[0] + after[1] - before[1])
        return total


@dataclass(eq=False)
class Trial:
    """One random start, with what all planners share.

    Attributes:
        number: of the trial.
        start: of the robot.
        views: 200 views.
        problem: of the offline experiment; None for the others.
        sampling_s: time to draw the views.
        times_s: time for the table of transition times.
        results: per planner.
        plans: per planner the sequence of views (offline only).
        records: per planner the search (continual only).
    """

    number: int
    start: View
    views: tuple[View, ...]
    problem: PlanningProblem | None
    sampling_s: float
    times_s: float
    results: dict[str, Result] = field(default_factory=dict)
    plans: dict[str, Plan] = field(default_factory=dict)
    records: dict[str, SearchRecord] = field(default_factory=dict)


def world_of(
    scene: Scene,
    probability: float = 0.2,
    threshold: float = 0.05,
    looks_on_the_way: bool = False,
) -> World:
    """A world for a PR2 with the settings of Section 5.3.

    Raises:
        InvalidInput: the scene has no search volumes.
    """
    if not scene.search_volumes:
        raise InvalidInput("the scene has no search volumes; add search_volumes to its JSON file")
    if not scene.of_class("Floor"):
        scene = with_floor(scene, 0.0)  # or rays past a table would come back from nothing
    room = costmap(scene, PR2.radius_m)
    sampling = ViewSamplingConfig(
        camera_height_m=PR2_SEARCH_HEIGHT_M, tilt_rad=PR2_SEARCH_TILT_RAD, time_limit_s=60.0
    )
    config = SearchConfig(
        threshold=threshold, sampling=sampling, planner=PlannerConfig(time_limit_s=30.0)
    )
    return World(
        scene,
        PR2,
        room,
        _starts(room),
        config,
        probability,
        map_of_scene(scene),
        map_of_scene(scene, chosen=lambda i: i.cls in ("Building", "Wall", "Floor")),
        looks_on_the_way,
    )


def planners_for(experiment: str, whole_grid: bool = True) -> list[Planner]:
    """Greedy, the thesis's planner over a grid of its parameters, and ours.

    Args:
        experiment: one of `EXPERIMENTS`.
        whole_grid: otherwise only with the parameters of the original software.
    """
    grid = OFFLINE_GRID if experiment == "offline" else CONTINUAL_GRID
    if not whole_grid:
        grid = tuple(c for c in grid if (c.depth_limit, c.branch_limit) == (2, 1.3))
        grid = tuple(c for c in grid if not c.prune_dominated)
    ours = IteratedLocalSearch(PlannerConfig(time_limit_s=30.0))
    return [Greedy(), *(BranchAndBound(config) for config in grid), ours]


def run_trial(
    world: World, experiment: str, number: int, seed: int, planners: Sequence[Planner]
) -> Trial:
    """One trial: the same start, views and times for all planners."""
    rng = np.random.default_rng([seed, number])
    x, y = world.starts[int(rng.integers(len(world.starts)))]
    start = View(float(x), float(y), float(rng.uniform(-math.pi, math.pi)))
    occupancy = (world.walls if experiment == "unknown" else world.known).copy()
    region = world.region(occupancy)
    begun = time.thread_time()
    visible = VisibleCells(region, occupancy, world.model, world.config.sampling)
    views = sample_views(
        frontiers_of(region, occupancy),
        visible,
        world.model,
        world.costmap,
        world.costmap.path_costs(start.x, start.y),
        world.config.sampling,
        rng,
    )
    sampled = time.thread_time()
    times = transition_times_s(world.model, world.costmap, start, views.views)
    timed = time.thread_time()
    trial = Trial(number, start, views.views, None, sampled - begun, timed - sampled)
    if experiment == "offline":
        trial.problem = PlanningProblem(
            region.probability(occupancy), views.ptr, views.cells, times, world.config.threshold
        )
        trial.problem.words  # noqa: B018  # built once, before any planner is timed
    for planner in planners:
        if trial.problem is not None:
            plan_once(trial, trial.problem, planner)
        else:
            record = search_once(world, experiment, trial, seed, planner)
            trial.records[planner.name] = record
            moving = record.expected_time_s(with_planning=False)
            trial.results[planner.name] = Result(
                moving,
                record.expected_time_s() - moving,
                len(record.steps),
                float(np.mean([s.gap for s in record.steps])) if record.steps else 0.0,
                0.0,
                record.probability,
                sum(s.expected_cells for s in record.steps),
                sum(s.revealed_cells for s in record.steps),
                tuple((m.elapsed_s, m.planning_s, m.probability) for m in record.moments),
            )
    return trial


def plan_once(trial: Trial, problem: PlanningProblem, planner: Planner) -> None:
    """Plans an offline trial and bounds the plan, each on the clock."""
    begun = time.thread_time()
    found = planner.find(problem)
    planned = time.thread_time()
    plan = bounded(problem, found)
    trial.plans[planner.name] = plan
    trial.results[planner.name] = Result(
        plan.expected_time_s,
        planned - begun,
        len(plan.views),
        plan.gap,
        time.thread_time() - planned,
        plan.success_probability,
    )


def search_once(
    world: World, experiment: str, trial: Trial, seed: int, planner: Planner
) -> SearchRecord:
    """Carries a continual search out in the simulator, to its end."""
    occupancy = (world.walls if experiment == "unknown" else world.known).copy()
    robot = WatchfulSimulatedRobot(
        world.model,
        world.scene,
        trial.start,
        np.random.default_rng([seed, trial.number, 1]),
        image_width=_IMAGE_WIDTH,
    )
    if not world.looks_on_the_way:
        robot.between_frames_m = math.inf
    search = ObjectSearch(
        robot,
        occupancy,
        world.region(occupancy),
        world.costmap,
        world.config,
        np.random.default_rng([seed, trial.number, 2]),
        planner,
        trial.views,
        occlusion_is_known=experiment == "known",
    )
    for _ in range(_STEPS_MAX):
        if search.step() is None:
            break
    return search.record


def _starts(room: Costmap) -> FloatArray:
    """`(n, 2)`; the free places of the largest connected part of a costmap."""
    from scipy.ndimage import label

    parts, count = label(room.cost < 253, np.ones((3, 3)))
    if not count:
        raise InvalidInput("the robot can stand nowhere in this scene; use a smaller robot")
    largest = int(np.bincount(parts.ravel())[1:].argmax()) + 1
    rows, columns = np.nonzero(parts == largest)
    return np.array([room.position(int(r), int(c)) for r, c in zip(rows, columns, strict=True)])
