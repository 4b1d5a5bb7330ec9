"""The map frame of a recording: z up by gravity, z = 0 on the floor.

The map frame is the recording's world frame, turned by the smallest rotation that puts gravity on
-z and shifted vertically to the floor. When a recording does not know gravity, the z axis of its
world frame is taken to point up, as in most robots' recordings and in the TUM RGB-D benchmark; a
recording with another axis up must come with a gravity vector.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fluentboard.errors import InvalidGeometry
from fluentboard.model.geometry import FloatArray, Transform


@dataclass(frozen=True, slots=True)
class FloorCandidates:
    """The level, upward-facing surfaces one frame shows.

    Attributes:
        centres: `(n, 3)`; their centroids in the upright frame (z up, any origin), metres.
        areas_m2: `(n,)`; visible areas.
        lowest_m: height of the lowest point of any surface in the frame, infinite if there is none.
    """

    centres: FloatArray
    areas_m2: FloatArray
    lowest_m: float = math.inf


@dataclass(frozen=True, slots=True)
class FloorHeight:
    """Where the floor is.

    Attributes:
        height_m: along the upward axis, from the candidates' origin, at the anchor.
        anchor: x and y where the height holds: the middle of what stands above the floor.
        slope_x: rise of the floor per metre along x; not zero if gravity is off or the map is bent.
        slope_y: rise of the floor per metre along y.
        residual_m: median distance of the supporting surfaces from the sloping floor.
        n_frames: frames that support it; 0 if no level surface is low enough to be the floor, and
            the height is that of the lowest points of other surfaces.
    """

    height_m: float
    slope_x: float = 0.0
    slope_y: float = 0.0
    residual_m: float = 0.0
    n_frames: int = 0
    anchor: tuple[float, float] = (0.0, 0.0)


def align_with_gravity(gravity_world: FloatArray | None) -> Transform:
    """The smallest rotation that turns gravity to -z, as `T_upright_world`.

    Args:
        gravity_world: `(3,)`; the direction things fall, any length; None for a world with z up.

    Raises:
        InvalidGeometry: the vector is zero or not finite.
    """
    if gravity_world is None:
        return Transform.identity()
    length = float(np.linalg.norm(gravity_world))
    if not (np.isfinite(length) and length > 1e-9):
        raise InvalidGeometry(
            f"gravity {gravity_world} is no direction; give the falling direction"
        )
    down = gravity_world / length
    goal = np.array([0.0, 0.0, -1.0])
    axis, cosine = np.cross(down, goal), float(down @ goal)
    if cosine < -1.0 + 1e-12:  # upside down: every half turn about a level axis is the smallest
        return Transform.from_parts(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
    x, y, z = axis
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation = np.eye(3) + skew + skew @ skew / (1.0 + cosine)  # Rodrigues without the sine
    return Transform.from_parts(rotation, np.zeros(3))


def place_in_map(gravity_world: FloatArray | None, floor_height_m: float) -> Transform:
    """`T_map_world`: upright, with the floor at z = 0.

    Args:
        gravity_world: as in `align_with_gravity`.
        floor_height_m: height of the floor in the upright frame.
    """
    lowered = Transform.from_parts(np.eye(3), np.array([0.0, 0.0, -floor_height_m]))
    return lowered @ align_with_gravity(gravity_world)


def find_floor(
    frames: list[FloorCandidates],
    *,
    resolution_m: float = 0.02,
    thickness_m: float = 0.07,
    least_share: float = 0.2,
    largest_area_m2: float = 1.0,
    likely_slope: float = 0.03,
    depth_below_m: float = 0.2,
) -> FloorHeight | None:
    """The lowest level surface that is seen often enough.

    A single frame may miss the floor or show a speck of something below it (a reflection, a wrong
    depth), so heights are pooled: the floor is the lowest peak of their area-weighted distribution
    with at least `least_share` of the mass of the highest peak. A surface with walls or table legs
    reaching further down than it is not the floor, however often it is seen.

    Gravity is rarely known better than to a degree or two, which is 3 cm per metre. So a slope is
    fitted, and the height is that of the floor beneath the level surfaces that stand above it:
    heights above the floor are wanted there.

    Args:
        frames: candidates of each frame, all in the same upright frame.
        resolution_m: spacing of the distribution.
        thickness_m: how far from the floor its parts may be, to either side: poses drift.
        least_share: of the mass of the strongest level surface.
        largest_area_m2: what a surface counts at most, so that one open floor cannot outvote all.
        likely_slope: standard deviation of the slope before anything is seen.
        depth_below_m: how far below the floor nothing may be seen.

    Returns:
        The floor, or None if no frame shows any surface.
    """
    lowest = np.array([frame.lowest_m for frame in frames if np.isfinite(frame.lowest_m)])
    # Not the minimum: one wrong pose must not sink the floor.
    bottom_m = float(np.quantile(lowest, 0.2)) if lowest.size else math.inf
    centres = np.concatenate([np.zeros((0, 3)), *(frame.centres for frame in frames)])
    if len(centres) == 0 or centres[:, 2].min() > bottom_m + depth_below_m:
        return FloorHeight(bottom_m) if lowest.size else None
    areas = np.concatenate([np.zeros(0), *(frame.areas_m2 for frame in frames)])
    weights = np.minimum(areas, largest_area_m2)
    frame_of = np.repeat(np.arange(len(frames)), [len(frame.centres) for frame in frames])
    heights = centres[:, 2]

    reach = max(1, round(thickness_m / resolution_m))
    bins = np.floor((heights - heights.min()) / resolution_m).astype(int)
    mass = np.convolve(np.bincount(bins, weights), np.ones(2 * reach + 1))  # shifted by reach
    padded = np.concatenate([[0.0], mass, [0.0]])
    is_peak = (mass >= padded[:-2]) & (mass >= padded[2:]) & (mass >= least_share * mass.max())
    peaks_m = heights.min() + (np.arange(mass.size) - reach + 0.5) * resolution_m
    is_peak &= peaks_m <= bottom_m + depth_below_m
    if not is_peak.any():
        return FloorHeight(bottom_m)
    # A flat-topped peak (one surface alone) counts at its middle.
    last = first = int(np.flatnonzero(is_peak)[0])
    while last + 1 < mass.size and is_peak[last + 1] and mass[last + 1] == mass[first]:
        last += 1
    peak_m = float(0.5 * (peaks_m[first] + peaks_m[last]))

    plane = np.array([peak_m, 0.0, 0.0])
    middle = np.zeros(2)
    member = np.abs(heights - peak_m) <= thickness_m
    for _ in range(5):  # a slope brings in distant parts, which sharpen the slope
        middle = np.average(centres[member, :2], axis=0, weights=weights[member])
        plane = fit_slope(
            centres[member] - [*middle, 0.0], weights[member], 0.4 * thickness_m, likely_slope
        )
        level = plane[0] + (centres[:, :2] - middle) @ plane[1:]
        member = np.abs(heights - level) <= thickness_m
        if not member.any():
            member = np.abs(heights - peak_m) <= thickness_m
            break
    level = plane[0] + (centres[:, :2] - middle) @ plane[1:]
    above = heights - level > 3.0 * thickness_m
    there = (
        np.average(centres[above, :2], axis=0, weights=weights[above]) if above.any() else middle
    )
    return FloorHeight(
        height_m=float(plane[0] + (there - middle) @ plane[1:]),
        slope_x=float(plane[1]),
        slope_y=float(plane[2]),
        residual_m=float(np.median(np.abs(heights - level)[member])),
        n_frames=int(np.unique(frame_of[member]).size),
        anchor=(float(there[0]), float(there[1])),
    )


def fit_slope(
    points: FloatArray, weights: FloatArray, sigma_m: float, likely_slope: float
) -> FloatArray:
    """`(3,)`; height at the origin and slopes along x and y: least squares, level is the prior.

    Args:
        points: `(n, 3)`; on the surface.
        weights: `(n,)`; how much each counts compared with the others.
        sigma_m: standard deviation of their heights.
        likely_slope: standard deviation of the slopes before anything is seen.
    """
    design = np.column_stack([np.ones(len(points)), points[:, :2]])
    # Each surface is one measurement: its weight only says how it compares with the others.
    share = weights / max(float(weights.mean()), 1e-12)
    normal_matrix = (design * share[:, None]).T @ design / sigma_m**2
    normal_matrix += np.diag([1e-12, 1.0 / likely_slope**2, 1.0 / likely_slope**2])
    return np.linalg.solve(normal_matrix, (design * share[:, None]).T @ points[:, 2] / sigma_m**2)
