"""Boxes filtered over views, of which some show a part only."""

from __future__ import annotations

import numpy as np
import pytest

from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.anchoring.config import FilterConfig
from fluentboard_modules.anchoring.estimate import BoxEstimate
from fluentboard_modules.anchoring.observation import Cluster

CONFIG = FilterConfig()


def view(x: float, long: float, stamp_s: float, *, is_cut_off: bool = False) -> Cluster:
    return Cluster(
        np.zeros((0, 3)),
        np.zeros((0, 2), dtype=np.int64),
        BoundingBox(Pose(x, 0.0, 0.8), long, 0.2, 0.1),
        stamp_s,
        np.array([0.0, -2.0, 1.5]),
        is_cut_off=is_cut_off,
    )


def seen_whole(times: int) -> BoxEstimate:
    estimate = BoxEstimate.of_cluster(view(1.0, 0.4, 1.0), CONFIG)
    for k in range(times):
        estimate = estimate.updated(view(1.0, 0.4, 2.0 + k), 1.0, CONFIG)
    return estimate


def test_the_border_of_the_image_does_not_move_an_object() -> None:
    estimate = seen_whole(5)
    for k in range(40):
        # The border leaves the left half to be seen.
        estimate = estimate.updated(view(0.9, 0.2, 10.0 + k, is_cut_off=True), 1.0, CONFIG)
    assert estimate.centre_map[0] == pytest.approx(1.0, abs=0.005)
    assert estimate.size[0] == pytest.approx(0.4, abs=0.01)


def test_a_part_beside_the_known_box_moves_it() -> None:
    estimate = seen_whole(5)
    for k in range(40):
        estimate = estimate.updated(view(0.75, 0.2, 10.0 + k, is_cut_off=True), 1.0, CONFIG)
    # The part ends at 0.65, where the whole must begin by now.
    assert estimate.centre_map[0] - 0.5 * estimate.size[0] == pytest.approx(0.65, abs=0.02)


def test_views_of_parts_do_not_make_the_place_more_certain() -> None:
    estimate = seen_whole(5)
    before = estimate.largest_sigma_m
    for k in range(40):
        estimate = estimate.updated(view(0.9, 0.2, 10.0 + k, is_cut_off=True), 0.1, CONFIG)
    assert estimate.largest_sigma_m >= before


def test_a_whole_view_far_away_is_the_object_moved() -> None:
    estimate = seen_whole(5).updated(view(1.5, 0.4, 20.0), 1.0, CONFIG)
    assert estimate.centre_map[0] == pytest.approx(1.5)
