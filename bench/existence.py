"""How often frames show furniture that is there, and see through the place of what was removed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np

from bench.measuring import Report
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.existence import ExistenceBelief, log_odds
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
_GONE = MappingConfig().furniture.drop_score
_CLASSES = {"Chair", "Table", "Desk", "Shelf", "Counter", "Cabinet"}
_LEVEL, _HEIGHTS_M, _LEAST_M2 = 0.8, (0.3, 1.3), 0.06

# What a frame in which a plane should show says about it.
_SHOWN, _THROUGH, _UNNOTICED = "shown", "seen through", "unnoticed"
_CHANGES = ((0.0, 0.2), (0.2, 0.4), (0.4, 0.8), (0.8, math.inf))  # of the line of sight
_BELIEFS = (0.0, 0.05, 0.3, 0.7, 0.95, 1.0)
_OWN_LOOKS = (0.1, 0.15, 0.25, 0.35, 0.5, 1.0, 2.0)
_ALIKE = (0.15, 0.25, 0.35, 0.5, 0.75, 1.0)


@dataclass(frozen=True, slots=True)
class _Look:
    """What a frame said of a plane, from where, and in which of the two visits."""

    said: str
    eye: FloatArray
    is_second: bool


Looks = list[list[_Look]]
"""Per plane what the frames said about it, one after the other."""


def run() -> list[Report]:
    """The shares of looks, how alike they are, and whether the beliefs are right."""
    there: Looks = []
    gone: Looks = []
    for make in ROOMS.values():
        for seed in SEEDS:
            for is_gone, looks in _visits(make(np.random.default_rng(seed)), seed):
                (gone if is_gone else there).append(looks)
    return [_shares(there, gone), _reliability(there, gone)]


def _shares(there: Looks, gone: Looks) -> Report:
    steps = " | ".join(f"alike {low} to {high}" for low, high in _CHANGES)
    lines = [
        f"| furniture | planes | looks | shown | seen through | unnoticed | {steps} |",
        "| --- " * (6 + len(_CHANGES)) + "|",
    ]
    for name, looks, kind in (("there", there, _SHOWN), ("removed", gone, _THROUGH)):
        flat = [look.said for of_plane in looks for look in of_plane]
        kinds = [f"{100 * flat.count(k) / len(flat):.1f} %" for k in (_SHOWN, _THROUGH, _UNNOTICED)]
        alike = [f"{_likeness(looks, kind, *change):.2f}" for change in _CHANGES]
        cells = [name, str(len(looks)), str(len(flat)), *kinds, *alike]
        lines.append("| " + " | ".join(cells) + " |")
    best, gain = _likeliest(there)
    config = MappingConfig().furniture.fusion.existence
    note = (
        "Alike: correlation of two looks at a plane, by how far the sensor has moved between them "
        "as a share of its distance. What the looks at the planes that are there said is most "
        f"likely with shares of each view worth {best[0]} looks and a range of {best[1]}: the "
        f"logarithm of the likelihood is {gain:.0f} more than if looks were independent. The "
        f"belief uses {config.own_looks} and {config.alike}."
    )
    title = "How often frames show furniture, and see through the place of what was removed"
    return Report(title, "", {}, {}, notes=[note], table=lines)


def _reliability(there: Looks, gone: Looks) -> Report:
    config = MappingConfig().furniture.fusion.existence
    states: list[tuple[float, bool]] = []
    after: list[int] = []
    n_ended = 0
    for looks, is_there in ((there, True), (gone, False)):
        for of_plane in looks:
            second = [look for look in of_plane if look.is_second and look.said != _UNNOTICED]
            beliefs = list(_beliefs(second, ExistenceBelief(config, 0.0)))
            states += [(belief, is_there) for belief in beliefs]
            known = ExistenceBelief(config, log_odds(config.belief_max))
            ends = [k for k, belief in enumerate(_beliefs(second, known)) if belief < _GONE]
            if ends and is_there:
                n_ended += 1
            if ends and not is_there:
                after.append(ends[0] + 1)
    beliefs, truth = np.array(states).T
    lines = [
        "| belief | looks | mean belief | really there |",
        "| --- | --- | --- | --- |",
    ]
    for low, high in pairwise(_BELIEFS):
        among = (beliefs >= low) & (beliefs < high)
        if among.any():
            lines.append(
                f"| {low} to {high} | {np.count_nonzero(among)} | {beliefs[among].mean():.2f} | "
                f"{truth[among].mean():.2f} |"
            )
    n_second = sum(any(look.is_second for look in looks) for looks in there)
    note = (
        "Second visits, half of the furniture removed before: every plane is believed in with 0.5 "
        "at first, and after every look as far as the belief goes. Begun with what a first visit "
        f"leaves ({config.belief_max}), {len(after)} of {len(gone)} planes of removed pieces are "
        f"gone (below {_GONE}) after {np.median(after) if after else math.nan:.0f} looks (median), "
        f"and {n_ended} of {n_second} that are still there."
    )
    return Report(
        "Is furniture there as often as the belief says?", "", {}, {}, notes=[note], table=lines
    )


def _beliefs(looks: Sequence[_Look], belief: ExistenceBelief) -> Iterator[float]:
    for look in looks:
        if look.said != _UNNOTICED:
            belief.take(look.said == _SHOWN, look.eye.tolist())
        yield belief.probability


def _visits(scene: Scene, seed: int) -> list[tuple[bool, list[_Look]]]:
    """Two drives, every other piece removed before the second: what frames said of each plane."""
    pieces = [thing for thing in scene.objects if thing.cls in _CLASSES]
    removed = {piece.name for piece in pieces[::2]}
    emptied = scene
    for name in removed:  # with what stands on it
        emptied = emptied.without(name)
    config = MappingConfig()
    room = PlaneMap(config.furniture.fusion, config.surfaces.noise)
    owners: dict[int, str] = {}
    said: dict[tuple[int, bool], list[_Look]] = {}
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
                of_plane = said.setdefault(
                    (identifier, is_second and owners[identifier] in removed), []
                )
                eye = frame.T_map_sensor.translation - plane.T_map_grid.translation
                if identifier in seen:
                    of_plane.append(_Look(_SHOWN, eye, is_second))
                    continue
                view, fusion = views.get(identifier), config.furniture.fusion
                least = fusion.judged_share * np.count_nonzero(plane.solid)
                if view is None or view.expected < least:
                    continue
                through = view.seen_through >= fusion.missed_share * view.expected
                of_plane.append(_Look(_THROUGH if through else _UNNOTICED, eye, is_second))
    # Of joined tops one is removed and the other stays: their common plane is both.
    return [
        (is_gone, looks)
        for (_, is_gone), looks in said.items()
        if looks and (not is_gone or any(look.said == _THROUGH for look in looks))
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


def _likeness(looks: Looks, kind: str, least: float, most: float) -> float:
    """Correlation of two looks at a plane between which the line of sight changed by so much."""
    mean = float(np.mean([look.said == kind for of_plane in looks for look in of_plane]))
    products = [
        ((a.said == kind) - mean) * ((b.said == kind) - mean)
        for of_plane in looks
        for a, b in combinations(of_plane, 2)
        if least <= _change(a.eye, b.eye) < most
    ]
    return float(np.mean(products)) / max(mean * (1.0 - mean), 1e-9) if products else math.nan


def _likeliest(looks: Looks) -> tuple[tuple[float, float], float]:
    """Own looks and range that make looks most likely, and by how much against independent ones."""
    flat = [look.said for of_plane in looks for look in of_plane]
    shares = {kind: flat.count(kind) / len(flat) for kind in set(flat)}
    found: dict[tuple[float, float], float] = {}
    for alike in _ALIKE:
        terms: list[tuple[float, float, float]] = []
        for of_plane in looks:
            for k, look in enumerate(of_plane):
                weights = [math.exp(-_change(x.eye, look.eye) / alike) for x in of_plane[:k]]
                same = [w for w, x in zip(weights, of_plane, strict=False) if x.said == look.said]
                terms.append((shares[look.said], sum(same), sum(weights)))
        share, same, every = np.array(terms).T
        for own in _OWN_LOOKS:
            found[own, alike] = float(np.log((own * share + same) / (own + every)).sum())
    best = max(found, key=lambda key: found[key])
    return best, found[best] - sum(math.log(shares[said]) for said in flat)


def _change(a: FloatArray, b: FloatArray) -> float:
    return float(np.linalg.norm(a - b) / min(np.linalg.norm(a), np.linalg.norm(b)))
