"""The last centimetre: a model's pose from all pixels in which it is seen.

ICP matches points with samples of the whole surface, a thousand points with what is nearest. From
a pose that is nearly right, the model is drawn into the depth images instead: every pixel is
compared with the surface that it shows, exact to the triangle, and what hides behind the front
votes as little as edges do. Only directions that some surface faces are bound; the others stay.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.alignment import Standing
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.config import RefinementConfig, VisibilityConfig
from fluentboard_modules.mapping.depth_views import DepthView
from fluentboard_modules.mapping.stack_kernels import equations_of_views
from fluentboard_modules.mapping.view_stack import ViewStack

_ANOTHER_RAD = 0.35  # a plane that is turned by more against the piece is not its backrest


@dataclass(frozen=True, slots=True)
class Heading:
    """Which way a piece faces by the normal of a plane of its own, such as a backrest.

    The plane was measured on all pixels of an image, of which views for verification keep a
    sixteenth.

    Attributes:
        yaw_rad: in the map.
        sigma_rad: its standard deviation.
        may_be_reversed: whether the piece may as well face the other way.
    """

    yaw_rad: float
    sigma_rad: float
    may_be_reversed: bool = False

    def difference_rad(self, yaw_rad: float) -> float:
        """How far a piece that faces this way has to be turned."""
        period = math.pi if self.may_be_reversed else 2.0 * math.pi
        return math.remainder(self.yaw_rad - yaw_rad, period)


@dataclass(frozen=True, slots=True)
class Refined:
    """Where a model stands by the pixels that show it.

    Attributes:
        standing: its place.
        information: `(3, 3)`; about x, y (metres) and yaw (radians) in the model's own frame, as
            if pixels erred independently with the noise of the sensor; with what the heading says.
        misfit: mean squared residual in variances of that noise.
        n_pixels: that voted.
    """

    standing: Standing
    information: FloatArray
    misfit: float
    n_pixels: int


def refine(
    model: CadModel,
    start: Standing,
    views: Sequence[DepthView],
    visibility: VisibilityConfig,
    config: RefinementConfig,
    heading: Heading | None = None,
) -> Refined:
    """Moves a model, upright, until the pixels that show it agree best.

    Args:
        model: what is there.
        start: nearly where.
        views: depth images of it.
        visibility: how far around the model they are looked at.
        config: steps and scales.
        heading: what else is known about it.

    Returns:
        Its place and how well it is bound; the start itself if hardly any pixel shows it.
    """
    standing, mesh, stack = start, model.mesh, ViewStack.of(views)
    information, squares, n_pixels = np.zeros((3, 3)), 0.0, 0
    for scale in np.geomspace(config.scale_first_m, config.scale_last_m, config.steps).tolist():
        information, gradient, weights, squares, n_pixels = equations_of_views(
            mesh.vertices,
            mesh.triangles,
            model.box_corners,
            standing.transform.matrix,
            stack.depth_m,
            stack.sigma_m,
            stack.cameras,
            stack.sizes,
            stack.T_sensor_map,
            visibility.overrun_reach_m,
            scale,
            config.bias_m,
            config.edge_m,
        )
        if n_pixels < config.pixels_least:
            return Refined(start, np.zeros((3, 3)), 1.0, n_pixels)
        difference = 0.0 if heading is None else heading.difference_rad(standing.yaw_rad)
        if heading is not None and abs(difference) < _ANOTHER_RAD:
            certainty = 1.0 / (config.independent_share * heading.sigma_rad**2)
            information[2, 2] += certainty
            gradient[2] += certainty * difference
        # What no pixel binds stays where it is; a top alone binds nothing level at all.
        held = config.damping * float(np.trace(information[:2, :2])) + 1.0
        damping = held * np.diag([1.0, 1.0, 0.1])
        dx, dy, dyaw = np.linalg.solve(information + damping, gradient).tolist()
        standing = standing.moved(
            float(np.clip(dx, -scale, scale)),
            float(np.clip(dy, -scale, scale)),
            float(np.clip(dyaw, -0.1, 0.1)),
        )
        squares /= max(weights, 1e-9)
    return Refined(standing, information, squares, n_pixels)
