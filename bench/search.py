"""The search's occupancy map against OctoMap: clouds integrated and rays cast."""

from __future__ import annotations

import time

import numpy as np
import pyoctomap

from bench.measuring import Report, compare
from fluentboard_modules.search.occupancy import OccupancyMap
from fluentboard_modules.simulation.drive import restaurant_demo_drive

RESOLUTION_M = 0.05
FRAMES = 8
RAYS = 20_000
RANGE_M = 4.0


def run() -> list[Report]:
    """Both measurements, on frames of the simulated restaurant."""
    drive = restaurant_demo_drive(0, 80)
    frames = [drive.read(position) for position in range(0, 80, 80 // FRAMES)]
    clouds = [frame.points_map().reshape(-1, 3) for frame in frames]
    finite = [cloud[np.isfinite(cloud).all(axis=1)] for cloud in clouds]
    origins = [np.array(frame.T_map_sensor.translation) for frame in frames]

    def ours() -> float:
        occupancy = OccupancyMap(RESOLUTION_M)
        begin = time.thread_time()
        for cloud, origin in zip(clouds, origins, strict=True):
            occupancy.integrate(cloud, origin)
        return time.thread_time() - begin

    def octomap(discretize: bool) -> float:
        tree = pyoctomap.OcTree(RESOLUTION_M)
        begin = time.thread_time()
        for cloud, origin in zip(finite, origins, strict=True):
            tree.insertPointCloud(cloud, origin, -1.0, True, discretize)
            tree.updateInnerOccupancy()
        return time.thread_time() - begin

    def octomap_eager() -> float:
        tree = pyoctomap.OcTree(RESOLUTION_M)
        begin = time.thread_time()
        for cloud, origin in zip(finite, origins, strict=True):
            tree.insertPointCloud(cloud, origin, -1.0, False, False)
        return time.thread_time() - begin

    ours()  # compiles
    occupancy = OccupancyMap(RESOLUTION_M)
    tree = pyoctomap.OcTree(RESOLUTION_M)
    for cloud, points, origin in zip(clouds, finite, origins, strict=True):
        occupancy.integrate(cloud, origin)
        tree.insertPointCloud(points, origin, -1.0, False, True)
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, frames[0].camera.rays().reshape(-1, 3).shape[0], RAYS)
    rays = frames[0].T_map_sensor.rotate(frames[0].camera.rays().reshape(-1, 3)[pixels])
    start = origins[0]

    def cast_ours() -> float:
        changed = occupancy.copy()  # so that what rays stop at is found anew, as after a look
        begin = time.thread_time()
        changed.cast_rays(start, rays, RANGE_M)
        return time.thread_time() - begin

    def cast_octomap() -> float:
        end = np.zeros(3)
        some = rays[:: RAYS // 2_000]
        begin = time.thread_time()
        for ray in some:
            tree.castRay(start, ray, end, True, RANGE_M)
        return (time.thread_time() - begin) * RAYS / len(some)

    cast_ours()
    return [
        compare(
            "Integrate a 640x480 cloud into an occupancy map of 5 cm",
            {
                "fluentboard": ours,
                "OctoMap, as it comes (every ray, inner nodes at once)": octomap_eager,
                "OctoMap, every ray, inner nodes at the end": lambda: octomap(False),
                "OctoMap, discretised, inner nodes at the end": lambda: octomap(True),
            },
            rounds=5,
            operations=FRAMES,
            target="at least 20 times OctoMap",
            notes=[
                "Eight noisy frames of the simulated restaurant; CPU time of one thread, from an "
                "empty map. Cells and log-odds equal those of OctoMap with discretisation, which "
                "is the fair comparison (the last line); the defaults of OctoMap cast a ray for "
                "every point. Its inner nodes are updated after every cloud: the map can be read."
            ],
        ),
        compare(
            "Cast a ray of a camera into an occupancy map of 5 cm",
            {"fluentboard, 20,000 at once": cast_ours, "OctoMap castRay": cast_octomap},
            rounds=5,
            operations=RAYS,
            unit="us",
            target="at least 15 times castRay",
            notes=[
                "Up to 4 m; a call per ray for OctoMap, as its Python package offers. Ours has in "
                "it what is done once after every change of the map: a bit for each cell at which "
                "rays stop."
            ],
        ),
    ]
