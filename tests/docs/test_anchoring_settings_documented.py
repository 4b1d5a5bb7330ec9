"""Every setting of anchoring has its row in docs/configuration.md, with default and meaning."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from fluentboard_modules.anchoring.config import AnchoringConfig

PAGE = (Path(__file__).parents[2] / "docs" / "configuration.md").read_text(encoding="utf-8")


def settings(model: BaseModel, path: tuple[str, ...] = ()) -> Iterator[tuple[str, str, Any]]:
    for key in type(model).model_fields:
        value = getattr(model, key)
        if isinstance(value, BaseModel):
            yield from settings(value, (*path, key))
        else:
            yield ".".join(path), key, model.model_dump(mode="json")[key]


def test_every_setting_of_anchoring_is_documented_with_its_default() -> None:
    documented: list[tuple[str, str, Any]] = []
    for group in re.split(r"^### anchoring: ", PAGE, flags=re.MULTILINE)[1:]:
        rows = re.findall(r"^\| `(\w+)` \| `(.*?)` \| .+ \|$", group, re.MULTILINE)
        name = group.partition("\n")[0]
        documented += [(name, key, json.loads(default)) for key, default in rows]
    by_name = {(group, key): value for group, key, value in settings(AnchoringConfig())}
    assert {(group, key): value for group, key, value in documented} == by_name
