"""What a search computes before it plans: 200 views, and the times between them."""

from __future__ import annotations

import os
import statistics
import time
from pathlib import Path

import numpy as np

from bench.measuring import Report
from fluentboard_modules.search.evaluation import World, world_of
from fluentboard_modules.search.frontiers import frontiers_of
from fluentboard_modules.search.travel_times import transition_times_s
from fluentboard_modules.search.view_sampling import VisibleCells, sample_views
from fluentboard_modules.simulation.robots import View
from fluentboard_modules.simulation.scene_json import load_scene
from fluentboard_modules.simulation.search_scenes import hidden_pepper_mill

ROUNDS = 8
_THESIS_S = {"views": 2.4, "times": 6.4}  # Section 5.3, 200 views; times from 50 clusters


def run() -> list[Report]:
    """Both times, in the thesis's world if its data are there, and in our own room."""
    places = {"one simulated room": hidden_pepper_mill(0).scene}
    folder = os.environ.get("FLUENTBOARD_SHARED_DATA", "")
    original = Path(folder) / "race_world" / "scene.json"
    if folder and original.is_file():
        places = {"race_world, as in Section 5.3": load_scene(original), **places}
    measured = {name: _measured(world_of(scene)) for name, scene in places.items()}
    lines = [
        "| where | what | median, s | thesis, s | fluentboard is faster by |",
        "| --- | --- | --- | --- | --- |",
    ]
    for place, seconds in measured.items():
        for what, spent in seconds.items():
            thesis = _THESIS_S[what]
            name = "200 views" if what == "views" else "transition times of 201 views"
            lines.append(f"| {place} | {name} | {spent:.3f} | {thesis} | {thesis / spent:.0f} x |")
    return [
        Report(
            "Sample 200 views and the transition times between them",
            "s",
            {f"{place}: {what}": s for place, each in measured.items() for what, s in each.items()},
            {},
            "views in at most 0.4 s (6 times the thesis), times in at most 0.2 s (40 times)",
            [
                f"CPU time of one thread, median of {ROUNDS} random starts; cells of 5 cm, 80 x 60 "
                "rays a view. Views include the frontiers, the ways from the start, and views that "
                "reveal nothing; times are exact, for all pairs. The thesis's are those of its own "
                "machine, an i7-870, its times of 50 clusters."
            ],
            lines,
        )
    ]


def _measured(world: World) -> dict[str, float]:
    views_s: list[float] = []
    times_s: list[float] = []
    for number in range(ROUNDS + 1):  # the first compiles
        rng = np.random.default_rng(number)
        x, y = map(float, world.starts[int(rng.integers(len(world.starts)))])
        occupancy = world.known.copy()
        region = world.region(occupancy)
        begun = time.thread_time()
        views = sample_views(
            frontiers_of(region, occupancy),
            VisibleCells(region, occupancy, world.model, world.config.sampling),
            world.model,
            world.costmap,
            world.costmap.path_costs(x, y),
            world.config.sampling,
            rng,
        ).views
        sampled = time.thread_time()
        transition_times_s(world.model, world.costmap, View(x, y, 0.0), views)
        views_s.append(sampled - begun)
        times_s.append(time.thread_time() - sampled)
    return {"views": statistics.median(views_s[1:]), "times": statistics.median(times_s[1:])}
