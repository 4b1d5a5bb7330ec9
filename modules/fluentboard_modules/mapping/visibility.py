"""How well a model explains depth images: pixels explained, occluded, violated and overrun.

A ray through a pixel meets the model at some depth. What was measured there either agrees
(explained), is nearer (occluded: something stands in front, which says nothing), or is farther: the
sensor saw through the model, which contradicts it (violated). Where the measured surface goes on
beyond the model's outline in the same plane, the outline is wrong (overrun): a cupboard's side is
not a backrest. And where something is measured in a space that must be empty (filled), a waste
bin is not a chair.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.mapping.cad_models import CadModel, Void
from fluentboard_modules.mapping.config import VisibilityConfig
from fluentboard_modules.mapping.depth_views import DepthView

_NEAREST_M = 0.3
_BESIDE_M = 0.01
_RELIEF_REACH_M = 0.1
_RELIEF_PIXELS = 20  # of edges and of openings each


@dataclass(frozen=True, slots=True)
class Visibility:
    """Areas of a model's surface as the images show them, in square metres across the view.

    A pixel counts with the area that it covers at the model's depth, so near views do not drown
    far ones.

    Attributes:
        explained: measured where the model says.
        occluded: hidden behind something nearer.
        violated: seen through.
        unknown: without a measurement.
        overrun: measured beyond the model's outline, in the same plane.
        filled: measured inside a space that must be empty.
        empty: seen through a space that must be empty.
        close: the explained area, each pixel counting less the further off it is.
    """

    explained: float = 0.0
    occluded: float = 0.0
    violated: float = 0.0
    unknown: float = 0.0
    overrun: float = 0.0
    filled: float = 0.0
    empty: float = 0.0
    close: float = 0.0

    def __add__(self, other: Visibility) -> Visibility:
        return Visibility(
            self.explained + other.explained,
            self.occluded + other.occluded,
            self.violated + other.violated,
            self.unknown + other.unknown,
            self.overrun + other.overrun,
            self.filled + other.filled,
            self.empty + other.empty,
            self.close + other.close,
        )

    def score(self, config: VisibilityConfig) -> float:
        """How well the model explains what was seen, in [0, 1]; 0 if nothing was seen of it."""
        return self.explained / (self.explained + self._against(config))

    def closeness(self, config: VisibilityConfig) -> float:
        """As the score, but it also grows as the surfaces come closer."""
        return self.close / (self.explained + self._against(config))

    def gain(self, config: VisibilityConfig) -> float:
        """What speaks for a pose less what speaks against it, in square metres.

        To compare poses: a share, such as the score, would rise as a model slides out of the image
        or behind something, away from where it has to prove itself.
        """
        return self.close - config.against_weight * self._against(config)

    def _against(self, config: VisibilityConfig) -> float:
        return (
            self.violated
            + config.overrun_weight * self.overrun
            + config.filled_weight * self.filled
            + config.doubt_m2
        )

    @property
    def seen_share(self) -> float:
        """The share of the model in view that was not hidden."""
        total = self.explained + self.occluded + self.violated + self.unknown
        return (self.explained + self.violated) / total if total > 0.0 else 0.0


def compare_with_views(
    model: CadModel,
    T_map_model: Transform,
    views: Iterable[DepthView],
    config: VisibilityConfig,
) -> Visibility:
    """Looks at a placed model from all views."""
    total = Visibility()
    for view in views:
        total = total + compare_with_view(model, T_map_model, view, config)
    return total


def compare_with_view(
    model: CadModel, T_map_model: Transform, view: DepthView, config: VisibilityConfig
) -> Visibility:
    """Looks at a placed model from one view."""
    window = _window(model, T_map_model, view, config)
    if window is None:
        return Visibility()
    rows, columns = window
    step = config.pixel_step
    rows, columns = slice(rows.start, rows.stop, step), slice(columns.start, columns.stop, step)
    rays = view.rays[rows, columns]
    depth = view.depth_m[rows, columns]
    T_model_sensor = T_map_model.inverse() @ view.T_map_sensor
    origin = T_model_sensor.translation.astype(np.float32)
    directions = rays @ T_model_sensor.rotation.T.astype(np.float32)
    hits = model.caster.cast(np.concatenate([np.broadcast_to(origin, rays.shape), directions], -1))
    expected = hits.distance
    on_model = np.isfinite(expected)
    if not on_model.any():
        return Visibility()
    tolerance = np.maximum(
        np.float32(config.tolerance_m),
        np.float32(config.tolerance_sigma) * view.sigma_m[rows, columns],
    )
    known = depth > 0.0
    misfit = _misfit(depth, expected)
    agrees = (misfit <= tolerance) & on_model
    nearer = on_model & known & ~agrees & (depth < expected)
    farther = on_model & known & ~agrees & (depth > expected)
    scale = np.float32(step * step / (view.camera.fx * view.camera.fy))
    area = np.where(on_model, expected, 0.0) ** 2 * scale
    overrun = _overrun_m2(
        model, T_model_sensor, rays, depth, expected, hits.triangle, agrees, tolerance, config, step
    )
    filled, empty = _voids_m2(model.voids, origin, directions, depth, known, scale)
    return Visibility(
        explained=float(area[agrees].sum()),
        occluded=float(area[nearer].sum()),
        violated=float(area[farther].sum()),
        unknown=float(area[on_model & ~known & ~agrees].sum()),
        overrun=overrun * float(scale),
        filled=filled,
        empty=empty,
        close=float((area * np.maximum(0.0, 1.0 - (misfit / tolerance) ** 2))[agrees].sum()),
    )


def _window(
    model: CadModel, T_map_model: Transform, view: DepthView, config: VisibilityConfig
) -> tuple[slice, slice] | None:
    """The part of the image that shows the model and a little around it."""
    low, high = model.mesh.bounds
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    corners = low + corners * (high - low)
    points = view.T_sensor_map.apply(T_map_model.apply(corners))
    camera = view.camera
    if (points[:, 2] < _NEAREST_M).all():
        return None
    if (points[:, 2] < _NEAREST_M).any():
        return slice(0, camera.height), slice(0, camera.width)
    pixels = camera.project(points)
    margin = config.overrun_reach_m * camera.fx / float(points[:, 2].min()) + 2.0
    left, top = np.floor(pixels.min(axis=0) - margin).astype(int)
    right, bottom = np.ceil(pixels.max(axis=0) + margin).astype(int) + 1
    left, right = max(left, 0), min(right, camera.width)
    top, bottom = max(top, 0), min(bottom, camera.height)
    if right - left < 2 or bottom - top < 2:
        return None
    return slice(top, bottom), slice(left, right)


def _misfit(depth: NDArray[np.float32], expected: NDArray[np.float32]) -> NDArray[np.float32]:
    """Least difference to a measurement at the pixel or beside it: at an edge half a pixel decides.

    What is beside it counts as a little worse, so that of two poses the exact one wins.
    """
    padded = np.pad(depth, 1)
    h, w = depth.shape
    least = np.full(depth.shape, np.inf, dtype=np.float32)
    for dy, dx in ((1, 1), (0, 1), (2, 1), (1, 0), (1, 2)):
        shifted = padded[dy : dy + h, dx : dx + w]
        extra = np.float32(0.0 if (dy, dx) == (1, 1) else _BESIDE_M)
        with np.errstate(invalid="ignore"):
            difference = np.where(shifted > 0.0, np.abs(shifted - expected) + extra, np.inf)
        least = np.minimum(least, difference.astype(np.float32))
    return least


def _overrun_m2(
    model: CadModel,
    T_model_sensor: Transform,
    rays: NDArray[np.float32],
    depth: NDArray[np.float32],
    expected: NDArray[np.float32],
    triangle: NDArray[np.int32],
    agrees: NDArray[np.bool_],
    tolerance: NDArray[np.float32],
    config: VisibilityConfig,
    step: int,
) -> float:
    """Pixels times depth squared where the measured surface goes on beyond the model's outline."""
    outside = ~np.isfinite(expected) & (depth > 0.0)
    if not outside.any() or not agrees.any():
        return 0.0
    distance_px, nearest = distance_transform_edt(
        ~np.isfinite(expected), return_distances=True, return_indices=True
    )
    row, column = nearest[0][outside], nearest[1][outside]
    normal = model.caster.triangle_normal[triangle[row, column]] @ T_model_sensor.rotation.astype(
        np.float32
    )
    foot = rays[row, column] * expected[row, column][:, None]
    ray = rays[outside]
    along = np.einsum("ij,ij->i", normal, ray)
    steep = np.abs(along) < 0.15 * np.linalg.norm(ray, axis=1)
    safe = np.where(np.abs(along) < 1e-4, np.float32(1e-4), along)
    continued = np.einsum("ij,ij->i", normal, foot) / safe
    measured = depth[outside]
    goes_on = np.abs(measured - continued) <= tolerance[outside]
    goes_on &= ~steep & agrees[row, column]
    # Neighbouring pixels of a true edge may still show it: start a pixel further out.
    gap = np.linalg.norm(ray * measured[:, None] - foot, axis=1)
    goes_on &= (gap <= config.overrun_reach_m) & (distance_px[outside] > 1.0)
    height = (ray * measured[:, None]) @ T_model_sensor.rotation[2].astype(
        np.float32
    ) + T_model_sensor.translation[2]
    goes_on &= height > config.floor_clear_m
    return float((measured[goes_on] ** 2).sum())


def _voids_m2(
    voids: Sequence[Void],
    origin: NDArray[np.float32],
    directions: NDArray[np.float32],
    depth: NDArray[np.float32],
    known: NDArray[np.bool_],
    scale: np.float32,
) -> tuple[float, float]:
    """Cross-section of the voids in which something was measured, and that was seen through."""
    filled = empty = 0.0
    safe = np.where(np.abs(directions) < 1e-6, np.float32(1e-6), directions)
    for void in voids:
        a = (np.array(void.low, dtype=np.float32) - origin) / safe
        b = (np.array(void.high, dtype=np.float32) - origin) / safe
        enter = np.minimum(a, b).max(axis=-1)
        leave = np.maximum(a, b).min(axis=-1)
        crossed = (enter < leave) & (enter > 0.0) & known
        inside = crossed & (depth > enter) & (depth < leave)
        through = crossed & (depth >= leave)
        filled += float((depth[inside] ** 2).sum() * scale)
        empty += float((leave[through] ** 2).sum() * scale)
    return filled, empty


def front_relief_m(
    model: CadModel, T_map_model: Transform, views: Iterable[DepthView], config: VisibilityConfig
) -> float:
    """How much deeper the openings of a model's front were measured than its edges, in metres.

    Books stand a few centimetres behind the edges of their boards. A wall or a door is as deep
    where the model has an edge as where it has an opening, so this is 0 for it, however noisy; also
    if the model is turned against the wall, for what is measured is a step on a slanted plane. It
    is lowered by twice its standard error: what was hardly seen has no relief.
    """
    front = float(model.mesh.bounds[1, 0])
    # Of the least squares: depth behind the front = offset + slopes along it + relief in openings.
    normal_matrix, right_side = 1e-9 * np.eye(4), np.zeros(4)
    counts = np.zeros(2)
    for view in views:
        window = _window(model, T_map_model, view, config)
        if window is None:
            continue
        rays, depth = view.rays[window], view.depth_m[window]
        T_model_sensor = T_map_model.inverse() @ view.T_map_sensor
        origin = T_model_sensor.translation.astype(np.float32)
        directions = rays @ T_model_sensor.rotation.T.astype(np.float32)
        if origin[0] <= front:
            continue
        hits = model.caster.cast(
            np.concatenate([np.broadcast_to(origin, rays.shape), directions], -1)
        )
        hit = np.isfinite(hits.distance)
        expected_x = origin[0] + np.where(hit, hits.distance, 0.0) * directions[..., 0]
        measured = origin + depth[..., None] * directions
        behind = front - measured[..., 0]
        # What is far in front of it or far inside says nothing about its edges.
        usable = hit & (depth > 0.0) & (np.abs(behind) < _RELIEF_REACH_M)
        is_edge = usable & (expected_x > front - 0.012)
        is_opening = usable & (expected_x < front - 0.06)
        counts += np.count_nonzero(is_edge), np.count_nonzero(is_opening)
        used = is_edge | is_opening
        y, z = measured[used][:, 1], measured[used][:, 2]
        rows = np.column_stack([np.ones(len(y)), y, z, is_opening[used]]).astype(np.float64)
        weight = 1.0 / np.maximum(view.sigma_m[window][used], 1e-3).astype(np.float64) ** 2
        normal_matrix += (rows * weight[:, None]).T @ rows
        right_side += (rows * weight[:, None]).T @ behind[used]
    if (counts < _RELIEF_PIXELS).any():
        return 0.0
    covariance = np.linalg.inv(normal_matrix)
    relief = float((covariance @ right_side)[3])
    return max(relief - 2.0 * float(np.sqrt(covariance[3, 3])), 0.0)


def scene_points(
    views: Sequence[DepthView], T_map_box: Transform, half_size: FloatArray, spacing_m: float
) -> FloatArray:
    """`(n, 3)`; measured points of all views in an oriented box, one per cube of the spacing."""
    parts: list[FloatArray] = []
    T_box_map = T_map_box.inverse()
    for view in views:
        points = view.points_map
        in_box = T_box_map.apply(points)
        parts.append(points[(np.abs(in_box) <= half_size).all(axis=1)])
    points = np.concatenate(parts) if parts else np.zeros((0, 3))
    if len(points) == 0:
        return points
    x, y, z = np.floor((points - points.min(axis=0)) / spacing_m).astype(np.int64).T
    _, first = np.unique((x << 40) | (y << 20) | z, return_index=True)
    return points[np.sort(first)]
