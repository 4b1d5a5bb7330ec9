"""Camera trajectories: around a point, and through a room past everything worth seeing."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from fluentboard.errors import InvalidInput, UnreachableView
from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.simulation.navigation import Costmap
from fluentboard_modules.simulation.raycasting import SceneCaster
from fluentboard_modules.simulation.scene import Instance, Scene
from fluentboard_modules.simulation.viewpoint import look_at, optical_pose

logger = logging.getLogger(__name__)

SEEN_FROM_ALL_SIDES = frozenset({"Table"})
SEEN_FROM_THE_FRONT = frozenset({"Shelf", "Counter", "Cabinet", "Desk"})
WITH_A_TOP = frozenset({"Table", "Counter", "Desk"})
SEEN = SEEN_FROM_ALL_SIDES | SEEN_FROM_THE_FRONT | {"Chair"}

_LEVEL = -0.05
_STEEPEST = 0.95
_GRAZING_RAD = 0.4
_FITS_RAD = 0.75  # of the 0.86 rad that a Kinect sees vertically


@dataclass(frozen=True, slots=True)
class Stop:
    """A place where the camera dwells.

    Attributes:
        x: metres, map frame.
        y: metres.
        yaw_rad: heading of the camera.
        tilt_rad: below the horizon.
        target: name of the thing it looks at.
    """

    x: float
    y: float
    yaw_rad: float
    tilt_rad: float
    target: str = ""


def around(
    target: ArrayLike,
    radius_m: float,
    height_m: float,
    frames: int,
    start_rad: float = 0.0,
    sweep_rad: float = 2.0 * math.pi,
) -> tuple[Transform, ...]:
    """`T_map_sensor` of so many looks at a point from a circle around it.

    Args:
        target: `(3,)`; what to look at, map frame.
        radius_m: horizontal distance from it.
        height_m: of the camera above the floor.
        frames: how many looks, evenly spaced; a full circle does not repeat the first.
        start_rad: direction of the first look's position as seen from the target.
        sweep_rad: angle of the arc; negative runs clockwise.
    """
    centre = np.asarray(target, dtype=np.float64)
    full = math.isclose(abs(sweep_rad), 2.0 * math.pi)
    angles = start_rad + np.linspace(0.0, sweep_rad, frames, endpoint=not full)
    return tuple(
        look_at(
            (centre[0] + radius_m * math.cos(a), centre[1] + radius_m * math.sin(a), height_m),
            centre,
        )
        for a in angles
    )


def stops_in_room(
    scene: Scene,
    costmap: Costmap,
    height_m: float,
    distance_m: tuple[float, float] = (1.1, 2.3),
    classes: frozenset[str] = SEEN,
) -> tuple[Stop, ...]:
    """Places from which every table, chair and shelf of a room is seen well.

    A table is looked at from four sides, a chair from two, and what stands at a wall from in front,
    from two directions. Of all free places near a side the one wins that sees most of the thing and
    is nearest to a comfortable distance.

    Args:
        scene: the room.
        costmap: where the base may stand.
        height_m: of the camera.
        distance_m: nearest and farthest distance to the middle of a thing.
        classes: what is worth a look.
    """
    caster = SceneCaster(scene)
    reachable = _largest_free_area(costmap)
    found: list[Stop] = []
    for instance in scene.objects:
        if instance.cls not in classes:
            continue
        before = len(found)
        for side in _sides(instance):
            stop = _best_stop(instance, side, costmap, reachable, caster, height_m, distance_m)
            if stop is not None:
                found.append(stop)
        if len(found) == before:
            logger.warning("nowhere to stand for a look at %s (%s)", instance.name, instance.cls)
    return tuple(found)


def fewer_stops(stops: Sequence[Stop], most: int) -> tuple[Stop, ...]:
    """At most so many of the stops: first one for every thing, then a second one, and so on.

    The order of the stops stays. Stops of things beyond the limit are left out, and logged.
    """
    if len(stops) <= most:
        return tuple(stops)
    seen: dict[str, int] = {}
    turns: list[tuple[int, int]] = []
    for number, stop in enumerate(stops):
        seen[stop.target] = seen.get(stop.target, -1) + 1
        turns.append((seen[stop.target], number))
    kept = sorted(number for _, number in sorted(turns)[:most])
    missed = seen.keys() - {stops[number].target for number in kept}
    if missed:
        logger.warning("too few frames for a look at %s", ", ".join(sorted(missed)))
    return tuple(stops[number] for number in kept)


def _sides(instance: Instance) -> tuple[float, ...]:
    """Directions in the map from which to look at a thing, as seen from it."""
    front = instance.pose.yaw_rad
    if instance.cls in SEEN_FROM_ALL_SIDES:
        return tuple(front + k * 0.5 * math.pi + 0.25 * math.pi for k in range(4))
    if instance.cls in SEEN_FROM_THE_FRONT:
        return (front - 0.45, front + 0.45)
    return (front + 0.6, front + math.pi - 0.6)  # a chair: seat and back, past the table


def _largest_free_area(costmap: Costmap) -> FloatArray:
    """`(rows, columns)`; path costs within the largest area that hangs together, else infinite."""
    from scipy.ndimage import label

    areas, count = label(costmap.cost == 0)
    if count == 0:
        raise UnreachableView("there is no free floor in this room; the robot is too large for it")
    largest = 1 + int(np.argmax(np.bincount(areas.ravel())[1:]))
    row, column = np.argwhere(areas == largest)[0]
    return costmap.path_costs(*costmap.position(int(row), int(column)))


def _best_stop(
    instance: Instance,
    side_rad: float,
    costmap: Costmap,
    reachable: FloatArray,
    caster: SceneCaster,
    height_m: float,
    distance_m: tuple[float, float],
) -> Stop | None:
    box = instance.box
    centre = np.array([box.pose.x, box.pose.y, box.pose.z])
    reach = 0.5 * min(box.x_size, box.y_size)
    comfortable = 0.45 * distance_m[0] + 0.55 * distance_m[1]
    best: tuple[float, Stop] | None = None
    for angle in side_rad + np.linspace(-0.6, 0.6, 7):
        for distance in np.linspace(*distance_m, 7):
            x = float(centre[0] + distance * math.cos(angle))
            y = float(centre[1] + distance * math.sin(angle))
            cell = costmap.cell(x, y)
            if cell is None or not np.isfinite(reachable[cell]):
                continue
            eye = np.array([x, y, height_m])
            # The line of sight halves the angle between the thing's nearest lower and upper edge.
            near = max(float(distance) - reach, 0.3)
            lowest = math.atan2(height_m - float(instance.bounds_map[0, 2]), near)
            highest = math.atan2(height_m - float(instance.bounds_map[1, 2]), near)
            score = (
                _visible_share(instance, eye, caster)
                - 0.25 * abs(angle - side_rad)
                - 0.25 * abs(distance - comfortable)
                - 2.0 * max(lowest - highest - _FITS_RAD, 0.0)
                - 2.0 * _grazing_rad(instance, height_m, float(distance))
            )
            if best is None or score > best[0]:
                tilt = min(max(0.5 * (lowest + highest), _LEVEL), _STEEPEST)
                yaw = math.atan2(float(centre[1]) - y, float(centre[0]) - x)
                best = score, Stop(x, y, yaw, tilt, instance.name)
    return None if best is None else best[1]


def _grazing_rad(instance: Instance, height_m: float, distance_m: float) -> float:
    """By how much a top is seen too flatly: the sensor loses grazing surfaces (Nguyen 2012)."""
    if instance.cls not in WITH_A_TOP:
        return 0.0
    above = height_m - float(instance.bounds_map[1, 2])
    return max(_GRAZING_RAD - math.atan2(above, distance_m), 0.0)


def _visible_share(instance: Instance, eye: FloatArray, caster: SceneCaster) -> float:
    """Share of the corners of its box, pulled in by a fifth, that nothing else hides."""
    middle = np.array([instance.box.pose.x, instance.box.pose.y, instance.box.pose.z])
    points = np.vstack([middle + 0.8 * (instance.box.corners() - middle), middle])
    rays = np.zeros((len(points), 6), dtype=np.float32)
    rays[:, :3], rays[:, 3:] = eye, points - eye
    hits = caster.cast(rays)
    # Hitting the thing itself on the way is seeing it.
    own = np.append(caster.triangle_label, -1)[hits.triangle] == instance.label
    return float((own | (hits.distance > 1.0)).mean())


def tour(
    stops: Sequence[Stop], costmap: Costmap, height_m: float, frames: int
) -> tuple[Transform, ...]:
    """`T_map_sensor` along a short round of all stops: one frame at each, the rest on the way.

    The camera travels on free floor and turns smoothly from one stop's heading to the next.

    Args:
        stops: places to visit.
        costmap: where the base may go.
        height_m: of the camera.
        frames: how many frames in all, at least one per stop.

    Raises:
        InvalidInput: there are no stops, or more stops than frames.
        UnreachableView: no way joins two stops.
    """
    if not 0 < len(stops) <= frames:
        raise InvalidInput(
            f"a tour of {len(stops)} stops in {frames} frames is not possible; "
            "give at least one stop and as many frames as stops"
        )
    order = _short_round(stops, costmap)
    ways = [_smoothed(costmap.path((a.x, a.y), (b.x, b.y)).points) for a, b in pairwise(order)]
    # A turn of one radian gets as many frames as 0.8 m of way.
    effort = [
        0.2 + np.linalg.norm(np.diff(way, axis=0), axis=1).sum() + 0.8 * abs(_turn(a, b))
        for way, (a, b) in zip(ways, pairwise(order), strict=True)
    ]
    between = _shared_out(frames - len(order), np.array(effort))
    poses: list[Transform] = []
    for k, stop in enumerate(order):
        poses.append(optical_pose(stop.x, stop.y, height_m, stop.yaw_rad, stop.tilt_rad))
        if k + 1 < len(order):
            poses += _on_the_way(stop, order[k + 1], ways[k], int(between[k]), height_m)
    return tuple(poses)


def _turn(start: Stop, goal: Stop) -> float:
    return math.remainder(goal.yaw_rad - start.yaw_rad, 2.0 * math.pi)


def _shared_out(count: int, weights: FloatArray) -> FloatArray:
    """So many things in shares proportional to the weights (largest remainder)."""
    if len(weights) == 0:
        return np.zeros(0)
    exact = count * weights / weights.sum()
    shares = np.floor(exact)
    most_wanting = np.argsort(shares - exact, kind="stable")[: int(count - shares.sum())]
    shares[most_wanting] += 1
    return shares


def _on_the_way(
    start: Stop, goal: Stop, way: FloatArray, count: int, height_m: float
) -> list[Transform]:
    step = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    turn = _turn(start, goal)
    poses: list[Transform] = []
    for share in (np.arange(count) + 1.0) / (count + 1.0):
        x, y = (float(np.interp(share * step[-1], step, way[:, k])) for k in range(2))
        ease = share * share * (3.0 - 2.0 * share)
        yaw = start.yaw_rad + ease * turn
        tilt = start.tilt_rad + ease * (goal.tilt_rad - start.tilt_rad)
        poses.append(optical_pose(x, y, height_m, yaw, tilt))
    return poses


def _smoothed(points: FloatArray, window: int = 9) -> FloatArray:
    """The way with the corners of the grid averaged away; its ends stay."""
    if len(points) < 3:
        return points
    padded = np.concatenate(
        [
            np.repeat(points[:1], window // 2, axis=0),
            points,
            np.repeat(points[-1:], window // 2, axis=0),
        ]
    )
    kernel = np.ones(window) / window
    middle = np.stack([np.convolve(padded[:, k], kernel, mode="valid") for k in range(2)], axis=1)
    return np.concatenate([points[:1], middle[1:-1], points[-1:]])


def _short_round(stops: Sequence[Stop], costmap: Costmap) -> list[Stop]:
    """The stops in a short order, from the first on (nearest neighbour, then 2-opt)."""
    costs = np.zeros((len(stops), len(stops)))
    for k, stop in enumerate(stops):
        field = costmap.path_costs(stop.x, stop.y)
        for m, other in enumerate(stops):
            cell = costmap.cell(other.x, other.y)
            # A turn costs like driving: half a metre per radian.
            way = field[cell] if cell is not None else math.inf
            costs[k, m] = way + 500.0 * abs(_turn(stop, other))
    order = [0]
    while len(order) < len(stops):
        left = [k for k in range(len(stops)) if k not in order]
        order.append(min(left, key=lambda k: costs[order[-1], k]))
    improved = True
    while improved:
        improved = False
        for i in range(1, len(order) - 1):
            for j in range(i + 1, len(order)):
                trial = order[:i] + order[i : j + 1][::-1] + order[j + 1 :]
                if _length(trial, costs) < _length(order, costs) - 1e-9:
                    order, improved = trial, True
    return [stops[k] for k in order]


def _length(order: Sequence[int], costs: FloatArray) -> float:
    return float(sum(costs[a, b] for a, b in pairwise(order)))
