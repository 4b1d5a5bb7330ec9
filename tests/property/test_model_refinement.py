"""Facts are only narrowed: what refining and merging may and may not do."""

from __future__ import annotations

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from fluentboard.errors import IntervalReversed, NotARefinement
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Certainty, Interval

# Few values, so that accounts often touch, contain and contradict each other.
TIMES = st.none() | st.integers(1, 8).map(float)
STATEMENTS = st.sampled_from([Property("hasPose", "Pose", f"pose{i}") for i in range(4)])


@st.composite
def intervals(draw: st.DrawFn) -> Interval:
    earliest, latest = draw(TIMES), draw(TIMES)
    if earliest is not None and latest is not None:
        earliest, latest = min(earliest, latest), max(earliest, latest)
    return Interval(earliest, latest)


@st.composite
def accounts(draw: st.DrawFn) -> Fluent:
    start, finish = draw(intervals()), draw(intervals())
    begins, ends = start.earliest, finish.latest
    assume(begins is None or ends is None or begins <= ends)
    return Fluent("mug1", "Mug", start, finish, tuple(draw(st.lists(STATEMENTS, max_size=4))))


def merged(first: Fluent, second: Fluent) -> Fluent | None:
    """Both accounts as one, or None if they contradict each other."""
    try:
        return first.merged(second)
    except NotARefinement:
        return None


def same_facts(first: Fluent | None, second: Fluent | None) -> bool:
    """Equal but for the order of the statements."""
    if first is None or second is None:
        return first is second
    return (first.start, first.finish, set(first.properties)) == (
        second.start,
        second.finish,
        set(second.properties),
    )


def admits(interval: Interval, time_s: float) -> bool:
    return (interval.earliest is None or interval.earliest <= time_s) and (
        interval.latest is None or time_s <= interval.latest
    )


@given(accounts())
def test_merging_an_account_with_itself_changes_nothing(account: Fluent):
    assert account.merged(account) is account


@given(accounts(), accounts())
def test_merging_twice_is_merging_once(known: Fluent, said: Fluent):
    once = merged(known, said)
    assume(once is not None)
    assert once is not None
    assert once.merged(said) is once


@given(accounts(), accounts())
def test_the_order_of_two_accounts_does_not_matter(first: Fluent, second: Fluent):
    assert same_facts(merged(first, second), merged(second, first))


@given(accounts(), accounts(), accounts())
def test_the_grouping_of_three_accounts_does_not_matter(a: Fluent, b: Fluent, c: Fluent):
    ab, bc = merged(a, b), merged(b, c)
    left = None if ab is None else merged(ab, c)
    right = None if bc is None else merged(a, bc)
    assert same_facts(left, right)


@given(accounts(), accounts())
def test_merging_never_widens_and_never_forgets(known: Fluent, said: Fluent):
    after = merged(known, said)
    assume(after is not None)
    assert after is not None
    for before in (known, said):
        assert before.start.admits(after.start)
        assert before.finish.admits(after.finish)
        assert set(before.properties) <= set(after.properties)
    assert after.properties[: len(known.properties)] == known.properties


@given(intervals(), intervals())
def test_two_starts_merge_to_the_times_that_both_admit(known: Interval, said: Interval):
    after = merged(Fluent("mug1", "Mug", known), Fluent("mug1", "Mug", said))
    half_steps = [0.25 + step / 2 for step in range(18)] + [float(step) for step in range(1, 9)]
    common = {t for t in half_steps if admits(known, t) and admits(said, t)}
    assert common == (set() if after is None else {t for t in half_steps if admits(after.start, t)})


@given(accounts(), intervals(), intervals())
def test_refining_is_merging_that_refuses_to_say_less(
    known: Fluent, start: Interval, finish: Interval
):
    narrower = known.start.admits(start) and known.finish.admits(finish)
    try:
        after = known.refined(start, finish)
    except NotARefinement:
        assert not narrower
    except IntervalReversed:
        assert narrower
    else:
        assert narrower
        assert after == known.merged(Fluent("mug1", "Mug", start, finish))


@given(accounts(), st.integers(1, 8).map(float))
def test_an_ended_fluent_can_only_end_there_again(known: Fluent, end_s: float):
    try:
        ended = known.ended(end_s)
    except (NotARefinement, IntervalReversed):
        return
    assert ended.ended(end_s) == ended
    for other in (end_s + 0.5, Interval(end_s, end_s + 1.0)):
        with pytest.raises((NotARefinement, IntervalReversed)):
            ended.ended(other)
    assert ended.holds_at(end_s) is Certainty.IMPOSSIBLE


@given(accounts(), accounts(), st.integers(0, 18).map(lambda step: step / 2))
def test_narrowing_known_bounds_never_takes_a_certain_answer_back(
    known: Fluent, said: Fluent, time_s: float
):
    # A wholly unknown end means "since ever" or "until further notice", which news may change.
    assume(not known.start.is_unknown and not known.finish.is_unknown)
    after = merged(known, said)
    assume(after is not None)
    assert after is not None
    before = known.holds_at(time_s)
    assert before is Certainty.POSSIBLE or after.holds_at(time_s) is before
