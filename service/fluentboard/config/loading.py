"""Loading: the settings that a file, the environment and flags add up to."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, cast, get_args, get_origin

import yaml
from pydantic import ValidationError
from pydantic.fields import FieldInfo

from fluentboard.config.sections import Settings, setting_sections
from fluentboard.errors import InvalidConfiguration

ENVIRONMENT_PREFIX = "FLUENTBOARD_"


def load_settings(
    file: Path | None = None,
    environment: Mapping[str, str] | None = None,
    flags: Mapping[str, Any] | None = None,
) -> Settings:
    """The settings that a file, the environment and flags add up to.

    Args:
        file: YAML file of sections and keys.
        environment: variables; those named `FLUENTBOARD_<SECTION>_<KEY>` count.
        flags: values by dotted key such as `server.port`; None means that the flag was not given.

    Raises:
        InvalidConfiguration: the file cannot be read, a key is unknown or a value out of range.

    Example:
        >>> load_settings(flags={"server.port": 0}).server.port
        0
    """
    values: dict[str, dict[str, Any]] = {}
    origin: dict[str, str] = {}
    if file is not None:
        for key, value in _from_file(file):
            _put(values, origin, key, value, str(file))
    for name, key, value in _from_environment(environment or {}):
        _put(values, origin, key, value, name)
    for key, value in (flags or {}).items():
        if value is not None:
            _put(values, origin, key, value, f"flag for {key}")
    try:
        return Settings.model_validate(values)
    except ValidationError as problem:
        raise InvalidConfiguration(_explained(problem, origin)) from None


def environment_variable(section: str, key: str) -> str:
    """The variable that sets a key."""
    return f"{ENVIRONMENT_PREFIX}{section}_{key}".upper()


def _put(
    values: dict[str, dict[str, Any]], origin: dict[str, str], key: str, value: Any, source: str
) -> None:
    section, _, name = key.partition(".")
    values.setdefault(section, {})[name] = value
    origin[key] = source


def _from_file(file: Path) -> Iterable[tuple[str, Any]]:
    try:
        document: Any = yaml.safe_load(file.read_text(encoding="utf-8"))
    except OSError as problem:
        raise InvalidConfiguration(f"cannot read the settings file: {problem}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as problem:
        raise InvalidConfiguration(f"the settings file {file} is not YAML: {problem}") from None
    sections: Any = {} if document is None else document
    if not isinstance(sections, dict):
        raise InvalidConfiguration(f"the settings file {file} is not a mapping of sections")
    found: list[tuple[str, Any]] = []
    for section, keys in cast("dict[Any, Any]", sections).items():
        if section not in Settings.model_fields:
            raise InvalidConfiguration(
                f"{file} has the unknown section {section!r}; {_closest(str(section))}"
            )
        if keys is not None and not isinstance(keys, dict):
            raise InvalidConfiguration(f"{file}: section {section} is not a mapping of keys")
        entries = cast("dict[Any, Any]", keys or {})
        found += [(f"{section}.{key}", value) for key, value in entries.items()]
    return found


def _from_environment(environment: Mapping[str, str]) -> Iterable[tuple[str, str, Any]]:
    sections = dict(setting_sections())
    found: list[tuple[str, str, Any]] = []
    for name in sorted(environment):
        if not name.startswith(ENVIRONMENT_PREFIX):
            continue
        section, _, key = name.removeprefix(ENVIRONMENT_PREFIX).lower().partition("_")
        if section not in sections:
            # Clients have FLUENTBOARD_ variables of their own; only a near miss is a mistake.
            if key and difflib.get_close_matches(section, sections, n=1, cutoff=0.7):
                raise InvalidConfiguration(f"{name} sets nothing; {_closest(section)}")
            continue
        field = sections[section].model_fields.get(key)
        if field is None:
            raise InvalidConfiguration(
                f"{name} sets nothing: section {section} has no key {key!r}; "
                f"keys are {', '.join(sections[section].model_fields)}"
            )
        found.append((name, f"{section}.{key}", _parsed(environment[name], field, name)))
    return found


def _parsed(text: str, field: FieldInfo, name: str) -> Any:
    """The value of a variable: text as it is, numbers, lists and null as YAML reads them."""
    kinds = {field.annotation, *get_args(field.annotation)}
    if kinds & {str, Path} and get_origin(field.annotation) is not tuple:
        return None if text in ("", "null") and type(None) in kinds else text
    try:
        value: Any = yaml.safe_load(text)
    except yaml.YAMLError as problem:
        raise InvalidConfiguration(f"{name} is not YAML: {problem}") from None
    if get_origin(field.annotation) is tuple and not isinstance(value, list):
        return [] if value is None else [value]
    return cast("Any", value)


def _explained(problem: ValidationError, origin: Mapping[str, str]) -> str:
    parts: list[str] = []
    for error in problem.errors(include_url=False):
        location = [str(part) for part in error["loc"]]
        source = origin.get(".".join(location[:2]))
        where = ".".join(location) + (f" (from {source})" if source else "")
        if error["type"] == "extra_forbidden":
            parts.append(f"{where} is not a setting; {_closest(location[-1], location[0])}")
            continue
        # A wrong secret must not end up in a log.
        shown = "" if "token" in location else f" is {error['input']!r}"
        message = error["msg"].removeprefix("Value error, ")
        parts.append(f"{where}{shown}: {message[0].lower()}{message[1:]}")
    return "; ".join(parts)


def _closest(name: str, section: str | None = None) -> str:
    sections = dict(setting_sections())
    model = sections.get(section or "")
    known = list(model.model_fields) if model else list(sections)
    what = f"keys of {section}" if model else "sections"
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    return f"did you mean {close[0]!r}?" if close else f"{what} are {', '.join(known)}"
