"""Where a CAD model may stand so that its main face covers a plane that was seen."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from shapely.geometry import Polygon

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.alignment import Standing
from fluentboard_modules.mapping.cad_models import ROUND, CadModel
from fluentboard_modules.mapping.config import VerificationConfig
from fluentboard_modules.mapping.hypotheses import FurnitureGeometry
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.refinement import Heading

_HEIGHT_REACH_M = 0.08  # the model's main face is so near the plane's height
_SQUARE_M = 0.05  # a face whose sides differ by less may as well be turned by a quarter
_ROW_MAX = 12  # models side by side
_START_STEP_M = 0.35  # ICP bridges 0.25 m
_LEVEL = 0.7  # of a normal's z
_INSIDE_BOARDS = 3  # level planes: more than a top and what lies behind it
_INDEPENDENT_SHARE = 0.02  # neighbouring pixels err alike
_LEAST_HEADING_RAD = 0.0015  # planes bend and poses drift
_BACK_M = 0.08  # from the back of a chair's backrest to its front


def possible_starts(
    model: CadModel,
    geometry: FurnitureGeometry,
    parts: Sequence[PlanarRegion],
    config: VerificationConfig,
) -> list[Standing]:
    """Where a model may stand so that its main face covers the main plane; the likeliest first.

    Of a face that was seen in part, any part may have been seen: it is tried in the middle, at
    both ends of what is left, and in steps between. Empty if the plane is larger than the face.
    """
    fit = _face_and_plane(model, geometry, parts)
    if fit is None:
        return []
    first: list[Standing] = []
    others: list[Standing] = []
    for turn in fit.turns:
        sizes = fit.sizes(turn)
        if (fit.seen > fit.largest(turn) + config.size_slack_m).any():
            continue
        slack = np.maximum(sizes - fit.seen, 0.0)
        steps = [_offsets(s) for s in slack.tolist()]
        for offset in itertools.product(*steps):
            place = _standing(fit.face, fit.middle + offset, fit.yaw, turn)
            (first if offset == (0.0, 0.0) else others).append(place)
    places = first + others
    if model.holds_things and sum(abs(part.normal[2]) > _LEVEL for part in parts) >= _INSIDE_BOARDS:
        return [place for place in places if _is_open_to(place, model, parts)] or places
    return places


def _is_open_to(place: Standing, model: CadModel, parts: Sequence[PlanarRegion]) -> bool:
    """Whether those who saw the boards stood before the front: no one sees through a back."""
    eyes = np.mean([part.sensor_position for part in parts], axis=0)
    ahead = place.transform.inverse().apply(eyes[None])[0, 0]
    return bool(ahead > model.mesh.bounds[1, 0])


def heading_of(geometry: FurnitureGeometry, parts: Sequence[PlanarRegion]) -> Heading | None:
    """Which way a piece with a backrest faces, and how exactly that plane says so.

    Args:
        geometry: where the hypothesis puts the piece.
        parts: its planes, the main plane first.
    """
    if geometry.back_plane is None:
        return None
    backs = [part for part in parts if abs(part.normal[2]) < _LEVEL]
    if not backs:
        return None
    back = backs[0]
    spread = back.extents_m[0] / np.sqrt(12.0)
    independent = max(_INDEPENDENT_SHARE * back.n_points, 1.0)
    sigma = back.rms_m / max(spread * np.sqrt(independent), 1e-6)
    return Heading(
        geometry.pose.yaw_rad,
        float(np.hypot(sigma, _LEAST_HEADING_RAD)),
        geometry.may_be_reversed,
    )


def covered_share(model: CadModel, place: Standing, plane: PlanarRegion) -> float:
    """How much of a model's level face near a plane's height the plane covers, in [0, 1]."""
    face = model.top_faces(plane.height_m, _HEIGHT_REACH_M)
    if face is None:
        return 0.0
    (x_low, y_low), (x_high, y_high) = face.tolist()
    corners = np.array([[x_low, y_low], [x_high, y_low], [x_high, y_high], [x_low, y_high]])
    outline = place.transform.apply(np.column_stack([corners, np.zeros(4)]))[:, :2]
    polygon = Polygon(outline)
    covered = plane.footprint().buffer(0.0).intersection(polygon)
    return float(covered.area / max(polygon.area, 1e-9))


def quarter_turns(place: Standing, model: CadModel) -> list[Standing]:
    """A place and, about the middle of the model's footprint, its quarter turns that look unlike.

    The place itself comes first.
    """
    middle = model.mesh.bounds[:, :2].mean(axis=0)
    quarters = {ROUND: 1, 4: 1, 2: 2}.get(model.symmetry_order, 4)
    places: list[Standing] = []
    for quarter in range(quarters):
        turn = 0.5 * np.pi * quarter
        dx, dy = middle - _turned(middle, turn)
        places.append(place.moved(float(dx), float(dy), turn))
    return places


def _offsets(slack_m: float) -> list[float]:
    """Where along one axis what was seen may lie on the face: middle, ends, and steps between."""
    if slack_m < 0.1:
        return [0.0]
    halves = max(1, int(np.ceil(0.5 * slack_m / _START_STEP_M)))
    steps = np.arange(-halves, halves + 1) * 0.5 * slack_m / halves
    return sorted(steps.tolist(), key=abs)


def possible_rows(
    model: CadModel,
    geometry: FurnitureGeometry,
    parts: Sequence[PlanarRegion],
    config: VerificationConfig,
) -> list[list[Standing]]:
    """Ways to put several models side by side so that their faces cover the main plane.

    The row begins at one end of the plane or the other, or is centred on it.
    """
    fit = _face_and_plane(model, geometry, parts)
    if fit is None:
        return []
    rows: list[list[Standing]] = []
    for turn in fit.turns:
        sizes = fit.sizes(turn)
        for counts in _row_counts(fit.seen, sizes):
            total = sizes * counts
            # Neither across the row nor along it is the plane larger than the faces.
            if (fit.seen > total + 2.0 * config.size_slack_m).any():
                continue
            spare = np.where(np.array(counts) > 1, 0.5 * (total - fit.seen), 0.0)
            sides = (0.0, -1.0, 1.0) if np.abs(spare).max() > 0.03 else (0.0,)
            steps = [(np.arange(n) - 0.5 * (n - 1)) * s for n, s in zip(counts, sizes, strict=True)]
            rows += [
                [
                    _standing(fit.face, fit.middle + side * spare + offset, fit.yaw, turn)
                    for offset in itertools.product(*steps)
                ]
                for side in sides
            ]
    return rows


def _row_counts(seen: FloatArray, sizes: FloatArray) -> list[tuple[int, int]]:
    """How many faces along each axis may make up what was seen, at least two in all."""
    choices: list[list[int]] = []
    for length, size in zip(seen.tolist(), sizes.tolist(), strict=True):
        ratio = length / size if size > _BACK_M else 1.0
        choices.append(sorted({max(int(np.floor(ratio + 0.1)), 1), max(int(np.ceil(ratio)), 1)}))
    counts = [(x, y) for x in choices[0] for y in choices[1]]
    return [(x, y) for x, y in counts if 2 <= x * y <= _ROW_MAX]


@dataclass(frozen=True, slots=True)
class _Fit:
    """A model's main face `(2, 2)` and the plane it may be: along axes turned by `yaw`."""

    face: FloatArray
    seen: FloatArray
    middle: FloatArray
    yaw: float
    turns: tuple[float, ...]

    def sizes(self, turn: float) -> FloatArray:
        """`(2,)`; the face's sides along the axes of the hypothesis, if it is turned so."""
        sides = self.face[1] - self.face[0]
        return sides[::-1] if abs(np.sin(turn)) > 0.5 else sides

    def largest(self, turn: float) -> FloatArray:
        """`(2,)`; the same, or the longer side twice: a square tells no turn from another."""
        sizes = self.sizes(turn)
        return np.full(2, sizes.max()) if np.ptp(sizes) < _SQUARE_M else sizes


def _face_and_plane(
    model: CadModel, geometry: FurnitureGeometry, parts: Sequence[PlanarRegion]
) -> _Fit | None:
    main = parts[0]
    yaw = geometry.pose.yaw_rad
    if geometry.main_side != "top":
        (x_back, *_), (x_front, *_) = model.mesh.bounds.tolist()
        face = model.mesh.bounds[:, :2].copy()
        # The backs of chairs recline, so they fill a little depth.
        face[:, 0] = (x_back, x_back + _BACK_M) if geometry.main_side == "back" else x_front
        bottom, top = main.bounds_map()[0][2], main.bounds_map()[1][2]
        if top > model.mesh.bounds[1, 2] + _HEIGHT_REACH_M or bottom < -_HEIGHT_REACH_M:
            return None
        low, high = _extent_along(main.outline_map(), yaw)
    else:
        found = model.top_faces(main.height_m, _HEIGHT_REACH_M)
        if found is None:
            return None
        face = found
        low, high = _extent_along(main.outline_map(), yaw)
    if geometry.may_be_reversed:
        turns: tuple[float, ...] = (0.0, np.pi)
    else:  # a backrest or a front may have said where it faces
        turns = (0.0,) if geometry.back_plane is not None else _turns(model, face)
    return _Fit(face, high - low, 0.5 * (low + high), yaw, turns)


def _standing(face: FloatArray, middle: FloatArray, yaw: float, turn: float) -> Standing:
    """The model's face, turned, with its middle at a point given along the hypothesis's axes."""
    heading = yaw + turn
    target = _turned(middle, yaw)
    own = _turned(0.5 * (face[0] + face[1]), heading)
    x, y = target - own
    return Standing(float(x), float(y), float(np.arctan2(np.sin(heading), np.cos(heading))))


def _turned(point: FloatArray, angle: float) -> FloatArray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * point[0] - s * point[1], s * point[0] + c * point[1]])


def _extent_along(points: FloatArray, yaw: float) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest `(2,)` of points along axes turned by yaw about the map's origin."""
    c, s = np.cos(yaw), np.sin(yaw)
    turned = points[:, :2] @ np.array([[c, -s], [s, c]])
    return turned.min(axis=0), turned.max(axis=0)


def _turns(model: CadModel, face: FloatArray) -> tuple[float, ...]:
    """Headings relative to the hypothesis that do not look alike; longer side along x first."""
    order = model.symmetry_order
    if order == ROUND:
        return (0.0,)
    quarter = 0.5 * np.pi
    size = face[1] - face[0]
    base = 0.0 if size[0] >= size[1] else -quarter
    if order == 4:
        return (base,)
    turns = [base, base + quarter]
    if order != 2:
        turns = [base, base + 2.0 * quarter, base + quarter, base - quarter]
    return tuple(float(t) for t in turns)
