"""`fluentboard evaluate mapping`: the experiments of Section 3.3 on simulated rooms."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Console
from rich.markdown import Markdown

from fluentboard.errors import InvalidInput
from fluentboard_modules.frames.sensor_frame import FrameSource, SensorFrame
from fluentboard_modules.frames.sources import open_source
from fluentboard_modules.mapping.config import MappingConfig, VerificationConfig
from fluentboard_modules.mapping.protocol import area_under_curve, table_lines
from fluentboard_modules.mapping.rules import load_rules
from fluentboard_modules.mapping.trials import MODES, Mode, Trial, run_trial, scene_library
from fluentboard_modules.progress import FrameProgress
from fluentboard_ontology import read as read_ontology

SCENES = ("office", "seminar", "restaurant")
"""The simulated rooms: the first two are those of the thesis."""

TITLES: dict[Mode, str] = {
    "frames": "single frames",
    "map": "all frames, with memory",
    "scene": "registered scene",
}


def evaluate_mapping(
    scenes: Sequence[str],
    modes: Sequence[str],
    seeds: Sequence[int],
    n_frames: int,
    output: Path | None = None,
) -> None:
    """Runs the trials and prints a table like Table 3.1 for each room and mode.

    Args:
        scenes: of `SCENES`.
        modes: of `MODES`.
        seeds: of the rooms and of their noise; several are several rooms.
        n_frames: of each drive.
        output: file for the same as JSON.

    Raises:
        InvalidInput: there is no such scene or mode.
    """
    _check(scenes, SCENES, "scene")
    _check(modes, MODES, "mode")
    console = Console(highlight=False)
    kept: list[dict[str, object]] = []
    for scene in scenes:
        for mode in MODES:
            if mode not in modes:
                continue
            for seed in seeds:
                trial = simulated_trial(scene, mode, seed, n_frames)
                title = f"{scene}, seed {seed}: {TITLES[mode]} ({trial.n_frames} frames)"
                console.print(f"\n[bold]{title}[/bold]")
                console.print(Markdown("\n".join(table_lines(trial.rows, {}))))
                console.print(_notes(trial))
                kept.append({"title": title, **_summary(trial)})
    if output is not None:
        output.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


def simulated_trial(scene: str, mode: Mode, seed: int, n_frames: int) -> Trial:
    """One room and mode, with the CAD models of what stands there."""
    source = open_source(f"sim:{scene}?seed={seed}&frames={n_frames}")
    rules = load_rules(read_ontology("furniture"))
    truth = source.scene  # type: ignore[attr-defined]
    library = scene_library(truth, [furniture.name for furniture in rules.furniture_classes])
    # As in the thesis: every class that there is has a CAD model, and no other class is looked for.
    config = MappingConfig(verification=VerificationConfig(generic_models=False))
    with FrameProgress() as progress:
        progress.begin(f"{scene} {mode}", len(source))
        return run_trial(_shown(source, progress), truth, mode, rules, library, config)


class _Shown:
    """A source whose frames move a progress bar."""

    def __init__(self, source: FrameSource, progress: FrameProgress) -> None:
        self._source, self._progress = source, progress
        self.name = source.name

    def __len__(self) -> int:
        return len(self._source)

    def __iter__(self) -> Iterator[SensorFrame]:
        for frame in self._source:
            yield frame
            self._progress.advance("")


def _shown(source: FrameSource, progress: FrameProgress) -> FrameSource:
    return _Shown(source, progress)


def _check(given: Sequence[str], known: Sequence[str], what: str) -> None:
    for name in given:
        if name not in known:
            raise InvalidInput(f"no {what} {name!r} to evaluate; give {', '.join(known)}")


def _notes(trial: Trial) -> str:
    times = ", ".join(f"{stage} {seconds:.2f} s" for stage, seconds in trial.seconds.items())
    auc = area_under_curve(trial.scores)
    return times + (f"; score: area under the ROC curve {auc:.3f}" if trial.scores else "")


def _summary(trial: Trial) -> dict[str, object]:
    return {
        "rows": {
            model: {
                "true_positives": row.true_positives,
                "false_positives": row.false_positives,
                "false_negatives": row.false_negatives,
                "initial_m": row.initial_m,
                "initial_rad": row.initial_rad,
                "final_m": row.final_m,
                "final_rad": row.final_rad,
                "precision": row.precision,
                "recall": row.recall,
                "f1": row.f1,
            }
            for model, row in trial.rows.items()
        },
        "seconds": trial.seconds,
        "area_under_curve": area_under_curve(trial.scores) if trial.scores else None,
    }
