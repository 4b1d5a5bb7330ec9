"""The settings of anchoring from a YAML file and flags."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from fluentboard.errors import InvalidInput
from fluentboard_modules.anchoring.config import AnchoringConfig


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
