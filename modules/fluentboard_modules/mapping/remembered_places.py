"""Is furniture that an earlier run wrote still where it was, by the images of this run?

A piece that this run has recognised is followed by its own hypotheses. The others are only looked
for at their places: where the camera sees through the main plane as the board has it, often enough,
the piece is gone. Hidden places and places out of sight say nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import shapely

from fluentboard.model.fluent import Fluent
from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.config import FusionConfig
from fluentboard_modules.mapping.existence import ExistenceBelief, log_odds
from fluentboard_modules.mapping.planar_region import PlanarRegion, as_multipolygon, upright_axes
from fluentboard_modules.mapping.plane_grid import MapPlane

_LOOKS_LEAST = 2  # a single frame may have been put in the wrong place
_FLAT_M = 0.02  # corners of a contour that are further from one plane are no contour


class RememberedPlaces:
    """The main planes of furniture on the board, and how far they are still believed in.

    Args:
        planes: per name of a piece its main plane, map frame.
        config: when a plane is seen through, and what that means.
        gone_below: belief below which a piece is gone.
        beliefs: what earlier runs believed of them; who is not named is believed in fully.
    """

    def __init__(
        self,
        planes: Mapping[str, PlanarRegion],
        config: FusionConfig,
        gone_below: float,
        beliefs: Mapping[str, float] | None = None,
    ) -> None:
        self._config = config
        self._gone_below = gone_below
        self._planes = {name: _map_plane(region, config) for name, region in planes.items()}
        known, highest = beliefs or {}, config.existence.belief_max
        self._before = {name: log_odds(known.get(name, highest)) for name in self._planes}
        self._n_through = dict.fromkeys(self._planes, 0)
        self._beliefs = {
            name: ExistenceBelief(config.existence, odds) for name, odds in self._before.items()
        }

    @property
    def doubts(self) -> dict[str, float]:
        """What is left of the belief in pieces that are less believed in than before this run."""
        return {
            name: belief.probability
            for name, belief in self._beliefs.items()
            if belief.odds < self._before[name]
        }

    def look(self, frame: SensorFrame, unseen: Iterable[str]) -> set[str]:
        """Names of pieces that turn out to be gone.

        Args:
            frame: what the camera sees now.
            unseen: names of the pieces that this run has not recognised.
        """
        gone: set[str] = set()
        T_sensor_map = frame.T_map_sensor.inverse()
        for name in unseen:
            plane = self._planes.get(name)
            if plane is None:
                continue
            view = plane.look(frame, T_sensor_map, self._config.see_through_m, None)
            if view.expected < self._config.judged_share * np.count_nonzero(plane.hits):
                continue
            shows = view.seen_through < self._config.missed_share * view.expected
            eye = frame.T_map_sensor.translation - plane.T_map_grid.translation
            self._beliefs[name].take(shows, eye.tolist())
            self._n_through[name] += not shows
            is_doubted = self._beliefs[name].probability < self._gone_below
            if is_doubted and self._n_through[name] >= _LOOKS_LEAST:
                gone.add(name)
                del self._planes[name], self._beliefs[name]
        return gone


def remembered_planes(
    furniture: Iterable[Fluent], planes: Mapping[str, Fluent]
) -> dict[str, PlanarRegion]:
    """Per name of a piece the main plane that the board has of it, where it has one.

    Args:
        furniture: open furniture fluents.
        planes: open plane fluents, by name.
    """
    found: dict[str, PlanarRegion] = {}
    for piece in furniture:
        for name in piece.values("hasMainPlane"):
            plane = planes.get(str(name))
            contours = [] if plane is None else plane.values("hasContour")
            region = _region(str(contours[-1])) if contours else None
            if region is not None:
                found[piece.name] = region
    return found


def _region(contour: str) -> PlanarRegion | None:
    """A contour as `plane_fluents` writes it, WKT in the map frame; None if it is no plane."""
    try:
        shape = shapely.from_wkt(contour)
    except shapely.errors.GEOSException:
        return None
    corners = shapely.get_coordinates(shape, include_z=True)
    if len(corners) < 4 or not np.isfinite(corners).all():
        return None
    centre = corners.mean(axis=0)
    normal: FloatArray = np.linalg.svd(corners - centre, full_matrices=False)[2][2]
    if np.abs((corners - centre) @ normal).max() > _FLAT_M:
        return None
    T_map_region = Transform.from_parts(upright_axes(normal), centre)
    flat = shapely.force_2d(shapely.transform(shape, T_map_region.inverse().apply, include_z=True))
    outline = as_multipolygon(shapely.make_valid(flat))
    return None if outline.is_empty else PlanarRegion(0, T_map_region, outline, 0, 0.0)


def _map_plane(region: PlanarRegion, config: FusionConfig) -> MapPlane:
    plane = MapPlane(0, region.T_map_region, config)
    plane.add(region, plane.cells_of(region), 1.0 / config.pose_sigma_m**2, 1, 0.0)
    plane.hits *= config.memory_frames  # a few looks through it take no cell away
    return plane
