from __future__ import annotations

import math
from typing import Any

import pytest

from fluentboard.errors import (
    IntervalReversed,
    InvalidInput,
    InvalidName,
    InvalidTime,
    InvalidValue,
)
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard.model.json_format import fluent_from_json, fluent_to_json, interval_from_json

ON4 = Fluent(
    "on4",
    "On",
    UNKNOWN,
    Interval(119.621, 161.817),
    (Property("hasPhysicalEntity", "Mug", "mug1"),),
    version=7,
    author="mapping",
    created=3,
)
ON4_JSON = {
    "name": "on4",
    "class": "On",
    "start": [None, None],
    "finish": [119.621, 161.817],
    "properties": [{"property": "hasPhysicalEntity", "type": "Mug", "value": "mug1"}],
    "version": 7,
    "author": "mapping",
    "created": 3,
}


def test_unknown_times_are_null():
    assert fluent_to_json(ON4) == ON4_JSON


def test_a_fluent_survives_a_round_trip():
    assert fluent_from_json(ON4_JSON) == ON4


def test_name_and_class_are_enough():
    assert fluent_from_json({"name": "mug1", "class": "Mug"}) == Fluent("mug1", "Mug")


def test_a_property_may_be_a_triple():
    short = {"name": "mug1", "class": "Mug", "properties": [["hasX", "xsd:float", 1]]}
    assert fluent_from_json(short).properties == (Property("hasX", "xsd:float", 1.0),)


@pytest.mark.parametrize(
    ("value", "interval"),
    [
        (None, UNKNOWN),
        ([None, None], UNKNOWN),
        (5, Interval.at(5.0)),
        ([5, None], Interval(5.0, None)),
        ([None, 5], Interval(None, 5.0)),
    ],
)
def test_an_interval_is_null_a_number_or_a_pair(value: Any, interval: Interval):
    assert interval_from_json(value, "start") == interval


@pytest.mark.parametrize("value", [[], [1], [1, 2, 3], "5", {"earliest": 1}, True])
def test_an_interval_of_another_shape_is_refused(value: Any):
    with pytest.raises(InvalidInput, match=r"start is .*; give \[earliest, latest\]"):
        interval_from_json(value, "start")


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"start": [0.0, 5]}, InvalidTime, "'on4'.*start.earliest is 0.0"),
        ({"finish": [1, math.nan]}, InvalidTime, "finish.latest is nan"),
        ({"finish": [5, 1]}, IntervalReversed, "finish: interval ends before"),
        ({"start": 200}, IntervalReversed, "before it can have started"),
        ({"name": "on 4"}, InvalidName, "letters, digits"),
        ({"name": None}, InvalidName, "letters, digits"),
        ({"class": ["On"]}, InvalidName, "class"),
        ({"properties": None}, InvalidInput, "give a list"),
        ({"properties": "abc"}, InvalidInput, "give a list"),
        ({"properties": [["a", "b"]]}, InvalidInput, r"\[property, type, value\]"),
        ({"properties": [{"property": "a"}]}, InvalidInput, "give"),
        ({"properties": [["hasX", "xsd:float", "x"]]}, InvalidValue, "not an xsd:float"),
        ({"version": -1}, InvalidInput, "commit number"),
        ({"Class": "On"}, InvalidInput, "unknown key 'Class'"),
    ],
)
def test_what_is_wrong_is_named_with_its_place(
    change: dict[str, Any], error: type[InvalidInput], message: str
):
    with pytest.raises(error, match=message) as failure:
        fluent_from_json(ON4_JSON | change, "fluent 3 of the batch")
    assert "fluent 3 of the batch" in failure.value.message


@pytest.mark.parametrize("missing", ["name", "class"])
def test_name_and_class_are_required(missing: str):
    document = {key: value for key, value in ON4_JSON.items() if key != missing}
    with pytest.raises(InvalidInput, match=f"has no '{missing}'"):
        fluent_from_json(document)


@pytest.mark.parametrize("document", [None, [], "on4", 5])
def test_a_fluent_is_an_object(document: Any):
    with pytest.raises(InvalidInput, match="give a JSON object"):
        fluent_from_json(document)
