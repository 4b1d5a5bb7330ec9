"""Writes docs/module-settings.md from the settings of the perception modules themselves.

    .venv/bin/python docs/write_module_settings.py

A test compares the file with the settings, so it cannot grow stale.
"""

from __future__ import annotations

import inspect
import json
from collections.abc import Iterator
from pathlib import Path

from fluentboard_modules.anchoring.config import AnchoringConfig
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.search.config import SearchConfig
from fluentboard_modules.settings import Settings

PAGE = Path(__file__).parent / "module-settings.md"

_MODULES: dict[str, Settings] = {
    "mapping": MappingConfig(),
    "anchoring": AnchoringConfig(),
    "search": SearchConfig(),
}
_INTRODUCTION = """\
# Settings of the perception modules

Nothing needs to be set: every setting has a default. What shall be different goes into a YAML file
for `--config` of `fluentboard work mapping`, `anchoring` or `search`, with the groups below as
mappings:

```yaml
# anchoring.yaml: fluentboard work anchoring --frames ./kitchen --config anchoring.yaml
world:
  confirm_frames: 5
  association: {method: murty}
```

Flags of the command override the file. An unknown name or an impossible value is an error that
names the setting, and nothing is started. Units are in the names: `_m` metres, `_s` seconds, `_deg`
and `_rad` angles, `_px` pixels. Written by `docs/write_module_settings.py`.
"""


def page() -> str:
    """The whole page."""
    parts = [_INTRODUCTION]
    for module, settings in _MODULES.items():
        parts.append(f"## {module}\n\nFor `fluentboard work {module} --config FILE`.\n")
        for path, group in _groups(settings, ()):
            heading = f"### {module}: {'.'.join(path) or 'at the top'}"
            parts.append(f"{heading}\n\n{inspect.getdoc(type(group))}\n\n{_table(group)}")
    return "\n".join(parts)


def _groups(
    settings: Settings, path: tuple[str, ...]
) -> Iterator[tuple[tuple[str, ...], Settings]]:
    """The groups that have settings of their own, with their places in the file."""
    inner = {key: getattr(settings, key) for key in type(settings).model_fields}
    if not all(isinstance(value, Settings) for value in inner.values()):
        yield path, settings
    for key, value in inner.items():
        if isinstance(value, Settings):
            yield from _groups(value, (*path, key))


def _table(group: Settings) -> str:
    defaults = group.model_dump(mode="json")
    rows = ["| setting | default | meaning |", "| --- | --- | --- |"]
    for key, field in type(group).model_fields.items():
        if not isinstance(getattr(group, key), Settings):
            meaning = (field.description or "").replace("|", "\\|")
            rows.append(f"| `{key}` | `{json.dumps(defaults[key])}` | {meaning} |")
    return "\n".join(rows) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
