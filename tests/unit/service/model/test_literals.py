from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from fluentboard.errors import InvalidValue
from fluentboard.model.literals import XSD_TYPES, Value, literal_value


@pytest.mark.parametrize(
    ("xsd_type", "given", "value"),
    [
        ("xsd:float", "10.30", 10.3),
        ("xsd:double", " 1e3\n", 1000.0),
        ("xsd:double", 5, 5.0),
        ("xsd:float", np.float32(0.5), 0.5),
        ("xsd:integer", "+007", 7),
        ("xsd:int", 3.0, 3),
        ("xsd:unsignedLong", 2**64 - 1, 2**64 - 1),
        ("xsd:boolean", "True", True),
        ("xsd:boolean", "0", False),
        ("xsd:boolean", 1, True),
        ("xsd:string", "", ""),
        ("xsd:string", "two\nlines\t…", "two\nlines\t…"),
        ("xsd:decimal", "10.30", "10.30"),
        ("xsd:decimal", 1e-07, "0.0000001"),
        ("xsd:dateTime", "2015-02-06T12:42:37.28Z", "2015-02-06T12:42:37.28Z"),
        ("xsd:date", "2015-02-06", "2015-02-06"),
        ("xsd:time", "12:42:37+01:00", "12:42:37+01:00"),
        ("xsd:duration", "P1DT2H", "P1DT2H"),
        ("xsd:anyURI", "file:///mug.stl", "file:///mug.stl"),
    ],
)
def test_a_value_becomes_the_python_type_of_its_xsd_type(xsd_type: str, given: Any, value: Value):
    found = literal_value("hasValue", xsd_type, given)
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    ("xsd_type", "given"),
    [
        ("xsd:float", "1_000"),
        ("xsd:float", "0x1"),
        ("xsd:float", "١"),
        ("xsd:float", ""),
        ("xsd:float", True),
        ("xsd:float", None),
        ("xsd:float", b"1.0"),
        ("xsd:integer", "1e3"),
        ("xsd:integer", "5.0"),
        ("xsd:integer", 5.5),
        ("xsd:integer", math.nan),
        ("xsd:integer", True),
        ("xsd:boolean", "yes"),
        ("xsd:boolean", None),
        ("xsd:string", None),
        ("xsd:string", True),
        ("xsd:string", ["a"]),
        ("xsd:string", "\x00"),
        ("xsd:string", "\ud800"),
        ("xsd:decimal", "1e3"),
        ("xsd:decimal", math.nan),
        ("xsd:dateTime", "2015-13-06T12:42:37Z"),
        ("xsd:dateTime", "2015-02-06"),
        ("xsd:duration", "P"),
        ("xsd:anyURI", "a b"),
    ],
)
def test_a_value_of_another_type_is_refused(xsd_type: str, given: Any):
    with pytest.raises(InvalidValue, match=f"hasValue has value .* is not an {xsd_type}"):
        literal_value("hasValue", xsd_type, given)


@pytest.mark.parametrize("given", [math.nan, math.inf, "INF", "NaN", "1e999", 10**400, 3.5e38])
def test_a_float_on_the_board_is_finite(given: Any):
    with pytest.raises(InvalidValue, match="an xsd:float on the board is finite"):
        literal_value("hasX", "xsd:float", given)


@pytest.mark.parametrize(
    ("xsd_type", "given"),
    [("xsd:byte", 128), ("xsd:nonNegativeInteger", -1), ("xsd:integer", 2**63)],
)
def test_an_integer_keeps_to_the_range_of_its_type(xsd_type: str, given: int):
    with pytest.raises(InvalidValue, match="lies in"):
        literal_value("hasCount", xsd_type, given)


def test_an_integer_too_long_to_print_is_refused_like_any_other():
    with pytest.raises(InvalidValue, match="thousands of digits"):
        literal_value("hasCount", "xsd:integer", 10**5000)


def test_an_unsupported_type_is_refused_with_all_supported_ones():
    with pytest.raises(InvalidValue, match="use one of") as failure:
        literal_value("hasPicture", "xsd:hexBinary", "00")
    assert all(f"xsd:{known}" in failure.value.message for known in XSD_TYPES)


def test_a_huge_value_is_cut_in_the_message():
    with pytest.raises(InvalidValue) as failure:
        literal_value("hasX", "xsd:float", "x" * 1_000_000)
    assert len(failure.value.message) < 300
