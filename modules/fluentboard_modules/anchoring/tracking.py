"""Track identifiers: one number for an object as long as it is seen frame after frame (4.2.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.config import TrackingConfig
from fluentboard_modules.anchoring.observation import Cluster

_NEVER = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class _Track:
    number: int
    centre_map: FloatArray
    longest_m: float
    last_seen_s: float


class Tracker:
    """Gives every cluster its track.

    A cluster continues the track whose last place is nearest, all clusters together chosen so that
    the sum of distances is least. A track ends when it has not been seen for a while; what appears
    later at its place gets a new number, and anchoring decides whether it is the same object.
    """

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config
        self._tracks: list[_Track] = []
        self._issued = 0
        self._last_s = 0.0

    def update(self, clusters: Sequence[Cluster], now_s: float) -> list[Cluster]:
        """The same clusters with their track identifiers, in the same order.

        Args:
            clusters: of one frame.
            now_s: time of the frame; the tracks start anew when it is before the last one.
        """
        config = self._config
        # What the very last frame showed goes on in this one, however slow the frames come.
        is_next = 0.0 <= now_s - self._last_s <= config.pause_max_s
        self._tracks = [
            track
            for track in self._tracks
            if 0.0 <= now_s - track.last_seen_s <= config.patience_s
            or (is_next and track.last_seen_s == self._last_s)
        ]
        self._last_s = now_s
        cost = np.full((len(clusters), len(self._tracks)), _NEVER)
        for i, cluster in enumerate(clusters):
            for j, track in enumerate(self._tracks):
                cost[i, j] = self._cost(cluster, track, now_s)
        chosen: dict[int, int] = {}
        if cost.size:
            for i, j in zip(*linear_sum_assignment(cost), strict=True):
                if cost[i, j] < _NEVER:
                    chosen[int(i)] = int(j)
        seen: list[_Track] = []
        tracked: list[Cluster] = []
        for i, cluster in enumerate(clusters):
            if i in chosen:
                number = self._tracks[chosen[i]].number
            else:
                self._issued += 1
                number = self._issued
            longest = max(cluster.box.x_size, cluster.box.y_size, cluster.box.z_size)
            seen.append(_Track(number, cluster.centroid_map, longest, now_s))
            tracked.append(replace(cluster, track_id=number))
        continued = set(chosen.values())
        self._tracks = [
            *seen,
            *(track for j, track in enumerate(self._tracks) if j not in continued),
        ]
        return tracked

    def _cost(self, cluster: Cluster, track: _Track, now_s: float) -> float:
        config = self._config
        distance = float(np.linalg.norm(cluster.centroid_map - track.centre_map))
        elapsed_s = min(now_s - track.last_seen_s, config.patience_s)
        reach = config.reach_m + config.reach_per_s * elapsed_s
        longest = max(cluster.box.x_size, cluster.box.y_size, cluster.box.z_size)
        # Half of a large object is as far from its whole as a mug is long.
        reach += 0.25 * abs(longest - track.longest_m)
        ratio = max(longest, track.longest_m) / max(1e-6, min(longest, track.longest_m))
        if distance > reach or (ratio > config.size_ratio_max and not cluster.is_cut_off):
            return _NEVER
        return distance
