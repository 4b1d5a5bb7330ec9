"""Compiled sizes and heights agree with NumPy's."""

from __future__ import annotations

import numpy as np
import pytest

from fluentboard_modules.anchoring.extents import (
    covered_cells,
    heights_above,
    largest_of,
    quantile,
    turned_extent,
)


@pytest.mark.parametrize("count", [1, 2, 7, 300])
@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.95, 1.0])
def test_quantiles_are_those_of_numpy(count: int, share: float) -> None:
    values = np.sort(np.random.default_rng(count).normal(size=count))
    assert quantile(values, share) == pytest.approx(np.quantile(values, share))


@pytest.mark.parametrize("count", [3, 60, 1000])
def test_extents_are_trimmed_at_both_ends(count: int) -> None:
    flat = np.random.default_rng(count).uniform(-1.0, 1.0, (count, 2)) * (0.2, 0.05)
    angle, *ends = turned_extent(flat, 0.01, 400)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    expected = np.quantile(flat @ turn.T, [0.01, 0.99], axis=0).T.ravel()
    assert ends == pytest.approx(expected.tolist())


def test_a_turned_rectangle_is_found_with_its_long_side_along() -> None:
    rng = np.random.default_rng(0)
    flat = rng.uniform(-1.0, 1.0, (2000, 2)) * (0.1, 0.02)
    cos, sin = np.cos(2.0), np.sin(2.0)
    angle, a, b, c, d = turned_extent(flat @ np.array([[cos, sin], [-sin, cos]]), 0.0, 400)
    assert np.cos(2.0 * (angle - 2.0)) > 0.99
    assert (b - a, d - c) == pytest.approx((0.2, 0.04), abs=0.02)


def test_heights_are_of_second_order() -> None:
    points, centre = np.array([[2.0, 3.0, 9.0], [1.0, 1.0, 9.0]]), np.array([1.0, 1.0])
    assert heights_above(points, centre, np.array([1.0, 2, 3, 4, 5, 6])) == pytest.approx([47, 1])


def test_points_beside_the_grid_are_not_covered() -> None:
    inside = np.array([[True, False], [True, True]])
    points = np.array([[0.05, 0.05], [0.05, 0.15], [0.15, 0.15], [-0.05, 0.05], [0.25, 0.0]])
    assert covered_cells(points, 0.1, 0, 0, inside).tolist() == [True, False, True, False, False]


def test_the_largest_value_of_each_label() -> None:
    labels, values = np.array([[0, 1], [2, 1]]), np.array([[9.0, 1.0], [5.0, 3.0]])
    assert largest_of(labels, values, 4).tolist() == [9.0, 3.0, 5.0, 0.0]
