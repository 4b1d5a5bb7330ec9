"""Scene to model: robust ICP of measured points onto a CAD model that stands upright.

Deviates from Section 3.2.3, which matches the whole model to the scene: here every measured point
looks for its place on the model, so parts of the model that nobody saw never vote (Section 3.3.1
names this as the reason why ICP made poses worse).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fluentboard.model.geometry import FloatArray, Pose, Transform
from fluentboard_modules.mapping.alignment_kernels import icp_steps
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.config import AlignmentConfig
from fluentboard_modules.mapping.nearest_samples import CELL_M, REACH_M, VOXEL_M


@dataclass(frozen=True, slots=True)
class Standing:
    """Where a model stands: its origin and its heading in the map, metres and radians."""

    x: float
    y: float
    yaw_rad: float
    z: float = 0.0

    @property
    def transform(self) -> Transform:
        """Takes points of the model's frame to the map."""
        return Transform.upright(self.x, self.y, self.z, self.yaw_rad)

    @property
    def pose(self) -> Pose:
        """As a pose in the map."""
        return Pose.from_rpy(self.x, self.y, self.z, yaw=self.yaw_rad)

    def moved(self, dx: float, dy: float, dyaw: float) -> Standing:
        """Moved by so much in its own frame, then turned about its own origin."""
        c, s = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        x, y = self.x + c * dx - s * dy, self.y + s * dx + c * dy
        yaw = np.arctan2(np.sin(self.yaw_rad + dyaw), np.cos(self.yaw_rad + dyaw))
        return Standing(float(x), float(y), float(yaw), self.z)


def align(
    points_map: FloatArray, model: CadModel, start: Standing, config: AlignmentConfig
) -> Standing:
    """Moves a model, upright, to fit measured points: point to point first, then point to plane.

    Args:
        points_map: `(n, 3)`; measured points around the start.
        model: what should be there.
        start: where to begin.
        config: steps and scales.

    Returns:
        Where it fits, to about a centimetre; see `refinement` for the rest.
    """
    surface, nearest = model.surface, model.nearest
    scales = np.geomspace(
        config.scale_first_m, config.scale_last_m, config.point_steps + config.plane_steps
    )
    place = np.array([start.x, start.y, start.yaw_rad, start.z])
    icp_steps(
        points_map,
        place,
        nearest.low,
        VOXEL_M,
        nearest.field,
        nearest.members,
        nearest.firsts,
        CELL_M,
        REACH_M,
        surface.points,
        surface.normals,
        scales,
        config.point_steps,
        config.points_least,
        config.damping,
    )
    x, y, yaw, _ = place.tolist()
    return Standing(x, y, math.remainder(yaw, 2.0 * math.pi), start.z)
