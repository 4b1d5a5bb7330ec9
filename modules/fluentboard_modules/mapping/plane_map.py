"""The planes of a room, accumulated frame by frame.

Deviates from section 3.2.2, which classifies the planes of single frames or of one registered
cloud: here the regions of each frame are added to the planes of the map, and the map's planes are
classified. So a table whose ends were never in one picture is one table, and a chair may be made of
a seat seen today and a backrest seen yesterday.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.mapping.config import DepthNoiseConfig, FusionConfig
from fluentboard_modules.mapping.normals import depth_tolerance_m
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.plane_grid import MapPlane
from fluentboard_modules.mapping.plane_look import Visibility

_NEAREST_M = 0.3  # what is nearer to the sensor has no image


class PlaneMap:
    """The planes seen so far, by identifier.

    Args:
        config: when two regions are the same plane.
        noise: the depth sensor's.
    """

    def __init__(self, config: FusionConfig, noise: DepthNoiseConfig) -> None:
        self._config = config
        self._noise = noise
        self._planes: dict[int, MapPlane] = {}
        self._directory = _Directory()
        self._next_identifier = 0
        self._n_updates = 0
        self._stamp_s = 0.0
        self._merged_into: dict[int, int] = {}

    @property
    def planes(self) -> dict[int, MapPlane]:
        """All planes, by identifier, oldest first."""
        return self._planes

    @property
    def planes_seen_last(self) -> set[int]:
        """Identifiers of the planes that the last frame saw."""
        return {
            identifier
            for identifier, plane in self._planes.items()
            if plane.last_seen == self._n_updates
        }

    def current(self, identifier: int) -> int | None:
        """The identifier under which a plane lives on after merges; None if it was forgotten."""
        while identifier in self._merged_into:
            identifier = self._merged_into[identifier]
        return identifier if identifier in self._planes else None

    def update(
        self, frame: SensorFrame, regions: Sequence[PlanarRegion]
    ) -> tuple[list[int], dict[int, Visibility]]:
        """Adds one frame.

        Args:
            frame: the frame, in the map frame.
            regions: what `detect_regions` found in it.

        Returns:
            Per region the identifier of its plane, and per plane in view how the frame saw it.
        """
        self._n_updates += 1
        self._stamp_s = frame.stamp_s
        assigned: list[int] = []
        cells_seen: dict[int, list[NDArray[np.int32]]] = {}
        for region in regions:  # largest first: a whole table top before its scraps
            identifier, cells = self._place(region)
            assigned.append(identifier)
            cells_seen.setdefault(identifier, []).append(cells)
        assigned = [self._root(identifier) for identifier in assigned]
        views = self._look(frame, cells_seen)
        self._forget()
        return assigned, views

    def regions(self, least_frames: int = 1) -> list[tuple[int, PlanarRegion]]:
        """(identifier, region) of the planes that so many frames saw and that are still there."""
        found: list[tuple[int, PlanarRegion]] = []
        for identifier, plane in self._planes.items():
            if plane.n_frames >= least_frames:
                region = plane.region(identifier)
                if region is not None and not region.contour.is_empty:
                    found.append((identifier, region))
        return found

    def _root(self, identifier: int) -> int:
        while identifier in self._merged_into:
            identifier = self._merged_into[identifier]
        return identifier

    def _place(self, region: PlanarRegion) -> tuple[int, NDArray[np.int32]]:
        """Adds a region to its plane, new or known; merges planes that it shows to be one."""
        matches: list[tuple[int, int, NDArray[np.int32]]] = []
        for identifier in self._candidates(region):
            plane = self._planes[identifier]
            cells = plane.cells_of(region)
            common = plane.overlap(cells, self._config.same_reach_cells)
            smaller = min(len(cells), int(np.count_nonzero(plane.solid)))
            if common >= self._config.same_overlap * max(smaller, 1):
                matches.append((common, identifier, cells))
        if not matches:
            plane = MapPlane(self._next_identifier, region.T_map_region, self._config)
            self._planes[plane.identifier] = plane
            self._next_identifier += 1
            cells = plane.cells_of(region)
        else:
            _, identifier, cells = max(matches, key=lambda match: (match[0], -match[1]))
            others = [other for _, other, _ in matches if other != identifier]
            plane = self._merge([identifier, *others])
            if plane.identifier != identifier:
                cells = plane.cells_of(region)
        plane.add(region, cells, self._weight(region), self._n_updates, self._stamp_s)
        self._directory.put(plane)
        return plane.identifier, cells

    def _candidates(self, region: PlanarRegion) -> list[int]:
        """Planes that face the same way and lie where the region lies."""
        low, high = region.bounds_map()
        return self._directory.near(
            region.normal,
            region.centroid,
            low,
            high,
            np.cos(np.deg2rad(self._config.same_angle_deg)),
            self._config.same_distance_m,
        )

    def _merge(self, identifiers: list[int]) -> MapPlane:
        """One plane out of several: the first, by its oldest identifier."""
        keep = min(identifiers)
        target = self._planes[keep]
        for identifier in identifiers:
            if identifier == keep:
                continue
            other = self._planes[identifier]
            if target.normal @ other.normal < np.cos(np.deg2rad(self._config.same_angle_deg)):
                continue
            target.absorb(other)
            self._remove(identifier)
            self._merged_into[identifier] = keep
        return target

    def _remove(self, identifier: int) -> None:
        del self._planes[identifier]
        self._directory.drop(identifier)

    def _weight(self, region: PlanarRegion) -> float:
        """Inverse variance of a region's position: noise of its distance, and the frame's pose."""
        distance = np.float32(np.linalg.norm(region.centroid - region.sensor_position))
        sigma = float(depth_tolerance_m(distance, self._noise))  # type: ignore[arg-type]
        return 1.0 / (sigma**2 + self._config.pose_sigma_m**2)

    def _look(
        self, frame: SensorFrame, cells_seen: dict[int, list[NDArray[np.int32]]]
    ) -> dict[int, Visibility]:
        views: dict[int, Visibility] = {}
        T_sensor_map = frame.T_map_sensor.inverse()
        in_view = self._directory.in_view(frame.camera, T_sensor_map)
        for identifier, plane in self._planes.items():
            parts = cells_seen.get(identifier)
            if parts is None and identifier not in in_view:
                continue
            cells = np.concatenate(parts) if parts else None
            view = plane.look(frame, T_sensor_map, self._config.see_through_m, cells)
            if view.expected == 0:
                continue
            views[identifier] = view
            plane.judge(view, frame.T_map_sensor.translation)
        return views

    def _forget(self) -> None:
        """Drops planes that are gone and planes that were noise."""
        for identifier in list(self._planes):
            plane = self._planes[identifier]
            if plane.is_noise or not plane.solid.any():
                self._remove(identifier)
        excess = len(self._planes) - self._config.planes_max
        if excess > 0:
            order = sorted(
                self._planes.values(), key=lambda plane: (plane.n_frames, plane.last_seen)
            )
            for plane in order[:excess]:
                self._remove(plane.identifier)


class _Directory:
    """Equations and boxes of all planes as arrays, to find the few that a region may belong to."""

    def __init__(self) -> None:
        self._identifiers = np.zeros(0, dtype=np.int64)
        self._rows: dict[int, int] = {}
        self._equations = np.zeros((0, 4))
        self._bounds = np.zeros((0, 2, 3))

    def put(self, plane: MapPlane) -> None:
        """Adds a plane, or notes that it changed."""
        row = self._rows.get(plane.identifier)
        if row is None:
            row = len(self._rows)
            if row == len(self._identifiers):
                spare = max(64, row)
                self._identifiers = np.pad(self._identifiers, (0, spare))
                self._equations = np.pad(self._equations, ((0, spare), (0, 0)))
                self._bounds = np.pad(self._bounds, ((0, spare), (0, 0), (0, 0)))
            self._rows[plane.identifier] = row
        self._identifiers[row] = plane.identifier
        self._equations[row] = plane.equation
        self._bounds[row] = plane.bounds

    def drop(self, identifier: int) -> None:
        """Removes a plane; the last row takes its place."""
        row = self._rows.pop(identifier)
        last = len(self._rows)
        if row != last:
            moved = int(self._identifiers[last])
            self._rows[moved] = row
            for array in (self._identifiers, self._equations, self._bounds):
                array[row] = array[last]

    def in_view(self, camera: Camera, T_sensor_map: Transform) -> set[int]:
        """Planes whose front faces the sensor and whose boxes may show in its image."""
        n = len(self._rows)
        equations, bounds = self._equations[:n], self._bounds[:n]
        position = T_sensor_map.inverse().translation
        # Seen from behind, a thin surface shows its other side.
        faces = equations[:, :3] @ position > equations[:, 3]
        corners = np.stack(
            [bounds[:, sides, [0, 1, 2]] for sides in itertools.product((0, 1), repeat=3)], axis=1
        )
        in_camera = T_sensor_map.apply(corners)
        ahead = in_camera[..., 2] > _NEAREST_M
        pixels = camera.project(
            np.maximum(in_camera, (-np.inf, -np.inf, _NEAREST_M)).reshape(-1, 3)
        )
        pixels = pixels.reshape(n, 8, 2)
        inside = (pixels.max(axis=1) >= 0).all(axis=1)
        inside &= (pixels.min(axis=1) < (camera.width, camera.height)).all(axis=1)
        # A box that reaches behind the camera has no bounds in the image.
        possible = faces & ahead.any(axis=1) & (inside | ~ahead.all(axis=1))
        return {int(identifier) for identifier in self._identifiers[:n][possible]}

    def near(
        self,
        normal: FloatArray,
        centre: FloatArray,
        low: FloatArray,
        high: FloatArray,
        least_cosine: float,
        distance_m: float,
    ) -> list[int]:
        """Planes of about this normal, this close to the centre, whose boxes meet this box."""
        n = len(self._rows)
        equations, bounds = self._equations[:n], self._bounds[:n]
        fits = equations[:, :3] @ normal >= least_cosine
        fits &= np.abs(equations[:, :3] @ centre - equations[:, 3]) <= distance_m
        fits &= (bounds[:, 0] <= high + distance_m).all(axis=1)
        fits &= (bounds[:, 1] >= low - distance_m).all(axis=1)
        return sorted(int(identifier) for identifier in self._identifiers[:n][fits])
