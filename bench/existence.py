"""How often frames show furniture that is there, and see through the place of what was removed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from bench.measuring import Report
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.plane_grid import MapPlane
from fluentboard_modules.mapping.plane_map import PlaneMap
from fluentboard_modules.mapping.surfaces import detect_regions
from fluentboard_modules.simulation.chapter3_rooms import office, seminar_room
from fluentboard_modules.simulation.drive import room_drive
from fluentboard_modules.simulation.restaurant import restaurant
from fluentboard_modules.simulation.scene import Instance, Scene
from fluentboard_modules.simulation.viewpoint import kinect_camera

ROOMS = {"office": office, "seminar room": seminar_room, "restaurant": restaurant}
SEEDS = (41, 42)
_FRAMES = 48
_CLASSES = {"Chair", "Table", "Desk", "Shelf", "Counter", "Cabinet"}
_LEVEL, _HEIGHTS_M, _LEAST_M2 = 0.8, (0.3, 1.3), 0.06

# What a frame in which a plane should show says about it.
_SHOWN, _THROUGH, _UNNOTICED = "shown", "seen through", "unnoticed"
Looks = list[list[str]]
"""Per plane what the frames said about it, one after the other."""


def run() -> list[Report]:
    """The rates of single looks, how alike successive ones are, and what follows for the belief."""
    there: Looks = []
    gone: Looks = []
    for make in ROOMS.values():
        for seed in SEEDS:
            for is_gone, looks in _visits(make(np.random.default_rng(seed)), seed):
                (gone if is_gone else there).append(looks)
    rows = {"there": _rates(there), "removed": _rates(gone)}
    lines = [
        "| furniture | planes | looks | shown | seen through | unnoticed | successive alike |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for (name, rates), looks in zip(rows.items(), (there, gone), strict=True):
        alike = _likeness(looks, _SHOWN if name == "there" else _THROUGH)
        shares = " | ".join(f"{100 * rates[k]:.1f} %" for k in (_SHOWN, _THROUGH, _UNNOTICED))
        lines.append(f"| {name} | {len(looks)} | {sum(map(len, looks))} | {shares} | {alike:.2f} |")
    return [
        Report(
            "How often frames show furniture, and see through the place of what was removed",
            "",
            {},
            {},
            notes=[_meaning(there, gone, rows)],
            table=lines,
        )
    ]


def _visits(scene: Scene, seed: int) -> list[tuple[bool, list[str]]]:
    """Two drives, every other piece removed before the second: what frames said of each plane."""
    pieces = [thing for thing in scene.objects if thing.cls in _CLASSES]
    removed = {piece.name for piece in pieces[::2]}
    emptied = scene
    for name in removed:  # with what stands on it
        emptied = emptied.without(name)
    config = MappingConfig()
    room = PlaneMap(config.furniture.fusion, config.surfaces.noise)
    owners: dict[int, str] = {}
    said: dict[tuple[int, bool], list[str]] = {}
    first = room_drive(scene, seed, _FRAMES, camera=kinect_camera(320))
    for drive, is_second in ((first, False), (replace(first, scene=emptied, start_s=1e3), True)):
        for frame in drive:
            _, views = room.update(frame, detect_regions(frame, config.surfaces))
            seen = room.planes_seen_last
            for identifier, plane in room.planes.items():
                if not is_second and identifier not in owners and plane.n_frames >= 2:
                    owner = _owner(plane, pieces)
                    if owner is not None:
                        owners[identifier] = owner
                if identifier not in owners:
                    continue
                is_gone = is_second and owners[identifier] in removed
                if identifier in seen:
                    said.setdefault((identifier, is_gone), []).append(_SHOWN)
                    continue
                view, fusion = views.get(identifier), config.furniture.fusion
                least = fusion.judged_share * np.count_nonzero(plane.solid)
                if view is None or view.expected < least:
                    continue
                through = view.seen_through >= fusion.missed_share * view.expected
                said.setdefault((identifier, is_gone), []).append(
                    _THROUGH if through else _UNNOTICED
                )
    # Of joined tops one is removed and the other stays: their common plane is both.
    return [
        (is_gone, looks) for (_, is_gone), looks in said.items() if not is_gone or _THROUGH in looks
    ]


def _owner(plane: MapPlane, pieces: Sequence[Instance]) -> str | None:
    """The piece of furniture whose top or seat a plane is."""
    region = plane.region(plane.identifier)
    if region is None or region.contour.is_empty or abs(region.normal[2]) < _LEVEL:
        return None
    low, high = _HEIGHTS_M
    if region.area_m2 < _LEAST_M2 or not low < region.height_m < high:
        return None
    for piece in pieces:
        local = piece.box.pose.to_transform().inverse().apply(region.centroid[None])[0]
        if (np.abs(local) <= 0.5 * piece.box.sizes + 0.03).all():
            return piece.name
    return None


def _rates(looks: Looks) -> dict[str, float]:
    flat = [said for of_plane in looks for said in of_plane]
    return {kind: flat.count(kind) / max(len(flat), 1) for kind in (_SHOWN, _THROUGH, _UNNOTICED)}


def _likeness(looks: Looks, kind: str) -> float:
    """Correlation of successive looks at a plane."""
    long = [np.array([said == kind for said in of_plane], float) for of_plane in looks]
    mean = float(np.concatenate(long).mean())
    products = [(a - mean) * (b - mean) for of_plane in long for a, b in pairwise(of_plane)]
    return float(np.mean(products)) / max(mean * (1.0 - mean), 1e-9)


def _meaning(there: Looks, gone: Looks, rows: Mapping[str, Mapping[str, float]]) -> str:
    """What an independent look is worth, and what one look of a drive is."""
    n_gone = sum(map(len, gone))
    # A share that was never seen may be as large as 3 / n (95 %).
    never = 3.0 / max(n_gone, 1)
    shown = math.log(rows["there"][_SHOWN] / max(rows["removed"][_SHOWN], never))
    through = math.log(rows["removed"][_THROUGH] / max(rows["there"][_THROUGH], 1e-3))
    worth = [
        (1.0 - alike) / (1.0 + alike)
        for alike in (_likeness(there, _SHOWN), _likeness(gone, _THROUGH))
    ]
    config = MappingConfig().furniture.fusion.existence
    d, f = config.detection_rate, config.false_alarm_rate
    return (
        f"An independent look would change the log-odds by {shown:.1f} (shown) or {through:.1f} "
        f"(seen through). Successive looks of a drive are alike, so that one counts for "
        f"{worth[0]:.2f} or {worth[1]:.2f} of an independent one: {shown * worth[0]:.2f} and "
        f"{through * worth[1]:.2f}. The rates of the belief ({d} and {f}) stand for "
        f"{math.log(d / f):.2f} and {math.log((1.0 - f) / (1.0 - d)):.2f}."
    )
