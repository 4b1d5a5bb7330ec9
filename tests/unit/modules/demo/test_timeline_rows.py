"""Which fluents the time line shows, and how certain a bar looks."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_modules.demo.timeline import draw_timeline, rows_of, time_span


def a_chair(name: str, *poses: str) -> Fluent:
    links = tuple(Property("hasPose", "Pose", pose) for pose in poses)
    return Fluent(name, "Chair", Interval(None, 5.0), UNKNOWN, links)


def test_rows_are_sorted_by_class_and_number() -> None:
    names = ["chair10", "chair9", "table1"]
    fluents = [a_chair("chair10"), a_chair("chair9"), Fluent("table1", "Table")]
    assert [row.thing.name for row in rows_of(fluents, ["Table", "Chair"])] == names[::-1]


def test_poses_follow_each_other_in_time() -> None:
    late = Fluent("late", "Pose", Interval(7.0, 9.0))
    early = Fluent("early", "Pose", Interval(None, 5.0), Interval(7.0, 9.0))
    (row,) = rows_of([a_chair("chair1", "late", "early", "elsewhere"), late, early], ["Chair"])
    assert [pose.name for pose in row.poses] == ["early", "late"]


def test_span_covers_every_known_time() -> None:
    rows = rows_of([a_chair("chair1", "p"), Fluent("p", "Pose", Interval(7.0, 9.0))], ["Chair"])
    assert time_span(rows) == (5.0, 9.0)
    assert time_span(rows, 1.0, 40.0) == (1.0, 40.0)
    assert time_span([]) == (0.0, 1.0)


@pytest.mark.parametrize(
    ("start", "finish", "expected"),
    [
        # Opacity 10 s, 30 s and 50 s into a record of 60 s; 1.0 is certain, 0.0 impossible.
        (UNKNOWN, UNKNOWN, ("certain", "certain", "certain")),
        (Interval(None, 40.0), UNKNOWN, ("possible", "possible", "certain")),
        (Interval(5.0, 5.0), Interval(25.0, 40.0), ("certain", "possible", "impossible")),
        (Interval(20.0, 60.0), UNKNOWN, ("impossible", "possible", "possible")),
    ],
)
def test_bar_is_as_solid_as_the_fluent_is_certain(
    start: Interval, finish: Interval, expected: tuple[str, str, str]
) -> None:
    figure = Figure(figsize=(10.0, 1.0), dpi=60)
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    rows = rows_of([Fluent("chair1", "Chair", start, finish)], ["Chair"])
    draw_timeline(axes, rows, (1.0, 61.0))
    (image,) = axes.get_images()
    left, right, _, _ = image.get_extent()
    opacity = np.asarray(image.get_array())[0, :, 3]
    seen: list[str] = []
    for time_s in (11.0, 31.0, 51.0):
        share = (time_s - left) / (right - left)
        value = float(opacity[round(share * (opacity.size - 1))]) if 0.0 <= share <= 1.0 else 0.0
        seen.append("impossible" if value == 0.0 else "certain" if value == 1.0 else "possible")
    assert tuple(seen) == expected
