"""`fluentboard evaluate mapping`: the experiments of Section 3.3, and any labelled recording."""

from __future__ import annotations

import json
import statistics
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from rich.console import Console
from rich.markdown import Markdown

from fluentboard.errors import InvalidInput
from fluentboard_modules.frames.sensor_frame import FrameSource, SensorFrame
from fluentboard_modules.frames.sources import open_source
from fluentboard_modules.mapping.cad_library import CadLibrary, load_library
from fluentboard_modules.mapping.config import MappingConfig, VerificationConfig
from fluentboard_modules.mapping.labelled import LabelledTrial, run_labelled
from fluentboard_modules.mapping.labels import labels_beside, read_labels
from fluentboard_modules.mapping.map_frame import place, read_gravity
from fluentboard_modules.mapping.protocol import Row, area_under_curve, table_lines
from fluentboard_modules.mapping.rules import furniture_ontology, load_rules
from fluentboard_modules.mapping.trials import MODES, Mode, Trial, run_trial, scene_library
from fluentboard_modules.progress import FrameProgress
from fluentboard_modules.simulation.drive import SimulatedDrive
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


def evaluate_recording(
    recording: str,
    labels: Path | None = None,
    *,
    gravity: Path | None = None,
    models: Path | None = None,
    ontologies: Sequence[Path] = (),
    output: Path | None = None,
) -> LabelledTrial:
    """Maps a recording as the worker does, and compares the furniture with labels.

    Args:
        recording: as for `open_source`.
        labels: label file; by default one beside the recording.
        gravity: file with the direction things fall.
        models: folder of CAD models named after furniture classes.
        ontologies: files in Turtle with more classes of furniture.
        output: file for the results as JSON.

    Raises:
        FluentboardError: the recording, the labels or another file is not what it should be.
    """
    config = MappingConfig()
    rules = load_rules(furniture_ontology(ontologies))
    classes = [furniture.name for furniture in rules.furniture_classes]
    pieces = read_labels(labels or labels_beside(recording), classes)
    library = CadLibrary() if models is None else load_library(models, classes)
    source, _ = place(open_source(recording), config, gravity and read_gravity(gravity))
    with FrameProgress() as progress:
        progress.begin("mapping", len(source))
        trial = run_labelled(_shown(source, progress), pieces, rules, library, config)
    console = Console(highlight=False)
    console.print(f"\n[bold]{recording}: {trial.n_frames} frames, {len(pieces)} labels[/bold]")
    console.print(Markdown("\n".join(table_lines(trial.rows, {}))))
    if trial.size_errors_m:
        worst = 100.0 * statistics.median(trial.size_errors_m)
        console.print(f"largest error of a piece's three sizes: {worst:.1f} cm (median)")
    if output is not None:
        kept = {"title": recording, "rows": _rows(trial.rows), "size_m": trial.size_errors_m}
        output.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    return trial


def simulated_room(scene: str, seed: int, n_frames: int) -> SimulatedDrive:
    """A drive through one of the simulated rooms.

    Raises:
        InvalidInput: it is no room.
    """
    source = open_source(f"sim:{scene}?seed={seed}&frames={n_frames}")
    if not isinstance(source, SimulatedDrive):
        raise InvalidInput(f"sim:{scene} is no room; give one of {', '.join(SCENES)}")
    return source


def simulated_trial(scene: str, mode: Mode, seed: int, n_frames: int) -> Trial:
    """One room and mode, with the CAD models of what stands there."""
    source = simulated_room(scene, seed, n_frames)
    rules = load_rules(read_ontology("furniture"))
    truth = source.scene
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
        "rows": _rows(trial.rows),
        "seconds": trial.seconds,
        "area_under_curve": area_under_curve(trial.scores) if trial.scores else None,
    }


def _rows(rows: Mapping[str, Row]) -> dict[str, object]:
    return {
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
        for model, row in rows.items()
    }
