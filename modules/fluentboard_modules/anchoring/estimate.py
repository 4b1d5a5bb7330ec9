"""Pose and size of an object, filtered over observations with covariance."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fluentboard.model.geometry import BoundingBox, FloatArray, Pose
from fluentboard_modules.anchoring.config import FilterConfig
from fluentboard_modules.anchoring.observation import Cluster

_TOLD_SIGMA_M = 0.10  # of a place that somebody else wrote
_SIZE_SIGMA_M = 0.012
_KNOWN_SIZE_SIGMA_M = 0.006  # after four whole views
_JUMP_M = 0.06  # an object that moved less may as well be drift of the camera's pose
_ROUND = 1.15  # boxes less oblong have no direction


@dataclass(frozen=True, slots=True, eq=False)
class BoxEstimate:
    """An upright box with uncertain centre and size.

    A view shows the near side of an object only, so that its centre is known well across the line
    of sight and badly along it; views from several sides make up for each other.

    Attributes:
        centre_map: `(3,)`; in metres.
        covariance: `(3, 3)`; of the centre, without the error of the camera's place.
        size: `(3,)`; long side, short side, height in metres.
        size_variance: `(3,)`; in square metres.
        turn: `(2,)`; cosine and sine of twice the yaw of the long side, weighted by how oblong the
            views were.
    """

    centre_map: FloatArray
    covariance: FloatArray
    size: FloatArray
    size_variance: FloatArray
    turn: FloatArray

    @classmethod
    def of_box(cls, box: BoundingBox) -> BoxEstimate:
        """What a fluent says, which may be out of date."""
        long, short, yaw = _sides(box)
        oblong = long / max(short, 1e-3) - 1.0
        return cls(
            np.array([box.pose.x, box.pose.y, box.pose.z]),
            np.eye(3) * _TOLD_SIGMA_M**2,
            np.array([long, short, box.z_size]),
            np.full(3, (2.0 * _SIZE_SIGMA_M) ** 2),
            min(oblong, 1.0) * np.array([math.cos(2.0 * yaw), math.sin(2.0 * yaw)]),
        )

    @classmethod
    def of_cluster(cls, cluster: Cluster, config: FilterConfig) -> BoxEstimate:
        """What one view says."""
        told = cls.of_box(cluster.box)
        hidden = _hidden(cluster, config)
        return replace(
            told,
            covariance=_view_covariance(cluster, config),
            size_variance=np.full(3, (_SIZE_SIGMA_M * hidden) ** 2),
            turn=told.turn / hidden,
        )

    @property
    def yaw_rad(self) -> float:
        """Turn of the long side about the vertical, within half a turn; 0 for round objects."""
        if self.size[0] < _ROUND * self.size[1]:
            return 0.0
        return 0.5 * math.atan2(float(self.turn[1]), float(self.turn[0]))

    @property
    def box(self) -> BoundingBox:
        """The most likely box."""
        x, y, z = (float(value) for value in self.centre_map)
        long, short, tall = (float(value) for value in self.size)
        return BoundingBox(Pose.from_rpy(x, y, z, yaw=self.yaw_rad), long, short, tall)

    @property
    def largest_sigma_m(self) -> float:
        """Standard deviation of the centre in the direction in which it is known worst."""
        return math.sqrt(float(np.linalg.eigvalsh(self.covariance)[-1]))

    def sigma_m(self, config: FilterConfig) -> FloatArray:
        """`(3,)`; standard deviation of the centre, with the error of the camera's place."""
        return np.sqrt(np.diag(self.covariance) + config.pose_sigma_m**2)

    def updated(self, cluster: Cluster, elapsed_s: float, config: FilterConfig) -> BoxEstimate:
        """The estimate after one more view.

        An object that is far from where it was has been moved, and only its size is kept.

        Args:
            cluster: the view.
            elapsed_s: since the last one.
            config: of the filter.
        """
        view = BoxEstimate.of_cluster(cluster, config)
        prior = self.covariance + np.eye(3) * config.drift_m_per_sqrt_s**2 * elapsed_s
        noise = view.covariance + np.eye(3) * config.pose_sigma_m**2
        is_part = _hidden(cluster, config) > 1.0
        innovation = self._outside(view) if is_part else view.centre_map - self.centre_map
        spread = prior + noise
        far = float(innovation @ np.linalg.solve(spread, innovation)) > config.moved_sigma**2
        if far and float(np.linalg.norm(innovation[:2])) > _JUMP_M and not cluster.is_cut_off:
            return replace(view, size=np.maximum(view.size, 0.8 * self.size))
        gain = prior @ np.linalg.inv(spread)
        centre = self.centre_map + gain @ innovation
        # A part that fits in leaves open where the whole is.
        fits_in = is_part and not innovation[:2].any()
        covariance = prior if fits_in else (np.eye(3) - gain) @ prior
        size, variance = self._resized(view, cluster, config)
        return BoxEstimate(
            centre, 0.5 * (covariance + covariance.T), size, variance, 0.95 * self.turn + view.turn
        )

    def _outside(self, part: BoxEstimate) -> FloatArray:
        """`(3,)`; least move of this box that takes in a part of the object.

        What the border of the image or another object leaves to be seen of an object has its own
        middle, and that is not the object's.
        """
        turn, off = self.yaw_rad, part.yaw_rad - self.yaw_rad
        axes = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
        cos, sin = abs(math.cos(off)), abs(math.sin(off))
        across = np.array([[cos, sin], [sin, cos]]) @ part.size[:2]
        away = part.centre_map - self.centre_map
        local = np.array([*(axes @ away[:2]), away[2]])
        room = np.maximum(0.0, 0.5 * (self.size - np.array([*across, part.size[2]])))
        local = np.sign(local) * np.maximum(0.0, np.abs(local) - room)
        return np.array([*(axes.T @ local[:2]), local[2]])

    def _resized(
        self, view: BoxEstimate, cluster: Cluster, config: FilterConfig
    ) -> tuple[FloatArray, FloatArray]:
        """Sizes after a view. What is hidden may be larger, never smaller.

        Once a size is known, one that is very different is mostly not the object's: two objects
        seen as one, or a part whose rest has no depth. It counts little, but it counts, for the
        first views may have been the wrong ones.
        """
        is_part = _hidden(cluster, config) > 1.0
        informative = (view.size >= self.size) if is_part else np.ones(3, dtype=bool)
        prior = self.size_variance + 1e-6
        gain = np.where(informative, prior / (prior + view.size_variance), 0.0)
        is_known = self.size_variance < _KNOWN_SIZE_SIGMA_M**2
        larger, smaller = np.maximum(view.size, self.size), np.minimum(view.size, self.size)
        is_odd = is_known & (larger > config.growth_max * smaller + 0.01)
        gain = np.where(is_odd, 0.1 * gain, gain)
        return self.size + gain * (view.size - self.size), (1.0 - gain) * prior


def _sides(box: BoundingBox) -> tuple[float, float, float]:
    """Long side, short side, and the yaw of the long one."""
    yaw = box.pose.yaw_rad
    if box.x_size >= box.y_size:
        return box.x_size, box.y_size, yaw
    return box.y_size, box.x_size, yaw + 0.5 * math.pi


def _hidden(cluster: Cluster, config: FilterConfig) -> float:
    return config.hidden_factor if cluster.is_cut_off or cluster.is_occluded else 1.0


def _view_covariance(cluster: Cluster, config: FilterConfig) -> FloatArray:
    """Covariance of a box's centre, largest along the horizontal line of sight."""
    sight = cluster.centroid_map[:2] - cluster.viewpoint_map[:2]
    sight = sight / max(1e-6, float(np.linalg.norm(sight)))
    along = np.array([sight[0], sight[1], 0.0])
    hidden = _hidden(cluster, config)
    across = (config.across_sigma_m * hidden) ** 2
    extra = max(0.0, (config.along_sigma_m * hidden) ** 2 - across)
    return np.eye(3) * across + extra * np.outer(along, along)
