"""`fluentboard simulate`: a simulated drive, or several visits, written to disk with the truth.

DIR                 a recording in the 7-Scenes layout: frames, labels, camera, stamps
DIR/truth.json      class, pose, box, label of everything; a scene, with its models in `meshes/`
DIR/truth.yaml      the same as fluents, as a perfect perception would have written them
DIR/visit1, ...     the recordings, where there are several visits
DIR/changes.json    what truly happened between them
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fluentboard.errors import InvalidInput
from fluentboard.model.yaml_format import write_fluents
from fluentboard_modules.simulation.drive import SimulatedDrive
from fluentboard_modules.simulation.recording import record
from fluentboard_modules.simulation.visits import changes_to_json, true_history, visits

FLUENTS_FILE = "truth.yaml"
CHANGES_FILE = "changes.json"


@dataclass(frozen=True, slots=True)
class Simulated:
    """What was written.

    Attributes:
        folders: of the recordings, one per visit.
        frames: in all of them.
        changes: how many things were moved, removed, added or swapped between the visits.
        fluents: how many make up the truth.
    """

    folders: tuple[Path, ...]
    frames: int
    changes: int
    fluents: int


def simulate(
    drive: SimulatedDrive,
    folder: Path,
    count: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Simulated:
    """Write a drive, or several visits of the same way, with the truth.

    Args:
        drive: the first visit.
        folder: created if missing; must not hold a recording.
        count: how many visits.
        progress: called after every frame with the frames written and the frames in all.

    Raises:
        InvalidInput: the folder holds a recording, or no visit is asked for.
    """
    visited = visits(drive, count)
    if folder.exists() and any(folder.iterdir()):
        raise InvalidInput(f"{folder} is not empty; choose a new or an empty folder")
    folders = [folder if count == 1 else folder / f"visit{k + 1}" for k in range(count)]
    total, written = count * len(drive), 0
    for visit, place in zip(visited, folders, strict=True):

        def tell(done: int, _: int, before: int = written) -> None:
            if progress is not None:
                progress(before + done, total)

        written += record(visit.drive, place, visit.drive.scene, tell)
    fluents = true_history(visited)
    with (folder / FLUENTS_FILE).open("w", encoding="utf-8") as stream:
        write_fluents(fluents, stream)
    if count > 1:
        text = json.dumps(changes_to_json(visited), indent=1) + "\n"
        (folder / CHANGES_FILE).write_text(text, encoding="utf-8")
    changes = sum(len(visit.changes) for visit in visited)
    return Simulated(tuple(folders), written, changes, len(fluents))
