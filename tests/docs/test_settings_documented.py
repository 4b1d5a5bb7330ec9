"""Every setting has its row in docs/configuration.md, with its default, and nothing else has."""

from __future__ import annotations

import re
from pathlib import Path

import yaml

from fluentboard.config import Settings, setting_sections

PAGE = Path(__file__).parents[2] / "docs" / "configuration.md"


def test_every_setting_is_documented_with_its_default() -> None:
    rows = re.findall(r"^\| `(\w+\.\w+)` \| `(.*?)` \| .+ \|$", PAGE.read_text(), re.MULTILINE)
    documented = {key: yaml.safe_load(default) for key, default in rows}
    defaults = Settings().model_dump(mode="json")
    settings = {
        f"{section}.{key}": defaults[section][key]
        for section, model in setting_sections()
        for key in model.model_fields
    }
    assert documented == settings


def test_the_example_of_tokens_is_valid() -> None:
    (example,) = re.findall(r"```yaml\n(.*?)```", PAGE.read_text(), re.DOTALL)
    tokens = Settings.model_validate(yaml.safe_load(example)).security.tokens
    assert [token.role for token in tokens] == ["write", "read"]
