"""Whether a piece of furniture has changed so much that the board is told."""

from __future__ import annotations

import math

import numpy as np

from fluentboard_modules.mapping.config import FurnitureMapConfig
from fluentboard_modules.mapping.furniture_item import FurnitureItem


def differs(
    old: FurnitureItem, new: FurnitureItem, symmetry_order: int, config: FurnitureMapConfig
) -> bool:
    """Whether a change is worth reporting.

    Args:
        old: as it was reported last.
        new: as it is believed to be.
        symmetry_order: turns of a full turn over this are no turns: of a table, half of one.
        config: thresholds.
    """
    moved = math.dist((old.pose.x, old.pose.y, old.pose.z), (new.pose.x, new.pose.y, new.pose.z))
    turn = (new.pose.yaw_rad - old.pose.yaw_rad) * symmetry_order
    turned = abs(math.atan2(math.sin(turn), math.cos(turn))) / symmetry_order
    resized = float(np.abs(new.box.sizes - old.box.sizes).max())
    return (
        moved > config.moved_m
        or turned > config.turned_rad
        or resized > config.resized_m
        or abs(new.score - old.score) > config.rescored
    )
