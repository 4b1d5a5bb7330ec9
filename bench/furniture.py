"""The experiments of Section 3.3: furniture of an office and of a seminar room, as in Table 3.1."""

from __future__ import annotations

from bench.measuring import Report
from fluentboard_modules.mapping.evaluate import TITLES, simulated_trial
from fluentboard_modules.mapping.protocol import area_under_curve, table_lines
from fluentboard_modules.mapping.trials import Mode

_SEED = 1
_FRAMES: dict[Mode, int] = {"frames": 24, "map": 70}
_NAMES = {
    "shelf_800_380_1860_5000": "Shelf",
    "office_chair_470": "OfficeChair",
    "l_desk_1800_1700_730": "Desk",
    "conference_table_1800_900_740": "ConfTable",
    "seminar_table_1400_700_730": "SemTable",
}
# F1 of Table 3.1, single point clouds and full scene.
_THESIS = {
    ("office", True): {
        "Shelf": 36.1,
        "OfficeChair": 39.0,
        "ConfChair": 39.7,
        "Desk": 33.3,
        "ConfTable": 100.0,
        "total": 46.0,
    },
    ("office", False): {
        "Shelf": 33.3,
        "OfficeChair": 100.0,
        "ConfChair": 60.0,
        "Desk": 100.0,
        "ConfTable": 100.0,
        "total": 63.6,
    },
    ("seminar", True): {"Chair": 71.7, "SemTable": 85.7, "total": 79.4},
    ("seminar", False): {"Chair": 42.9, "SemTable": 95.7, "total": 64.2},
}
_STAGES = {True: "6.53 s, 1.02 s and 1.53 s", False: "117.06 s, 2.67 s and 26.11 s"}


def run() -> list[Report]:
    """A report per room and mode."""
    return [
        _report(scene, mode, count)
        for scene in ("office", "seminar")
        for mode, count in _FRAMES.items()
    ]


def _report(scene: str, mode: Mode, n_frames: int) -> Report:
    trial = simulated_trial(scene, mode, _SEED, n_frames)
    chair = "ConfChair" if scene == "office" else "Chair"
    lines = table_lines(trial.rows, {**_NAMES, "conference_chair_450": chair})
    thesis = _THESIS[scene, mode == "frames"]
    for k, line in enumerate(lines):
        name = line.split("|")[1].strip()
        if k == 0:
            lines[k] = line + " F1 of the thesis |"
        elif k == 1:
            lines[k] = line + " --- |"
        else:
            lines[k] = line + (f" {thesis[name]:.1f} % |" if name in thesis else " |")
    times = ", ".join(f"{stage} {seconds:.2f} s" for stage, seconds in trial.seconds.items())
    notes = [
        f"Simulated {scene} built like the thesis's, {trial.n_frames} frames with the noise of a "
        "Kinect and exact poses: the data differ, so read the thesis's column as a guide only. "
        f"Times per {'scene' if mode == 'scene' else 'frame'}: {times} (thesis: surfaces, "
        f"classification and pose {_STAGES[mode == 'frames']}).",
    ]
    if trial.scores:
        notes.append(
            f"Area under the ROC curve of the visibility score over {len(trial.scores)} "
            f"hypotheses: {area_under_curve(trial.scores):.3f}."
        )
    return Report(
        f"Furniture of Section 3.3: {scene}, {TITLES[mode]}", "", {}, {}, notes=notes, table=lines
    )
