"""How well a model explains depth images: pixels explained, occluded, violated and overrun.

A ray through a pixel meets the model at some depth. What was measured there either agrees
(explained), is nearer (occluded: something stands in front, which says nothing), or is farther: the
sensor saw through the model, which contradicts it (violated). Where the measured surface goes on
beyond the model's outline in the same plane, the outline is wrong (overrun): a cupboard's side is
not a backrest. And where something is measured in a space that must be empty (filled), a waste
bin is not a chair.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.config import VisibilityConfig
from fluentboard_modules.mapping.depth_views import DepthView
from fluentboard_modules.mapping.draw_kernels import draw, image_window, in_sensor
from fluentboard_modules.mapping.relief_kernels import relief_equations
from fluentboard_modules.mapping.stack_kernels import areas_of_views, first_in_box
from fluentboard_modules.mapping.view_stack import ViewStack

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


def compare_with_views(
    model: CadModel,
    T_map_model: Transform,
    views: Sequence[DepthView],
    config: VisibilityConfig,
    n_views: int | None = None,
) -> Visibility:
    """Looks at a placed model from several views.

    Args:
        model: what.
        T_map_model: where it stands.
        views: depth images; a `ViewStack`, if they are looked at more than once.
        config: of the comparison.
        n_views: so many of them, from the first on; by default all.
    """
    stack = ViewStack.of(views)
    areas = areas_of_views(
        model.mesh.vertices,
        model.mesh.triangles,
        model.box_corners,
        model.void_corners,
        T_map_model.matrix,
        stack.depth_m,
        stack.sigma_m,
        stack.cameras,
        stack.sizes,
        stack.T_sensor_map,
        len(stack) if n_views is None else min(n_views, len(stack)),
        config.pixel_step,
        config.tolerance_m,
        config.tolerance_sigma,
        _BESIDE_M,
        config.overrun_reach_m,
        config.floor_clear_m,
    )
    return Visibility(*areas.tolist())


@dataclass(frozen=True, slots=True)
class Drawing:
    """A model drawn into the part of an image that shows it.

    Attributes:
        window: `(4,)`; first row, row behind the last, first column, column behind the last.
        corners: `(n, 3, 3)`; of its triangles in the sensor's frame.
        expected: `(h, w)`; depth, infinite where it is not.
        triangle: `(h, w)`; which one is seen, -1 where none is.
        T_sensor_model: where it was drawn.
    """

    window: NDArray[np.int64]
    corners: FloatArray
    expected: NDArray[np.float32]
    triangle: NDArray[np.int32]
    T_sensor_model: Transform


def draw_into(
    model: CadModel,
    T_map_model: Transform,
    view: DepthView,
    reach_m: float,
    step: int = 1,
) -> Drawing | None:
    """Draws a placed model into a view.

    Args:
        model: what.
        T_map_model: where it stands.
        view: the depth image.
        reach_m: so much around the model belongs to the window.
        step: every so many pixels.

    Returns:
        None if the view does not show it.
    """
    T_sensor_model = view.T_sensor_map @ T_map_model
    matrix, camera, intrinsics = T_sensor_model.matrix, view.camera, view.intrinsics
    window = image_window(
        model.box_corners, matrix, intrinsics, camera.height, camera.width, reach_m
    )
    if window[1] == 0:
        return None
    corners = in_sensor(model.mesh.vertices, model.mesh.triangles, matrix)
    expected, triangle = draw(corners, intrinsics, window, step)
    return Drawing(window, corners, expected, triangle, T_sensor_model)


def front_relief_m(
    model: CadModel, T_map_model: Transform, views: Sequence[DepthView], config: VisibilityConfig
) -> float:
    """How much deeper the openings of a model's front were measured than its edges, in metres.

    Books stand a few centimetres behind the edges of their boards. A wall or a door is as deep
    where the model has an edge as where it has an opening, so this is 0 for it, however noisy; also
    if the model is turned against the wall, for what is measured is a step on a slanted plane. It
    is lowered by twice its standard error: what was hardly seen has no relief.
    """
    stack = ViewStack.of(views)
    equations, right_side, counts = relief_equations(
        model.mesh.vertices,
        model.mesh.triangles,
        model.box_corners,
        T_map_model.matrix,
        stack.depth_m,
        stack.sigma_m,
        stack.cameras,
        stack.sizes,
        stack.T_sensor_map,
        config.overrun_reach_m,
        float(model.mesh.bounds[1, 0]),
        _RELIEF_REACH_M,
    )
    if (counts < _RELIEF_PIXELS).any():
        return 0.0
    covariance = np.linalg.inv(equations + 1e-9 * np.eye(4))
    relief = float((covariance @ right_side)[3])
    return max(relief - 2.0 * float(np.sqrt(covariance[3, 3])), 0.0)


def scene_points(
    views: Sequence[DepthView], T_map_box: Transform, half_size: FloatArray, spacing_m: float
) -> FloatArray:
    """`(n, 3)`; measured points of all views in an oriented box, one per cube of the spacing."""
    points, cubes = ViewStack.of(views).thinned(spacing_m)
    chosen = first_in_box(points, cubes, T_map_box.inverse().matrix, half_size)
    return points[chosen]
