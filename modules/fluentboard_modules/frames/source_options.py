"""Options of a source: what follows the question mark in `kitchen?every=5`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from urllib.parse import unquote

from fluentboard.errors import InvalidInput


def split_options(text: str) -> tuple[str, Mapping[str, str]]:
    """What stands before the question mark, and the options behind it.

    Raises:
        InvalidInput: an option is not `name=value`, or stands there twice.
    """
    place, mark, tail = text.partition("?")
    if not mark or Path(text).exists():  # a folder's name may have a question mark
        return text, {}
    options: dict[str, str] = {}
    for entry in tail.split("&"):
        name, equals, value = entry.partition("=")
        if not name or not equals or name in options:
            raise InvalidInput(
                f"{text}: the option {entry!r} is not understood; options are name=value, each "
                "once, joined by &"
            )
        options[name] = unquote(value)
    return place, options


def check_options(text: str, options: Mapping[str, str], known: tuple[str, ...]) -> None:
    """Raise InvalidInput if there is an option that the source does not know."""
    unknown = sorted(options.keys() - set(known))
    if unknown:
        raise InvalidInput(
            f"{text}: no option {unknown[0]!r} for this source; options are "
            f"{', '.join(known) or 'none'}"
        )


def whole_number(
    text: str, options: Mapping[str, str], name: str, default: int, least: int = 0
) -> int:
    """The value of an option that is a whole number.

    Raises:
        InvalidInput: it is something else, or too small.
    """
    value = options.get(name)
    if value is None:
        return default
    if not (value.isascii() and value.isdigit()) or int(value) < least:
        raise InvalidInput(f"{text}: {name}={value}; give a whole number of at least {least}")
    return int(value)
