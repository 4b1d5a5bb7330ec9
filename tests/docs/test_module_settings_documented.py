"""docs/module-settings.md is what the settings of the modules say, and they say what they mean."""

from __future__ import annotations

import re
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_page_is_what_the_settings_say() -> None:
    spec = spec_from_file_location("write_module_settings", DOCS / "write_module_settings.py")
    assert spec is not None
    assert spec.loader is not None
    writer = module_from_spec(spec)
    spec.loader.exec_module(writer)
    written = (DOCS / "module-settings.md").read_text(encoding="utf-8")
    assert written == writer.page(), "run docs/write_module_settings.py"


def test_every_setting_says_what_it_means() -> None:
    written = (DOCS / "module-settings.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `\w+` \| `.*?` \|  \|$", written, re.MULTILINE) == []
