from __future__ import annotations

import pytest

from fluentboard.api import parameters
from fluentboard.clock import ReplayClock
from fluentboard.errors import InvalidInput, InvalidTime


@pytest.mark.parametrize(
    ("text", "value"), [("", True), ("true", True), ("1", True), ("no", False)]
)
def test_a_flag_may_stand_alone_or_have_a_value(text: str, value: bool) -> None:
    assert parameters.flag({"open": [text]}, "open") is value


def test_a_flag_that_is_neither_is_refused() -> None:
    with pytest.raises(InvalidInput, match="'maybe'; give true or false"):
        parameters.flag({"open": ["maybe"]}, "open")


def test_a_parameter_given_twice_is_refused() -> None:
    with pytest.raises(InvalidInput, match="given 2 times"):
        parameters.text({"class": ["Mug", "Plate"]}, "class")


@pytest.mark.parametrize("text", ["", "-1", "1.5", "x", "²", "0", "11", "99999999999999999999"])
def test_a_number_out_of_range_is_refused(text: str) -> None:
    with pytest.raises(InvalidInput, match="whole number from 1 to 10"):
        parameters.number({"limit": [text]}, "limit", least=1, most=10)


def test_now_is_the_present_of_the_board() -> None:
    assert parameters.time_s({"at": ["now"]}, "at", ReplayClock(12.5)) == 12.5


@pytest.mark.parametrize("text", ["nan", "inf", "soon", ""])
def test_a_time_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(InvalidTime, match="finite number of seconds"):
        parameters.time_s({"at": [text]}, "at", ReplayClock())


@pytest.mark.parametrize("text", ["1", "1,2,3", "2,1", "1,1", "a,b"])
def test_a_window_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(InvalidTime):
        parameters.window_s({"during": [text]}, "during")


def test_a_window_has_two_ends() -> None:
    assert parameters.window_s({"during": ["1,2.5"]}, "during") == (1.0, 2.5)
