"""Scene to model: robust ICP of measured points onto a CAD model that stands upright.

Deviates from Section 3.2.3, which matches the whole model to the scene: here every measured point
looks for its place on the model, so parts of the model that nobody saw never vote (Section 3.3.1
names this as the reason why ICP made poses worse).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fluentboard.model.geometry import FloatArray, Pose, Transform
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.config import AlignmentConfig


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
        return self.pose.to_transform()

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


@dataclass(frozen=True, slots=True)
class Alignment:
    """Where ICP put a model.

    Attributes:
        standing: its place.
        covariance: `(3, 3)`; of x, y (metres, map frame) and yaw (radians), from the residuals of
            the last step and how well the points bind each direction.
        rms_m: weighted residual along the normals.
        inlier_share: points that are closer than the last scale.
    """

    standing: Standing
    covariance: FloatArray
    rms_m: float
    inlier_share: float


def align(
    points_map: FloatArray, model: CadModel, start: Standing, config: AlignmentConfig
) -> Alignment:
    """Moves a model, upright, to fit measured points: point to point first, then point to plane.

    Args:
        points_map: `(n, 3)`; measured points around the start.
        model: what should be there.
        start: where to begin.
        config: steps and scales.
    """
    surface, tree = model.surface, model.tree
    standing = start
    information = np.zeros((3, 3))
    rms, inliers = config.scale_first_m, 0.0
    n_steps = config.point_steps + config.plane_steps
    scales = np.geomspace(config.scale_first_m, config.scale_last_m, n_steps)
    for step, scale in enumerate(scales):
        local = standing.transform.inverse().apply(points_map)
        distance, index = tree.query(local, distance_upper_bound=float(scale))
        near = np.isfinite(distance)
        if int(near.sum()) < config.points_least:
            break
        p, q = local[near], surface.points[index[near]]
        n, d = surface.normals[index[near]], distance[near]
        weight = (1.0 - np.minimum(d / scale, 1.0) ** 2) ** 2  # Tukey
        if step < config.point_steps:
            rows = np.zeros((2, len(p), 3))
            rows[0, :, 0], rows[1, :, 1] = 1.0, 1.0
            rows[0, :, 2], rows[1, :, 2] = -q[:, 1], q[:, 0]
            jacobian = rows.reshape(-1, 3)
            residual = np.concatenate([p[:, 0] - q[:, 0], p[:, 1] - q[:, 1]])
            w = np.concatenate([weight, weight])
        else:
            jacobian = np.column_stack([n[:, 0], n[:, 1], n[:, 1] * q[:, 0] - n[:, 0] * q[:, 1]])
            residual = np.einsum("ij,ij->i", n, p - q)
            w = weight
        information = (jacobian * w[:, None]).T @ jacobian
        gradient = (jacobian * w[:, None]).T @ residual
        # What no point binds stays where it is.
        damping = config.damping * len(p) * np.diag([1.0, 1.0, 0.1])
        dx, dy, dyaw = np.linalg.solve(information + damping, gradient)
        standing = standing.moved(
            float(np.clip(dx, -scale, scale)),
            float(np.clip(dy, -scale, scale)),
            float(np.clip(dyaw, -0.3, 0.3)),
        )
        rms = float(np.sqrt((w * residual**2).sum() / max(float(w.sum()), 1e-9)))
        inliers = float(near.mean())
    return Alignment(standing, _covariance(information, rms, standing, config), rms, inliers)


def _covariance(
    information: FloatArray, rms_m: float, standing: Standing, config: AlignmentConfig
) -> FloatArray:
    """`(3, 3)` in the map's axes; neighbouring points err alike, so few of them are independent."""
    prior = np.diag([1.0 / 0.25**2, 1.0 / 0.25**2, 1.0 / 0.35**2])
    sigma = max(rms_m, config.sigma_least_m)
    local = np.linalg.inv(information * config.independent_share / sigma**2 + prior)
    c, s = np.cos(standing.yaw_rad), np.sin(standing.yaw_rad)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return turn @ local @ turn.T
