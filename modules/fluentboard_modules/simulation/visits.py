"""Several visits to one scene, between which things are moved, removed, added and swapped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fluentboard.errors import InvalidInput
from fluentboard.model.fluent import Fluent
from fluentboard.model.geometry import Pose
from fluentboard_modules.simulation.changes import Change, ChangeConfig, changed
from fluentboard_modules.simulation.drive import SimulatedDrive
from fluentboard_modules.simulation.truth import history_fluents

BETWEEN_VISITS_S = 600.0


@dataclass(frozen=True, slots=True)
class Visit:
    """One drive through the scene.

    Attributes:
        drive: what is seen, and when.
        changes: what happened since the visit before; nothing before the first.
    """

    drive: SimulatedDrive
    changes: tuple[Change, ...] = ()


def visits(
    first: SimulatedDrive,
    count: int,
    config: ChangeConfig | None = None,
    between_s: float = BETWEEN_VISITS_S,
) -> tuple[Visit, ...]:
    """The drive, and the same way again after each round of changes.

    A visit depends on those before it only, so the second of three is the second of two.

    Args:
        first: the first visit; its seed decides the changes, too.
        count: how many visits.
        config: how much changes in between; by default things are also swapped.
        between_s: from the last frame of a visit to the first of the next.

    Raises:
        InvalidInput: fewer than one visit.
    """
    if count < 1:
        raise InvalidInput(f"{count} visits; give at least 1")
    config = config if config is not None else ChangeConfig(swapped=1)
    found = [Visit(first)]
    for number in range(1, count):
        before = found[-1].drive
        rng = np.random.default_rng([first.seed, number, 0xC4A96E])
        scene, changes = changed(before.scene, rng, config)
        last_s = before.start_s + (len(before) - 1) / before.rate_hz
        drive = replace(
            before,
            name=f"{first.name}, visit {number + 1}",
            scene=scene,
            # A prime apart, so that the noise of two visits has nothing in common.
            seed=first.seed + 7919 * number,
            start_s=last_s + between_s,
        )
        found.append(Visit(drive, changes))
    return tuple(found)


def true_history(visited: Sequence[Visit]) -> tuple[Fluent, ...]:
    """The truth about all visits as fluents; the first visit's things were there before it."""
    return history_fluents(
        [
            (visit.drive.start_s if number else None, visit.drive.scene)
            for number, visit in enumerate(visited)
        ]
    )


def changes_to_json(visited: Sequence[Visit]) -> list[dict[str, Any]]:
    """All changes as plain data: visit, time of the visit, kind, name, pose before and after."""
    return [
        {
            "visit": number + 1,
            "time_s": round(visit.drive.start_s, 6),
            "kind": change.kind.value,
            "name": change.name,
            "before": _pose_to_json(change.before),
            "after": _pose_to_json(change.after),
            "partner": change.partner,
        }
        for number, visit in enumerate(visited)
        for change in visit.changes
    ]


def _pose_to_json(pose: Pose | None) -> list[float] | None:
    if pose is None:
        return None
    return [round(float(v), 9) + 0.0 for v in (pose.x, pose.y, pose.z, *pose.rpy)]
