"""Printing: settings as a YAML file that could be loaded again."""

from __future__ import annotations

import yaml
from pydantic import BaseModel

from fluentboard.config.sections import Settings, setting_sections


def settings_yaml(settings: Settings) -> str:
    """The settings as a YAML file with a comment per key; secrets are masked.

    Example:
        >>> print(settings_yaml(Settings()).splitlines()[2])
          host: 127.0.0.1  # Address to listen on.
    """
    lines: list[str] = []
    for section_name, section in setting_sections():
        lines.append(f"{section_name}:  # {_first_line(section)}")
        shown = getattr(settings, section_name).model_dump(mode="json")
        for key, field in section.model_fields.items():
            # One line per key: a flow-style document of one value, less the end-of-document mark.
            text = yaml.safe_dump(shown[key], default_flow_style=True, width=10**9)
            value = text.removesuffix("...\n").strip()
            lines.append(f"  {key}: {value}  # {_sentence(field.description or '')}")
    return "\n".join(["# Settings of fluentboard serve.", *lines]) + "\n"


def _first_line(section: type[BaseModel]) -> str:
    return (section.__doc__ or "").strip().splitlines()[0]


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:].removesuffix(".") + "."
