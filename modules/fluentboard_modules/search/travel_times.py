"""Transition times between views: driving, lifting, turning the head, and the look itself.

The motion model is that of the robot (`RobotModel.transition_time_s`); this file evaluates it for
all pairs at once.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.search import route_kernels as kernels
from fluentboard_modules.simulation.navigation import INSCRIBED, Costmap, cell_prices
from fluentboard_modules.simulation.robots import DRIVES_FROM_M, RobotModel, View

_LEAST_PRICE = 50.0  # navfn's cost of a free cell


def transition_times_s(
    model: RobotModel,
    costmap: Costmap,
    start: View,
    views: Sequence[View],
    clusters: int | None = None,
) -> FloatArray:
    """`(v + 1, v + 1)`; seconds from each view (row) to each other (column), 0 for the start.

    The time of a view includes the look there. Infinite where no way leads, or where the base
    cannot stand at the goal. Times between two views are symmetric, as the ways are.

    Args:
        model: of the robot.
        costmap: where its base can drive.
        start: where it is.
        views: where it may look.
        clusters: plan ways between so many representatives only, and take those for all views near
            them (Section 5.2.2); for maps much larger than some rooms. All views if not given.
    """
    everything = [start, *views]
    places = np.array([[v.x, v.y] for v in everything])
    costs = _path_costs(costmap, places, clusters)
    yaw = np.array([v.yaw_rad for v in everything])
    torso = np.array([v.torso_m for v in everything])
    pan = np.array([v.pan_rad for v in everything])
    tilt = np.array([v.tilt_rad for v in everything])
    far = np.linalg.norm(places[:, None] - places[None], axis=-1) > DRIVES_FROM_M
    turn = np.abs(_apart(yaw))
    turn = np.minimum(turn % (2.0 * np.pi), 2.0 * np.pi - turn % (2.0 * np.pi))
    moving = np.where(
        far, model.seconds_per_cost * costs + model.drive_start_s, turn / model.turn_rad_s
    )
    seconds = moving + np.abs(_apart(torso)) / model.lift_m_s
    head = np.maximum(np.abs(_apart(pan)), np.abs(_apart(tilt))) / model.head_rad_s
    seconds = np.where(seconds == 0.0, head, seconds) + model.acquisition_s
    # Two views at one place: no way is needed, but the place must be one to stand at.
    return np.where(np.isfinite(costs), seconds, np.inf)


def _apart(values: FloatArray) -> FloatArray:
    return values[None, :] - values[:, None]


def _path_costs(costmap: Costmap, places: FloatArray, clusters: int | None) -> FloatArray:
    """`(n, n)`; costs of the cheapest ways between places, infinite where there is none."""
    rows, columns = costmap.cost.shape
    row = np.floor((places[:, 1] - costmap.origin[1]) / costmap.resolution_m).astype(np.int64)
    column = np.floor((places[:, 0] - costmap.origin[0]) / costmap.resolution_m).astype(np.int64)
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    row, column = np.where(inside, row, 0), np.where(inside, column, 0)
    free = inside & (costmap.cost[row, column] < INSCRIBED)
    price = np.full((rows + 2, columns + 2), np.inf)
    price[1:-1, 1:-1] = cell_prices(costmap)
    cell = (row + 1) * (columns + 2) + column + 1
    group = np.arange(len(places)) if clusters is None else _clustered(places, free, clusters)
    chosen, number = np.unique(cell[group[free]], return_inverse=True)
    table = np.full((len(chosen), len(chosen)), np.inf)
    longest = 2.0**0.5 * float(price[np.isfinite(price)].max(initial=_LEAST_PRICE))
    buckets = int(longest / _LEAST_PRICE) + 3
    kernels.path_cost_table(
        price.ravel(), columns + 2, chosen, _LEAST_PRICE, buckets, price.size, table
    )
    costs = np.full((len(places), len(places)), np.inf)
    standing = np.flatnonzero(free)
    costs[np.ix_(standing, standing)] = table[np.ix_(number, number)]
    return costs


def _clustered(places: FloatArray, free: NDArray[np.bool_], clusters: int) -> NDArray[np.int64]:
    """`(n,)`; the representative of each place, chosen farthest from those before."""
    standing = np.flatnonzero(free)
    nearest = np.arange(len(places))
    if len(standing) <= clusters:
        return nearest
    chosen = [int(standing[0])]
    distance = np.linalg.norm(places[standing] - places[chosen[0]], axis=1)
    owner = np.full(len(standing), chosen[0])
    while len(chosen) < clusters:
        farthest = int(standing[int(distance.argmax())])
        chosen.append(farthest)
        to_new = np.linalg.norm(places[standing] - places[farthest], axis=1)
        owner = np.where(to_new < distance, farthest, owner)
        distance = np.minimum(distance, to_new)
    nearest[standing] = owner
    return nearest
