"""Settings: the shape that the settings of all modules share, and how they are read."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from fluentboard.errors import InvalidInput


class Settings(BaseModel):
    """A group of settings: complete defaults, never changed, and unknown names are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)


_Kind = TypeVar("_Kind", bound=Settings)


def read_settings(
    kind: type[_Kind], path: Path | None, flags: Mapping[str, object | None]
) -> _Kind:
    """The settings: defaults, overridden by a file, overridden by flags.

    Args:
        kind: what they are settings of, such as `SearchConfig`.
        path: of a YAML file with any of the settings; None for none.
        flags: values by dotted names, such as `world.association.method`; None is not given.

    Raises:
        InvalidInput: the file cannot be read, or a setting is unknown or wrong.
    """
    tree: Any = {}
    if path is not None:
        try:
            tree = yaml.safe_load(path.read_text(encoding="utf-8")) or {}
        except (OSError, UnicodeDecodeError, yaml.YAMLError) as problem:
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
        return kind.model_validate(tree)
    except ValidationError as problem:
        first = problem.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise InvalidInput(
            f"setting {where} = {first['input']!r}: {first['msg']}; see docs/module-settings.md"
        ) from problem
