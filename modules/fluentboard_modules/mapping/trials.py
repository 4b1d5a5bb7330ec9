"""Trials of Section 3.3.1: a room, single frames or all of them; what was found, how fast."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from fluentboard_modules.frames.sensor_frame import FrameSource, SensorFrame
from fluentboard_modules.mapping.cad_library import CadLibrary, library_of
from fluentboard_modules.mapping.candidates import Candidate
from fluentboard_modules.mapping.cloud_regions import regions_of_cloud
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.depth_views import ViewMemory, thin_view
from fluentboard_modules.mapping.floor import sloping_floor
from fluentboard_modules.mapping.furniture_item import FurnitureItem
from fluentboard_modules.mapping.furniture_map import FurnitureMap
from fluentboard_modules.mapping.judge import FurnitureJudge
from fluentboard_modules.mapping.presence import Onlooker
from fluentboard_modules.mapping.protocol import Detection, Row, TrueObject, rate, totals
from fluentboard_modules.mapping.rules import FurnitureRules
from fluentboard_modules.mapping.single_frame import SceneFindings, find_furniture
from fluentboard_modules.mapping.surfaces import detect_regions
from fluentboard_modules.mapping.voxel_cloud import SceneCloud
from fluentboard_modules.simulation.scene import Scene

Mode = Literal["frames", "map", "scene"]
MODES: tuple[Mode, ...] = ("frames", "map", "scene")


@dataclass
class Trial:
    """What came out.

    Attributes:
        rows: the rows of Table 3.1, by CAD model, and `total`.
        scores: of all hypotheses that were verified, each with whether it was true.
        seconds: of processor time per stage, of a frame or of the whole scene: the stages of
            Table 3.2.
        n_frames: that were looked at.
        strict_rows: of single frames, if everything is expected that fills a hundredth of the
            image, however little of it that is.
    """

    rows: dict[str, Row]
    scores: list[tuple[float, bool]] = field(default_factory=list[tuple[float, bool]])
    seconds: dict[str, float] = field(default_factory=dict[str, float])
    n_frames: int = 0
    strict_rows: dict[str, Row] = field(default_factory=dict[str, Row])


def true_objects(scene: Scene, library: CadLibrary) -> list[TrueObject]:
    """The pieces of a simulated scene that there are models of."""
    found: list[TrueObject] = []
    for instance in scene.objects:
        model = library.named(instance.model.name)
        if model is not None:
            found.append(
                TrueObject(
                    instance.name,
                    instance.cls,
                    model.name,
                    instance.pose,
                    model.symmetry_order,
                )
            )
    return found


def scene_library(scene: Scene, classes: Sequence[str]) -> CadLibrary:
    """The CAD models of the furniture in a simulated scene, as the thesis had them."""
    return library_of(thing.model for thing in scene.objects if thing.cls in classes)


def run_trial(
    source: FrameSource,
    scene: Scene,
    mode: Mode,
    rules: FurnitureRules,
    library: CadLibrary,
    config: MappingConfig,
) -> Trial:
    """Finds the furniture of a simulated room and compares it with what is there.

    Args:
        source: frames with labels.
        scene: what they show.
        mode: `frames`: each by itself; `map`: all, one after the other, with memory; `scene`: all
            registered into one cloud and classified once.
        rules: the furniture ontology.
        library: CAD models.
        config: of all steps.
    """
    true = true_objects(scene, library)
    clock = _Stopwatch()
    frames = iter(source)
    if mode == "frames":
        return _frames(frames, scene, true, rules, library, config, clock)
    if mode == "map":
        return _map(frames, true, rules, library, config, clock)
    return _scene(frames, true, rules, library, config, clock)


def _frames(
    frames: Iterator[SensorFrame],
    scene: Scene,
    true: list[TrueObject],
    rules: FurnitureRules,
    library: CadLibrary,
    config: MappingConfig,
    clock: _Stopwatch,
) -> Trial:
    models = [model for one in true if (model := library.named(one.model)) is not None]
    onlooker = Onlooker(scene, [one.name for one in true], models)
    looks: list[Mapping[str, Row]] = []
    strict_looks: list[Mapping[str, Row]] = []
    scores: list[tuple[float, bool]] = []
    for frame in frames:
        with clock("surfaces"):
            regions = detect_regions(frame, config.surfaces)
        with clock("classification"):
            rules.classify(regions, explain=False)
        with clock("verification"):
            view = thin_view(frame, config.surfaces.noise)
            found = find_furniture(regions, [view], rules, library, config)
        sights = onlooker.look(frame)
        present = [one for one in true if sights[one.name].is_hint]
        expected = {one.name for one in true if sights[one.name].is_expected}
        large = {one.name for one in true if sights[one.name].is_large}
        looks.append(rate(detections(found.furniture), present, expected))
        strict_looks.append(rate(detections(found.furniture), present, large))
        scores += _scores(found, true)
    clock.seconds["verification"] -= clock.seconds["classification"]  # done there once more
    return Trial(totals(looks), scores, clock.per(len(looks)), len(looks), totals(strict_looks))


def _map(
    frames: Iterator[SensorFrame],
    true: list[TrueObject],
    rules: FurnitureRules,
    library: CadLibrary,
    config: MappingConfig,
    clock: _Stopwatch,
) -> Trial:
    noise = config.surfaces.noise
    judge = FurnitureJudge(library, config.verification, noise)
    room = FurnitureMap(rules, config.furniture, noise, judge)
    n_frames = 0
    for frame in frames:
        with clock("surfaces"):
            regions = detect_regions(frame, config.surfaces)
        with clock("classification and verification"):
            room.update(frame, regions)
        n_frames += 1
    with clock("classification and verification"):
        room.settle()
    rows = totals([rate(detections(room.furniture()), true, {one.name for one in true})])
    return Trial(rows, [], clock.per(max(n_frames, 1)), n_frames)


def _scene(
    frames: Iterator[SensorFrame],
    true: list[TrueObject],
    rules: FurnitureRules,
    library: CadLibrary,
    config: MappingConfig,
    clock: _Stopwatch,
) -> Trial:
    cloud = SceneCloud(config.surfaces.cloud.voxel_m)
    views = ViewMemory(config.surfaces.noise)
    n_frames = 0
    for frame in frames:
        with clock("surfaces"):
            near = frame.valid & (frame.depth_m <= config.surfaces.range_max_m)
            cloud.add(frame.points_map()[near], frame.T_map_sensor.translation)
        views.add(frame)
        n_frames += 1
    with clock("surfaces"):
        regions = regions_of_cloud(cloud.voxels(), config.surfaces.cloud, config.surfaces.contours)
    with clock("classification"):
        floor = sloping_floor(regions, config.furniture.floor_reach_m)
        rules.classify(regions, floor=floor, explain=False)
    with clock("verification"):
        found = find_furniture(regions, views.since(), rules, library, config, floor)
    clock.seconds["verification"] -= clock.seconds["classification"]
    rows = totals([rate(detections(found.furniture), true, {one.name for one in true})])
    return Trial(rows, _scores(found, true), clock.per(1), n_frames)


def detections(found: Sequence[Candidate] | Sequence[FurnitureItem]) -> list[Detection]:
    """What the protocol needs of the pieces that a CAD model explains."""
    fits = [piece.cad if isinstance(piece, FurnitureItem) else piece.fit for piece in found]
    return [
        Detection(fit.model, fit.pose, fit.initial_pose, fit.score)
        for fit in fits
        if fit is not None
    ]


def _scores(found: SceneFindings, true: Sequence[TrueObject]) -> list[tuple[float, bool]]:
    """The score of every verified hypothesis, and whether an object of that model is there.

    What is judged near an object after that was found has to explain what is left of the images: it
    is no test of the score either way, and left out.
    """
    scores: list[tuple[float, bool]] = []
    taken: set[str] = set()
    for judged in found.judged:
        at, model = judged.verdict.standing, judged.verdict.model.name
        near = {
            one.name
            for one in true
            if one.model == model
            and np.hypot(at.x - one.pose.x, at.y - one.pose.y) <= one.tolerance_m
        }
        if near & taken:
            continue
        if judged.verdict.is_accepted:
            taken |= near
        scores.append((judged.verdict.score, bool(near)))
    return scores


class _Stopwatch:
    """Adds up the time of each stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._stage = ""
        self._begin = 0.0

    def __call__(self, stage: str) -> _Stopwatch:
        self._stage = stage
        return self

    def __enter__(self) -> None:
        self._begin = time.process_time()

    def __exit__(self, *_: object) -> None:
        spent = time.process_time() - self._begin
        self.seconds[self._stage] = self.seconds.get(self._stage, 0.0) + spent

    def per(self, count: int) -> dict[str, float]:
        """The seconds of each stage divided by a number."""
        return {stage: seconds / max(count, 1) for stage, seconds in self.seconds.items()}
