"""Where the front of a piece begins, of which a side is in sight.

Who looks along a row of shelves sees the side of the last one as one large plane, and of the fronts
only slivers between books. The side is as wide as the piece is deep, so the front begins at the end
of it that is on the viewer's side.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from shapely.geometry import MultiPolygon, box

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.planar_region import PlanarRegion, upright_axes

_SLACK_M = 0.1  # how much deeper than the model what is seen of its side may be


def fronts_beside(side: PlanarRegion, model: CadModel) -> list[PlanarRegion]:
    """The fronts that a model would have whose side a plane is.

    Args:
        side: an upright plane in the map frame.
        model: of the piece.

    Returns:
        None, one or two regions as high as the side and as wide as the model, each facing the
        sensor: there is none if the plane is deeper than the model or only its back is in sight.
    """
    low, high = model.mesh.bounds
    depth, width = (high - low)[:2].tolist()
    corners = side.outline_map()
    outward = side.normal * np.array([1.0, 1.0, 0.0])
    outward = outward / max(float(np.linalg.norm(outward)), 1e-9)
    along = np.array([-outward[1], outward[0], 0.0])
    reach = corners @ along
    bottom, top = float(corners[:, 2].min()), float(corners[:, 2].max())
    if np.ptp(reach) > depth + _SLACK_M or top > float(high[2]) + _SLACK_M:
        return []
    foot = side.centroid - along * float(side.centroid @ along)
    fronts: list[PlanarRegion] = []
    for normal, end in ((along, float(reach.max())), (-along, float(reach.min()))):
        middle = foot + along * end - 0.5 * width * outward
        middle[2] = 0.5 * (bottom + top)
        if float((side.sensor_position - middle) @ normal) <= 0.0:
            continue
        fronts.append(_front(side, middle, normal, width, top - bottom))
    return fronts


def _front(
    side: PlanarRegion, middle: FloatArray, normal: FloatArray, width: float, height: float
) -> PlanarRegion:
    contour = MultiPolygon([box(-0.5 * width, -0.5 * height, 0.5 * width, 0.5 * height)])
    T_map_region = Transform.from_parts(upright_axes(normal), middle)
    return replace(side, T_map_region=T_map_region, contour=contour)
