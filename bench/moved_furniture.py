"""Furniture that is moved, swapped, added and removed between visits: what the board says of it."""

from __future__ import annotations

import math
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from bench.measuring import Report
from fluentboard.model.fluent import Fluent
from fluentboard.model.geometry import Pose, Transform
from fluentboard_client import Client, Command, EndFluent
from fluentboard_modules.demo.service_process import ServiceProcess
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.config import MappingConfig, VerificationConfig
from fluentboard_modules.mapping.evaluation import tolerance_m
from fluentboard_modules.mapping.rules import load_rules
from fluentboard_modules.mapping.trials import scene_library
from fluentboard_modules.mapping.worker import MappingModule
from fluentboard_modules.progress import FrameProgress
from fluentboard_modules.simulation.chapter3_rooms import office
from fluentboard_modules.simulation.drive import SimulatedDrive, room_drive
from fluentboard_modules.simulation.scene import Scene
from fluentboard_modules.simulation.viewpoint import kinect_camera
from fluentboard_modules.worker import run as run_worker
from fluentboard_ontology import read as read_ontology

SEEDS = (31, 32)
_FRAMES = 48
_STARTS_S = (1.0, 200.0, 400.0)
_SAME_PLACE_M = 0.3  # poses of a piece that are nearer are one place, seen better
_HIDDEN_M = 0.15


@dataclass
class _Stay:
    """A piece at a place: from one visit until before another."""

    name: str
    cls: str
    model: str
    pose: Pose
    top_m: float
    first: int
    until: int | None = None
    is_swapped: bool = False


@dataclass
class _Episode:
    """What the board says of a piece at a place."""

    piece: Fluent
    poses: list[Fluent]

    @property
    def xy(self) -> tuple[float, float]:
        last = self.poses[-1]
        return float(last.values("hasX")[0]), float(last.values("hasY")[0])


@dataclass
class _Tally:
    """Right, false and missed events of one kind, and after how many looks the right ones came."""

    right: int = 0
    false: int = 0
    missed: int = 0
    looks: list[int] = field(default_factory=list[int])


class _Told(MappingModule):
    """Mapping that notes when it told the board to end what."""

    told_s: dict[str, float]

    def process(self, frame: SensorFrame) -> Sequence[Command]:
        """What a frame changes."""
        commands = super().process(frame)
        self._note(commands, frame.stamp_s)
        return commands

    def finish(self) -> Sequence[Command]:
        """The last estimates."""
        commands = super().finish()
        self._note(commands, self.span_s[-1])
        return commands

    def _note(self, commands: Sequence[Command], stamp_s: float) -> None:
        for command in commands:
            name = command.name if isinstance(command, EndFluent) else command.fluent.name
            key = f"end {name}" if isinstance(command, EndFluent) else name
            self.told_s.setdefault(key, stamp_s)


class _Visits:
    """Drives one after the other as one source."""

    name = "simulated"

    def __init__(self, drives: Sequence[SimulatedDrive]) -> None:
        self._drives = drives

    def __len__(self) -> int:
        return sum(map(len, self._drives))

    def __iter__(self) -> Iterator[SensorFrame]:
        for drive in self._drives:
            yield from drive


def run() -> list[Report]:
    """The events of both kinds, over all seeds."""
    tallies = {"started": _Tally(), "ended": _Tally()}
    notes: Counter[str] = Counter()
    for seed in SEEDS:
        _score(seed, tallies, notes)
    lines = [
        "| event | right | false | missed | looks until told (median, most) |",
        "| --- | --- | --- | --- | --- |",
    ]
    for kind, tally in tallies.items():
        looks = f"{np.median(tally.looks):.0f}, {max(tally.looks)}" if tally.looks else "none"
        lines.append(f"| {kind} | {tally.right} | {tally.false} | {tally.missed} | {looks} |")
    note = (
        f"The office of {len(SEEDS)} seeds, three visits of {_FRAMES} frames, the worker restarted "
        "before the third. Before the second, a chair is moved, an office chair and a conference "
        "chair change places, a shelf is removed and a chair added; before the third, the table "
        "is shifted with all that lies on it, the chair is moved again, another one removed and "
        "the shelf put back. Right is an event of the right class at the right place whose "
        "interval holds the true time; false is one of what did not change, or of what was never "
        f"there. Looks are frames that have the place in view. Of {notes['moved']} moved pieces "
        f"{notes['kept']} kept their name; of {notes['swapped']} swapped ones, "
        f"which are chairs at the places of chairs before and after, {notes['seen']} are told the "
        "right model."
    )
    title = "Furniture that is moved, swapped, added and removed between visits"
    return [Report(title, "", {}, {}, notes=[note], table=lines)]


def _scenes(seed: int) -> list[Scene]:
    """The office at each visit."""
    full = office(np.random.default_rng(seed))
    first = full.without("table1Chair5")
    sitter, guest = first["desk1Chair"].pose, first["table1Chair2"].pose
    second = first.moved("table1Chair1", Pose.from_rpy(1.5, 3.6, 0.0, yaw=0.7))
    second = second.moved("desk1Chair", guest).moved("table1Chair2", sitter)
    second = second.without("shelf5").with_instances([full["table1Chair5"]])
    table = second["table1"].pose
    third = second.moved("table1", replace(table, y=table.y - 0.5))
    third = third.moved("table1Chair1", Pose.from_rpy(4.9, 1.0, 0.0, yaw=2.4))
    third = third.without("table1Chair3")
    books = [thing for thing in full.objects if thing.on == "shelf5"]
    return [first, second, third.with_instances([full["shelf5"], *books])]


def _stays(scenes: Sequence[Scene], classes: Sequence[str]) -> list[_Stay]:
    stays: list[_Stay] = []
    for visit, scene in enumerate(scenes):
        here = {thing.name: thing for thing in scene.objects if thing.cls in classes}
        for stay in stays:
            thing = here.get(stay.name)
            if stay.until is None and (thing is None or _apart_m(thing.pose, stay.pose) > 0.05):
                stay.until = visit
        known = {stay.name for stay in stays if stay.until is None}
        for name, thing in here.items():
            swapped = [
                stay
                for stay in stays
                if stay.until == visit
                and stay.cls == thing.cls
                and _apart_m(stay.pose, thing.pose) < _SAME_PLACE_M
            ]
            if swapped:  # a chair stands where a chair stood: only the model is another
                (stay,) = swapped
                stay.name, stay.model, stay.until = name, thing.model.name, None
                stay.is_swapped = True
            elif name not in known:
                top = float(thing.model.mesh.bounds[1, 2])
                stays.append(_Stay(name, thing.cls, thing.model.name, thing.pose, top, visit))
    return stays


def _score(seed: int, tallies: dict[str, _Tally], notes: Counter[str]) -> None:
    scenes = _scenes(seed)
    rules = load_rules(read_ontology("furniture"))
    classes = [furniture.name for furniture in rules.furniture_classes]
    library = scene_library(scenes[0], classes)
    stays = _stays(scenes, classes)
    drives = [
        replace(room_drive(scene, seed + k, _FRAMES, camera=kinect_camera(320)), start_s=start_s)
        for k, (scene, start_s) in enumerate(zip(scenes, _STARTS_S, strict=True))
    ]
    config = MappingConfig(verification=VerificationConfig(generic_models=False))
    told_s: dict[str, float] = {}
    with (
        tempfile.TemporaryDirectory() as folder,
        ServiceProcess(Path(folder) / "data") as service,
        Client(service.address, author="mapping") as board,
    ):
        for part in (drives[:2], drives[2:]):
            module = _Told("simulated", Transform.identity(), config, library=library, rules=rules)
            module.told_s = told_s
            run_worker(module, _Visits(part), board, progress=FrameProgress())
        episodes = [e for piece in board.fluents("Furniture") for e in _episodes(board, piece)]
    partner_of = _matched(stays, episodes)
    seen_s = _seen_s(stays, drives)
    pieces: dict[str, set[str]] = {}
    for k, stay in enumerate(stays):
        episode = partner_of.get(k)
        if episode is not None:
            pieces.setdefault(stay.name, set()).add(episode.piece.name)
        if stay.first > 0:
            _rate_start(stay, episode, seen_s[k], told_s, tallies["started"])
        _rate_end(stay, episode, seen_s[k], told_s, tallies["ended"])
        if stay.is_swapped:
            models = episode.piece.values("hasCadModel") if episode is not None else ()
            notes["swapped"] += 1
            notes["seen"] += bool(models) and str(models[-1]) == stay.model
    used = {id(episode) for episode in partner_of.values()}
    for episode in episodes:
        if id(episode) not in used and not any(_swaps(stay, episode) for stay in stays):
            tallies["started"].false += 1
    for name in ("table1", "table1Chair1"):
        notes["moved"] += 1
        notes["kept"] += len(pieces.get(name, ())) == 1


def _rate_start(
    stay: _Stay, episode: _Episode | None, seen_s: list[float], told_s: dict[str, float], to: _Tally
) -> None:
    start = None if episode is None else episode.poses[0].start
    begin_s = _STARTS_S[stay.first]
    if episode is None or start is None or start.latest is None or start.latest < begin_s:
        to.missed += 1
        return
    to.right += 1
    told = told_s.get(episode.poses[0].name, math.inf)
    to.looks.append(sum(begin_s <= s <= told for s in seen_s))


def _rate_end(
    stay: _Stay, episode: _Episode | None, seen_s: list[float], told_s: dict[str, float], to: _Tally
) -> None:
    if episode is None:
        return  # what was never found cannot end
    last = episode.poses[-1]
    if stay.until is None:
        to.false += not last.is_open
        return
    begin_s = _STARTS_S[stay.until]
    finish = last.finish
    if finish.latest is None or not (finish.earliest or 0.0) < begin_s <= finish.latest:
        to.missed += 1
        return
    to.right += 1
    told = told_s.get(f"end {last.name}", math.inf)
    to.looks.append(sum(begin_s <= s <= told for s in seen_s))


def _episodes(board: Client, piece: Fluent) -> list[_Episode]:
    """The places of a piece one after the other."""
    episodes: list[_Episode] = []
    for name in piece.values("hasPose"):
        pose = board.fluent(str(name))
        here = float(pose.values("hasX")[0]), float(pose.values("hasY")[0])
        if episodes and math.dist(here, episodes[-1].xy) < _SAME_PLACE_M:
            episodes[-1].poses.append(pose)
        else:
            episodes.append(_Episode(piece, [pose]))
    return episodes


def _matched(stays: Sequence[_Stay], episodes: Sequence[_Episode]) -> dict[int, _Episode]:
    """Per stay the episode that is meant: of its class, in its time, nearest first."""
    pairs: list[tuple[float, int, int]] = []
    for k, stay in enumerate(stays):
        begin_s = _STARTS_S[stay.first]
        end_s = math.inf if stay.until is None else _STARTS_S[stay.until]
        for i, episode in enumerate(episodes):
            if episode.piece.class_name != stay.cls:
                continue
            first, last = episode.poses[0].start.latest, episode.poses[-1].finish.earliest
            overlaps = (first or 0.0) < end_s and (last is None or last >= begin_s)
            apart = math.dist(episode.xy, (stay.pose.x, stay.pose.y))
            if overlaps and apart <= max(tolerance_m(stay.cls), _SAME_PLACE_M):
                pairs.append((apart, k, i))
    found: dict[int, int] = {}
    for _, k, i in sorted(pairs):
        if k not in found and i not in found.values():
            found[k] = i
    return {k: episodes[i] for k, i in found.items()}


def _swaps(stay: _Stay, episode: _Episode) -> bool:
    """Whether two pieces that stood at one place one after the other are told to be two."""
    is_here = math.dist(episode.xy, (stay.pose.x, stay.pose.y)) <= _SAME_PLACE_M
    return stay.is_swapped and is_here and episode.piece.class_name == stay.cls


def _seen_s(stays: Sequence[_Stay], drives: Sequence[SimulatedDrive]) -> list[list[float]]:
    """Per stay the stamps of the frames that have its place in view, whoever is there."""
    seen: list[list[float]] = [[] for _ in stays]
    for frame in _Visits(drives):
        for k, stay in enumerate(stays):
            point = np.array([[stay.pose.x, stay.pose.y, min(stay.top_m, 0.75)]])
            local = frame.T_map_sensor.inverse().apply(point)
            depth = float(local[0, 2])
            if not 0.4 < depth < 4.0:
                continue
            column, row = np.rint(frame.camera.project(local)[0]).astype(int).tolist()
            if 0 <= column < frame.camera.width and 0 <= row < frame.camera.height:
                measured = float(frame.depth_m[row, column])
                if measured > depth - _HIDDEN_M:
                    seen[k].append(frame.stamp_s)
    return seen


def _apart_m(a: Pose, b: Pose) -> float:
    return math.hypot(a.x - b.x, a.y - b.y)
