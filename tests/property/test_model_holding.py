"""Whether a fluent holds, against trying all possible starts and finishes."""

from __future__ import annotations

import itertools
import math

from hypothesis import assume, given
from hypothesis import strategies as st

from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Certainty, Interval

LAST = 6
TIMES = st.none() | st.integers(1, LAST).map(float)
# Times between and on the endpoints are all that can matter; beyond them lies "unknown".
GRID = [step / 2 for step in range(-1, 2 * LAST + 3)]


@st.composite
def intervals(draw: st.DrawFn) -> Interval:
    earliest, latest = draw(TIMES), draw(TIMES)
    if earliest is not None and latest is not None:
        earliest, latest = min(earliest, latest), max(earliest, latest)
    return Interval(earliest, latest)


def candidates(interval: Interval, when_unknown: float) -> list[float]:
    """All points of the grid, and infinity, that the interval admits."""
    if interval.is_unknown:
        return [when_unknown]
    low = -math.inf if interval.earliest is None else interval.earliest
    high = math.inf if interval.latest is None else interval.latest
    return [time_s for time_s in [-math.inf, *GRID, math.inf] if low <= time_s <= high]


@given(intervals(), intervals())
def test_holding_is_what_all_or_some_pairs_of_endpoints_say(start: Interval, finish: Interval):
    begins, ends = start.earliest, finish.latest
    assume(begins is None or ends is None or begins <= ends)
    fluent = Fluent("on4", "On", start, finish)
    # A fluent that ends at once never held, so a pair with start = finish still counts.
    pairs = [
        (s, f)
        for s, f in itertools.product(candidates(start, -math.inf), candidates(finish, math.inf))
        if s <= f
    ]
    assert pairs
    for time_s in GRID:
        answers = {s <= time_s < f for s, f in pairs}
        expected = (
            Certainty.POSSIBLE
            if len(answers) == 2
            else Certainty.CERTAIN
            if True in answers
            else Certainty.IMPOSSIBLE
        )
        assert fluent.holds_at(time_s) is expected
