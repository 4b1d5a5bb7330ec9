"""A whole step of anchoring without recognition: milliseconds of one thread per frame, by stage."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from bench.measuring import Report
from fluentboard_modules.anchoring.config import AnchoringConfig
from fluentboard_modules.anchoring.geometric import GeometricRecogniser
from fluentboard_modules.anchoring.organised import organise
from fluentboard_modules.anchoring.pipeline import AnchoringPipeline
from fluentboard_modules.anchoring.similarity import load_mismatch
from fluentboard_modules.anchoring.supports import find_tops
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.frames.sources import open_source
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.map_frame import place
from fluentboard_modules.simulation.table_scenes import table_scene_drive

TARGET_MS = 50.0
TABLES = ((1, 7), (1, 11))
"""Seed and number of the simulated tables; their scenes have about ten objects."""

_WARM_UP = 4  # frames that compile, and that find the first tops


def run() -> list[Report]:
    """Simulated tables, and the kitchen of 7-Scenes where `FLUENTBOARD_SHARED_DATA` has it."""
    reports = [
        step_report("simulated tables", [table_scene_drive(n, seed, 40) for seed, n in TABLES])
    ]
    kitchen = Path(os.environ.get("FLUENTBOARD_SHARED_DATA", "")) / "redkitchen"
    if kitchen.is_dir():
        source, _ = place(open_source(str(kitchen)), MappingConfig())
        reports.append(step_report("a real kitchen (7-Scenes)", [source]))
    return reports


def step_report(name: str, sources: Sequence[Iterable[SensorFrame]]) -> Report:
    """Medians over the frames that show a top."""
    config = AnchoringConfig()
    stages: dict[str, list[float]] = {}
    wall: list[float] = []
    objects: list[int] = []
    for source in sources:
        pipeline = AnchoringPipeline(GeometricRecogniser(), load_mismatch(), config)
        for k, frame in enumerate(source):
            begin, began = time.process_time(), time.perf_counter()
            segmentation = pipeline.observe(frame)
            observed, looked = time.process_time(), time.perf_counter()
            detections = pipeline.recognise(segmentation, frame)
            recognised, named = time.process_time(), time.perf_counter()
            pipeline.world.update(detections, frame)
            end, ended = time.process_time(), time.perf_counter()
            if k < _WARM_UP or not segmentation.tops:
                continue
            tops = _tops_ms(frame, config)
            observe = 1e3 * (observed - begin)
            for stage, value in (
                ("whole step", observe + 1e3 * (end - recognised)),
                ("points of the map and tops", tops),
                ("clusters and tracks", observe - tops),
                ("anchors: association, filter, removal", 1e3 * (end - recognised)),
            ):
                stages.setdefault(stage, []).append(value)
            wall.append(1e3 * (looked - began + ended - named))
            objects.append(len(segmentation.clusters))
    whole = sorted(stages["whole step"])
    return Report(
        f"A step of anchoring on {name}",
        "ms",
        {stage: statistics.median(values) for stage, values in stages.items()},
        {},
        f"less than {TARGET_MS:.0f} ms per frame of 640x480 without recognition",
        [
            f"Processor time of one thread over {len(whole)} frames that show a top, with "
            f"{statistics.mean(objects):.1f} objects each; nine of ten take at most "
            f"{whole[int(0.9 * len(whole))]:.0f} ms. Median of the wall clock: "
            f"{statistics.median(wall):.0f} ms."
        ],
    )


def _tops_ms(frame: SensorFrame, config: AnchoringConfig) -> float:
    """What the first stage takes, measured again by itself."""
    begin = time.process_time()
    points = organise(frame, config.segmentation.noise, config.supports.range_max_m)
    find_tops(points, config.supports, np.random.default_rng(0))
    return 1e3 * (time.process_time() - begin)
