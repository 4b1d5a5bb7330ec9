"""`fluentboard evaluate mapping`: how much of simulated restaurants is found, and how exactly."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from fluentboard_modules.frames.sources import SIMULATED, open_source
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.evaluation import (
    Match,
    Score,
    compare,
    score,
    true_furniture,
)
from fluentboard_modules.mapping.furniture_item import FurnitureItem
from fluentboard_modules.mapping.furniture_map import FurnitureMap
from fluentboard_modules.mapping.rules import load_rules
from fluentboard_modules.mapping.surfaces import detect_regions
from fluentboard_modules.progress import FrameProgress
from fluentboard_ontology import read as read_ontology


def evaluate_mapping(seeds: Sequence[int]) -> None:
    """Maps a simulated restaurant per seed and prints a table like Table 3.1.

    Args:
        seeds: of the restaurants and of their noise.
    """
    matches: list[Match[FurnitureItem]] = []
    for seed in seeds:
        matches += map_restaurant(seed)
    classes = sorted({_class_name(match) for match in matches})
    table = Table(box=None, pad_edge=False, header_style="dim", padding=(0, 2, 0, 0))
    table.add_column("class")
    for name in ("found", "invented", "missed", "F1", "mean error"):
        table.add_column(name, justify="right")
    for class_name in classes:
        table.add_row(
            class_name, *_cells(score([m for m in matches if _class_name(m) == class_name]))
        )
    table.add_row("all", *_cells(score(matches)), style="bold")
    Console(highlight=False).print(table)


def map_restaurant(seed: int) -> list[Match[FurnitureItem]]:
    """Maps the restaurant of that seed and compares what was found with what is there."""
    config = MappingConfig()
    rules = load_rules(read_ontology("furniture"))
    source = open_source(f"{SIMULATED}:{seed}")
    furniture_map = FurnitureMap(rules, config.furniture, config.surfaces.noise)
    with FrameProgress() as progress:
        progress.begin(f"seed {seed}", len(source))
        for frame in source:
            regions = detect_regions(frame, config.surfaces)
            furniture_map.update(frame, regions, rules.classify(regions))
            progress.advance(f"{len(furniture_map.furniture())} pieces")
    known = {furniture.name for furniture in rules.furniture_classes}
    true = true_furniture(source.scene, known)  # type: ignore[attr-defined]
    return compare(furniture_map.furniture(), true)


def _class_name(match: Match[FurnitureItem]) -> str:
    placed = match.found or match.true
    assert placed is not None
    return placed.class_name


def _cells(result: Score) -> tuple[str, str, str, str, str]:
    error = result.mean_distance_m
    return (
        str(result.true_positives),
        str(result.false_positives),
        str(result.false_negatives),
        f"{100.0 * result.f1:.1f} %",
        "" if math.isnan(error) else f"{100.0 * error:.1f} cm",
    )
