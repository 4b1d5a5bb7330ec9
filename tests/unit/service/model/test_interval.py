from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from fluentboard.errors import IntervalReversed, InvalidTime
from fluentboard.model.interval import UNKNOWN, Certainty, Interval, checked_time


def test_an_interval_keeps_both_sides():
    assert (Interval(1.5, 2.5).earliest, Interval(1.5, 2.5).latest) == (1.5, 2.5)


def test_a_point_known_exactly_has_equal_sides():
    assert Interval.at(3.0) == Interval(3.0, 3.0)


def test_an_interval_without_arguments_is_unknown():
    assert Interval() == UNKNOWN
    assert UNKNOWN.is_unknown


@pytest.mark.parametrize("half", [Interval(None, 2.0), Interval(2.0, None)])
def test_a_half_known_interval_is_not_unknown(half: Interval):
    assert not half.is_unknown


@pytest.mark.parametrize("number", [7, np.float32(7.0), np.int64(7)])
def test_any_real_number_becomes_a_float(number: Any):
    interval = Interval(number, number)
    assert interval == Interval(7.0, 7.0)
    assert type(interval.earliest) is float


@pytest.mark.parametrize("value", [0.0, -0.0, 0])
def test_zero_is_reserved(value: float):
    with pytest.raises(InvalidTime, match="reserved to mean unknown"):
        Interval(value, 5.0)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 10**400])
def test_a_time_is_finite(value: float):
    with pytest.raises(InvalidTime, match="finite number of seconds"):
        Interval(None, value)


@pytest.mark.parametrize("value", ["5.0", True, [5.0], 1j])
def test_a_time_is_a_number(value: Any):
    with pytest.raises(InvalidTime, match="give seconds as a number"):
        Interval(value, None)


def test_a_reversed_interval_is_refused_with_both_values():
    with pytest.raises(IntervalReversed, match=r"161\.8.*119\.6.*swap"):
        Interval(161.8, 119.6)


def test_a_time_error_names_what_it_is_about():
    with pytest.raises(InvalidTime, match=r"start\.earliest of 'on4' is nan"):
        checked_time(math.nan, "start.earliest of 'on4'")


def test_an_unknown_interval_admits_every_interval():
    assert all(UNKNOWN.admits(other) for other in (UNKNOWN, Interval(1, 2), Interval(None, 2)))


@pytest.mark.parametrize("narrower", [Interval(1, 4), Interval(2, 3), Interval(1, 1)])
def test_an_interval_admits_itself_and_narrower_ones(narrower: Interval):
    assert Interval(1, 4).admits(narrower)


@pytest.mark.parametrize(
    "other", [Interval(0.5, 4), Interval(1, 5), Interval(1, None), Interval(None, 4), UNKNOWN]
)
def test_an_interval_admits_nothing_wider(other: Interval):
    assert not Interval(1, 4).admits(other)


def test_a_half_known_interval_admits_what_respects_its_known_side():
    assert Interval(3, None).admits(Interval(3, 9))
    assert not Interval(3, None).admits(Interval(None, 9))


def test_certainty_is_ordered_so_that_min_is_and_and_max_is_or():
    assert min(Certainty.CERTAIN, Certainty.POSSIBLE) is Certainty.POSSIBLE
    assert max(Certainty.IMPOSSIBLE, Certainty.POSSIBLE) is Certainty.POSSIBLE
