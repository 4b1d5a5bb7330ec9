"""The settings of anchoring from a YAML file and flags, fitted to the recording."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from fluentboard.errors import InvalidInput
from fluentboard_modules.anchoring.config import AnchoringConfig
from fluentboard_modules.frames.recordings import LiveSource
from fluentboard_modules.frames.sensor_frame import FrameSource

logger = logging.getLogger(__name__)


def read_settings(path: Path | None, flags: Mapping[str, str | None]) -> AnchoringConfig:
    """The settings: defaults, overridden by a file, overridden by flags.

    Args:
        path: of a YAML file with any of the settings; None for none.
        flags: values by dotted names, such as `world.association.method`; None is not given.

    Raises:
        InvalidInput: the file cannot be read, or a setting is unknown or wrong.
    """
    tree: Any = {}
    if path is not None:
        try:
            tree = yaml.safe_load(path.read_text(encoding="utf-8")) or {}
        except (OSError, yaml.YAMLError) as problem:
            raise InvalidInput(f"{path}: cannot be read ({problem}); give a YAML file") from problem
        if not isinstance(tree, dict):
            raise InvalidInput(f"{path}: holds no settings; give a mapping of names to values")
    for name, value in flags.items():
        if value is None:
            continue
        place = tree
        *groups, last = name.split(".")
        for group in groups:
            below = place.setdefault(group, {})
            if not isinstance(below, dict):
                raise InvalidInput(f"{path}: {group} is {below!r}; give a mapping")
            place = below
        place[last] = value
    try:
        return AnchoringConfig.model_validate(tree)
    except ValidationError as problem:
        first = problem.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise InvalidInput(
            f"setting {where} = {first['input']!r}: {first['msg']}; see docs/configuration.md"
        ) from problem


def for_short_recordings(config: AnchoringConfig, source: FrameSource) -> AnchoringConfig:
    """Settings with which a single image, or a few, can show an object at all.

    A track becomes an anchor when `world.confirm_frames` frames have shown it. A recording that
    has fewer would leave nothing on the board; unless the settings name that number themselves, it
    is lowered to what the recording has.
    """
    if isinstance(source, LiveSource):
        return config
    frames = len(source)
    world = config.world
    if not 0 < frames < world.confirm_frames:
        return config
    if "confirm_frames" in world.model_fields_set:
        logger.warning(
            "%s has %d frames, and world.confirm_frames asks for %d before an object is anchored",
            source.name,
            frames,
            world.confirm_frames,
        )
        return config
    world = world.model_copy(update={"confirm_frames": frames})
    return config.model_copy(update={"world": world})
