"""The three experiments of Section 5.3, and what is measured in them.

Offline: one plan with a full map. Known: plan, move, look and plan again with a full map. Unknown:
the same when only the walls are known. All planners of a trial get the same start, the same views
and the same transition times.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

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
    BranchAndBoundConfig(depth_limit=depth, branch_limit=branch, nodes_max=500)
    for depth, branch in ((1, 1.3), (2, 1.1), (2, 1.3))
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
    looks_on_the_way: bool = True

    def region(self, occupancy: OccupancyMap) -> Region:
        """The search volumes, each with the same probability."""
        volumes = [SearchVolume(v.name, v.box, self.probability) for v in self.scene.search_volumes]
        return region_of(occupancy, volumes)


@dataclass(eq=False)
class Trial:
    """One random start, with what all planners share.

    Attributes:
        number: of the trial.
        start: of the robot.
        views: 200 views.
        problem: of the offline experiment; empty for the others.
        sampling_s: time to draw the views.
        times_s: time for the table of transition times.
        expected_s: per planner, E[T] in seconds: of moving and looking, and of planning.
        plans: per planner the sequence of views (offline only).
    """

    number: int
    start: View
    views: tuple[View, ...]
    problem: PlanningProblem | None
    sampling_s: float
    times_s: float
    expected_s: dict[str, tuple[float, float]] = field(default_factory=dict)
    plans: dict[str, Plan] = field(default_factory=dict)
    records: dict[str, SearchRecord] = field(default_factory=dict)


def world_of(
    scene: Scene,
    probability: float = 0.2,
    threshold: float = 0.05,
    looks_on_the_way: bool = True,
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


def planners_for(experiment: str) -> list[Planner]:
    """Greedy, the thesis's planner over a grid of its parameters, and ours."""
    grid = OFFLINE_GRID if experiment == "offline" else CONTINUAL_GRID
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
            begun = time.thread_time()
            plan = planner.find(trial.problem)
            spent = time.thread_time() - begun
            trial.plans[planner.name] = bounded(trial.problem, plan)
            trial.expected_s[planner.name] = (plan.expected_time_s, spent)
        else:
            record = search_once(world, experiment, trial, seed, planner)
            total = record.expected_time_s()
            moving = record.expected_time_s(with_planning=False)
            trial.expected_s[planner.name] = (moving, total - moving)
            trial.records[planner.name] = record
    return trial


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


@dataclass(frozen=True, slots=True)
class Summary:
    """A planner's result over all trials.

    Attributes:
        planner: its name.
        moving_s: mean E[T] of moving and looking.
        total_s: mean E[T] with planning.
        interval_s: half of the 95 % confidence interval of `total_s`.
        against_greedy: mean of the ratio to greedy's total in the same trial, minus 1.
        against_interval: half of its 95 % confidence interval.
    """

    planner: str
    moving_s: float
    total_s: float
    interval_s: float
    against_greedy: float
    against_interval: float


def summarise(trials: Sequence[Trial], planners: Sequence[str]) -> list[Summary]:
    """The mean results of planners, greedy's own included."""
    greedy = np.array([sum(t.expected_s["greedy"]) for t in trials])
    rows: list[Summary] = []
    for name in planners:
        moving = np.array([t.expected_s[name][0] for t in trials])
        total = np.array([sum(t.expected_s[name]) for t in trials])
        ratio = total / np.maximum(greedy, 1e-9) - 1.0
        rows.append(
            Summary(
                name,
                float(moving.mean()),
                float(total.mean()),
                half_interval(total),
                float(ratio.mean()),
                half_interval(ratio),
            )
        )
    return rows


def half_interval(values: FloatArray) -> float:
    """Half of the 95 % confidence interval of a mean (Student's t); infinite for one value."""
    from scipy.stats import t as student

    if len(values) < 2:
        return math.inf
    quantile = float(student.ppf(0.975, len(values) - 1))
    return quantile * float(values.std(ddof=1)) / math.sqrt(len(values))


def export_trial(trial: Trial, folder: Path) -> None:
    """Writes an offline trial, so that any other planner can be run on identical inputs.

    `instance-NN.npz` holds `cell_p` f8[N], `view_ptr` i8[V + 1] and `view_cells` i8[nnz] (the cells
    that each view reveals), `T` f8[V + 1, V + 1] in seconds (0 is the start, infinite is
    unreachable) and `omega` f8; `plans-NN.json` each planner's sequence and E[T].
    """
    problem = trial.problem
    if problem is None:
        return
    folder.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(
        folder / f"instance-{trial.number:02d}.npz",
        cell_p=problem.cell_p.astype(np.float64),
        view_ptr=problem.view_ptr.astype(np.int64),
        view_cells=problem.view_cells.astype(np.int64),
        T=problem.times_s.astype(np.float64),
        omega=np.float64(problem.omega),
    )
    plans: dict[str, Any] = {
        name: {
            "views": list(plan.views),
            "expected_time_s": plan.expected_time_s,
            "planning_s": trial.expected_s[name][1],
            "success_probability": plan.success_probability,
            "lower_bound_s": plan.lower_bound_s,
        }
        for name, plan in trial.plans.items()
    }
    path = folder / f"plans-{trial.number:02d}.json"
    path.write_text(json.dumps(plans, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def run_experiment(
    world: World,
    experiment: str,
    trials: int,
    seed: int,
    planners: Sequence[Planner],
    told: Callable[[Trial], object] = lambda trial: None,
) -> list[Trial]:
    """All trials of an experiment; `told` hears of each as it is done."""
    done: list[Trial] = []
    for number in range(trials):
        done.append(run_trial(world, experiment, number, seed, planners))
        told(done[-1])
    return done


def _starts(room: Costmap) -> FloatArray:
    """`(n, 2)`; the free places of the largest connected part of a costmap."""
    from scipy.ndimage import label

    parts, count = label(room.cost < 253, np.ones((3, 3)))
    if not count:
        raise InvalidInput("the robot can stand nowhere in this scene; use a smaller robot")
    largest = int(np.bincount(parts.ravel())[1:].argmax()) + 1
    rows, columns = np.nonzero(parts == largest)
    return np.array([room.position(int(r), int(c)) for r, c in zip(rows, columns, strict=True)])
