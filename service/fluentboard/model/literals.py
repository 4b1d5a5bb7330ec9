"""Literals: what a property value of an XSD type is in Python, and which values are refused."""

from __future__ import annotations

import math
import re
import sys
from decimal import Decimal
from typing import Any

from fluentboard.errors import InvalidValue

Value = str | int | float | bool

# xsd:integer is unbounded; the board keeps what JSON readers and the RDF store count with.
_LONG = 2**63
_INTEGER_RANGES = {
    "integer": (-_LONG, _LONG - 1),
    "long": (-_LONG, _LONG - 1),
    "int": (-(2**31), 2**31 - 1),
    "short": (-(2**15), 2**15 - 1),
    "byte": (-128, 127),
    "nonNegativeInteger": (0, _LONG - 1),
    "positiveInteger": (1, _LONG - 1),
    "nonPositiveInteger": (-_LONG, 0),
    "negativeInteger": (-_LONG, -1),
    "unsignedLong": (0, 2**64 - 1),
    "unsignedInt": (0, 2**32 - 1),
    "unsignedShort": (0, 2**16 - 1),
    "unsignedByte": (0, 255),
}
_LARGEST = {"float": 3.4028234663852886e38, "double": math.inf}
# Python's own float() and int() also read 1_000 and digits of other scripts; XSD does not.
_FLOAT = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_INTEGER = re.compile(r"[+-]?\d{1,40}", re.ASCII)
_BLANKS = " \t\r\n"

_DATE = r"-?\d{4,}-(0[1-9]|1[0-2])-(0[1-9]|[12]\d|3[01])"
_TIME = r"([01]\d|2[0-3]):[0-5]\d:[0-5]\d(\.\d+)?"
_ZONE = r"(Z|[+-](0\d|1[0-4]):[0-5]\d)?"
_LEXICAL = {
    local: re.compile(pattern, re.ASCII)
    for local, pattern in {
        "decimal": r"[+-]?(\d+(\.\d*)?|\.\d+)",
        "dateTime": f"{_DATE}T{_TIME}{_ZONE}",
        "date": _DATE + _ZONE,
        "time": _TIME + _ZONE,
        "duration": r"-?P(?=.)(\d+Y)?(\d+M)?(\d+D)?(T(?=.)(\d+H)?(\d+M)?(\d+(\.\d+)?S)?)?",
        "anyURI": r"[^\x00-\x20\x7f<>\"{}|\\^`\ud800-\udfff]*",
        # The characters of XML: query results and RDF/XML can carry no others.
        "string": r"[^\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]*",
    }.items()
}
XSD_TYPES = frozenset({"boolean", *_LARGEST, *_INTEGER_RANGES, *_LEXICAL})
"""Local names of the XSD types that a property value may have."""


def literal_value(name: str, xsd_type: str, value: Any) -> Value:
    """The value as the Python type of its XSD type; text is parsed.

    Raises:
        InvalidValue: the type is not supported, or the value is not one of it.
    """
    local = xsd_type.removeprefix("xsd:")
    found: Value | None = None
    if local in _LEXICAL:
        found = _text(local, value)
    elif local == "boolean":
        found = _BOOLEANS.get(str(value).strip(_BLANKS).lower())
    elif local in _LARGEST:
        found = _number(value)
    elif local in _INTEGER_RANGES:
        found = _whole(value)
    else:
        raise InvalidValue(
            f"property {name} has type {shown(xsd_type)}, which is not supported; use one of "
            + ", ".join(f"xsd:{known}" for known in sorted(XSD_TYPES))
        )
    if found is None:
        raise InvalidValue(
            f"property {name} has value {shown(value)}, which is not an {xsd_type}"
            + _ADVICE.get(local, "")
        )
    if local in _LARGEST and not abs(float(found)) <= min(_LARGEST[local], sys.float_info.max):
        raise InvalidValue(
            f"property {name} has value {shown(value)}; an {xsd_type} on the board is finite and "
            f"at most {min(_LARGEST[local], sys.float_info.max):.3g}"
        )
    if local in _INTEGER_RANGES:
        low, high = _INTEGER_RANGES[local]
        if not low <= int(found) <= high:
            raise InvalidValue(
                f"property {name} has value {shown(value)}; an {xsd_type} on the board lies in "
                f"[{low}, {high}]"
            )
    return found


_BOOLEANS = {"true": True, "1": True, "false": False, "0": False}
_ADVICE = {
    "boolean": "; give true or false",
    "string": "; give text without control characters and unpaired surrogates",
    "dateTime": "; give for example 2015-02-06T12:42:37Z",
}


def _text(local: str, value: Any) -> str | None:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        # A decimal has no exponent, so 1e-07 is written out.
        value = f"{Decimal(str(value)):f}" if local == "decimal" else str(value)
    return value if isinstance(value, str) and _LEXICAL[local].fullmatch(value) else None


def _number(value: Any) -> float | None:
    if isinstance(value, str):
        value = value.strip(_BLANKS)
        if not _FLOAT.fullmatch(value):
            return math.nan if value in ("NaN", "INF", "-INF", "+INF") else None
    elif isinstance(value, (bool, bytes, bytearray)):
        return None
    try:
        return float(value)
    except OverflowError:
        return math.inf
    except (TypeError, ValueError):
        return None


def _whole(value: Any) -> int | None:
    if isinstance(value, str):
        value = value.strip(_BLANKS)
        return int(value) if _INTEGER.fullmatch(value) else None
    if isinstance(value, (bool, bytes, bytearray)):
        return None
    try:
        number = int(value)
    except (TypeError, ValueError, OverflowError):
        return None
    return number if number == value else None


def shown(value: Any) -> str:
    """The value for a message, cut so that a huge one does not fill the log."""
    try:
        text = repr(value)
    except ValueError:  # Python refuses to print integers of more than 4,300 digits
        return "an integer of thousands of digits"
    return text if len(text) <= 120 else f"{text[:117]}..."
