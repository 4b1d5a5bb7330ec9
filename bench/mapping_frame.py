"""Where the time of one mapping frame goes, and what Pellet would take for its classification."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from typing import TypeVar

from bench.measuring import Report
from fluentboard_modules.frames.sources import open_source
from fluentboard_modules.mapping.cad_library import CadLibrary
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.furniture_map import FurnitureMap
from fluentboard_modules.mapping.judge import Case, FurnitureJudge
from fluentboard_modules.mapping.normals import fit_local_planes
from fluentboard_modules.mapping.pellet import PelletReasoner
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.rules import FurnitureRules, load_rules
from fluentboard_modules.mapping.segments import make_cells, segment_planes
from fluentboard_modules.mapping.surfaces import detect_regions
from fluentboard_ontology import read

_FRAMES = 40
_WARM_UP = 2  # compiles, reads caches
_PELLET_FRAMES = 8
_THESIS_S = 6.53 + 1.02 + 1.53
Result = TypeVar("Result")


class _TimedJudge(FurnitureJudge):
    """Knows how long it has verified."""

    spent_s = 0.0

    def consider(self, cases: Sequence[Case], *, all_of_them: bool = False) -> None:
        begin = time.process_time()
        super().consider(cases, all_of_them=all_of_them)
        self.spent_s += time.process_time() - begin


class _Stages:
    """Processor seconds of each stage, frame by frame."""

    def __init__(self) -> None:
        self.seconds: dict[str, list[float]] = {}

    def time(self, stage: str, work: Callable[[], Result]) -> Result:
        begin = time.process_time()
        result = work()
        self.note(stage, time.process_time() - begin)
        return result

    def note(self, stage: str, seconds: float) -> None:
        self.seconds.setdefault(stage, []).append(seconds)

    def last(self, stage: str) -> float:
        return self.seconds[stage][-1]


def run() -> list[Report]:
    """The stages of a frame of 640x480 pixels, and Pellet against the compiled rules."""
    config = MappingConfig()
    rules = load_rules(read("furniture"))
    noise, step_px = config.surfaces.noise, config.surfaces.segmentation.step_px
    judge = _TimedJudge(CadLibrary(), config.verification, noise)
    room = FurnitureMap(rules, config.furniture, noise, judge)
    stages, planes = _Stages(), list[list[PlanarRegion]]()
    for number, frame in enumerate(open_source(f"sim:restaurant?frames={_FRAMES}")):
        if number == _WARM_UP:
            stages = _Stages()
        local = stages.time(
            "local planes",
            lambda f=frame: fit_local_planes(
                f.depth_m, f.camera, config.surfaces.normals, noise, step_px
            ),
        )
        cells = make_cells(local, frame.camera, noise, config.surfaces.range_max_m, step_px)
        stages.time("segments", lambda c=cells: segment_planes(c, config.surfaces.segmentation))
        regions = stages.time("surfaces", lambda f=frame: detect_regions(f, config.surfaces))
        stages.note(
            "contours, merging",
            stages.last("surfaces") - stages.last("local planes") - stages.last("segments"),
        )
        classified = stages.time(
            "classification of the frame", lambda r=regions: rules.classify(r, explain=False)
        )
        before = judge.spent_s
        stages.time("update", lambda f=frame, r=regions, c=classified: room.update(f, r, c))
        stages.note("verification", judge.spent_s - before)
        stages.note(
            "memory: planes of the map and their classification",
            stages.last("update") - stages.last("verification"),
        )
        stages.note(
            "whole frame",
            stages.last("surfaces")
            + stages.last("classification of the frame")
            + stages.last("update"),
        )
        planes.append(regions)
    whole = sorted(stages.seconds["whole frame"])
    shown = {
        stage: 1e3 * statistics.median(seconds)
        for stage, seconds in stages.seconds.items()
        if stage not in ("surfaces", "update")
    }
    return [
        Report(
            "Mapping of one frame of 640x480 pixels",
            "ms",
            shown,
            {},
            "at most 500 ms on two cores, and a fourteenth of the thesis's time",
            [
                f"Processor time, {len(whole)} frames of a simulated drive, one "
                "thread; the "
                f"slowest {1e3 * whole[-1]:.0f} ms. The thesis took {_THESIS_S:.2f} s per cloud "
                "on its own computer and data."
            ],
        ),
        _reasoners(rules, planes[_WARM_UP : _WARM_UP + _PELLET_FRAMES]),
    ]


def _reasoners(rules: FurnitureRules, planes: Sequence[list[PlanarRegion]]) -> Report:
    """The same frames classified by Pellet, warm, and by the compiled rules."""
    reasoner = PelletReasoner(rules.rules)
    by_pellet = FurnitureRules(rules.rules, reasoner)
    by_pellet.classify(planes[0], explain=False)  # starts Java
    seconds: dict[str, list[float]] = {"compiled rules": [], "Pellet, warm": []}
    for regions in planes:
        answers: list[object] = []
        for name, classifier in (("compiled rules", rules), ("Pellet, warm", by_pellet)):
            begin = time.perf_counter()
            answers.append(classifier.classify(regions, explain=False))
            seconds[name].append(time.perf_counter() - begin)
        if answers[0] != answers[1]:
            raise SystemExit("Pellet and the compiled rules disagree")
    reasoner.close()
    ours, pellet = seconds.values()
    return Report(
        f"Classification of the planes of a frame ({sum(map(len, planes)) / len(planes):.0f})",
        "ms",
        {name: 1e3 * statistics.median(times) for name, times in seconds.items()},
        {"Pellet, warm": statistics.median(p / o for p, o in zip(pellet, ours, strict=True))},
        notes=["Pellet runs in a warm process of its own; both find the same classes."],
    )
