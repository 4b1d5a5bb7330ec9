"""The state machine of anchors (Figure 4.4): every transition, and no other."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.anchoring.anchors import (
    Anchor,
    AnchorState,
    IllegalTransition,
    destroy,
    discover,
    find,
    lose,
    reacquire,
    track,
)
from fluentboard_modules.anchoring.config import FilterConfig
from fluentboard_modules.anchoring.observation import Cluster, Detection, Recognition

CONFIG = FilterConfig()


def a_detection(
    x: float = 1.0, stamp_s: float = 10.0, track_id: int = 4, confidence: tuple[float, ...] = (1.0,)
) -> Detection:
    box = BoundingBox(Pose(x, 0.0, 0.75), 0.08, 0.08, 0.1)
    cluster = Cluster(
        points_map=np.zeros((1, 3)),
        pixels=np.zeros((1, 2), dtype=np.int64),
        box=box,
        stamp_s=stamp_s,
        viewpoint_map=np.array([0.0, 0.0, 1.5]),
        track_id=track_id,
    )
    names = ("Mug", "Fork", "Plate")[: len(confidence)]
    return Detection(cluster, Recognition(names, np.array(confidence)))


def an_untracked_anchor() -> Anchor:
    return find(1, "mug1", "Mug", BoundingBox(Pose(1.0, 0.0, 0.75), 0.08, 0.08, 0.1), 1)


def a_tracked_anchor() -> Anchor:
    return discover(1, a_detection(), CONFIG)


def test_find_makes_an_untracked_anchor_of_a_fluent() -> None:
    anchor = an_untracked_anchor()
    assert anchor.state is AnchorState.UNTRACKED
    assert (anchor.name, anchor.class_name, anchor.is_external) == ("mug1", "Mug", True)
    assert anchor.last_seen_s is None


def test_discover_makes_a_tracked_anchor_of_an_object() -> None:
    anchor = a_tracked_anchor()
    assert anchor.state is AnchorState.TRACKED
    assert (anchor.track_id, anchor.observations) == (4, 1)
    assert (anchor.first_seen_s, anchor.last_seen_s) == (10.0, 10.0)


def test_reacquire_binds_an_untracked_anchor_to_a_track() -> None:
    anchor = reacquire(an_untracked_anchor(), a_detection(track_id=9), CONFIG)
    assert anchor.state is AnchorState.TRACKED
    assert (anchor.track_id, anchor.name) == (9, "mug1")


def test_track_updates_a_tracked_anchor() -> None:
    anchor = track(a_tracked_anchor(), a_detection(stamp_s=10.2), CONFIG)
    assert anchor.state is AnchorState.TRACKED
    assert (anchor.observations, anchor.last_seen_s) == (2, 10.2)


def test_lose_forgets_the_track_and_nothing_else() -> None:
    before = a_tracked_anchor()
    after = lose(before)
    assert after.state is AnchorState.UNTRACKED
    assert after.track_id is None
    assert after.box == before.box


def test_destroy_takes_untracked_anchors() -> None:
    destroy(an_untracked_anchor())


@pytest.mark.parametrize(
    "act",
    [
        lambda: track(an_untracked_anchor(), a_detection(), CONFIG),
        lambda: lose(an_untracked_anchor()),
        lambda: reacquire(a_tracked_anchor(), a_detection(), CONFIG),
        lambda: destroy(a_tracked_anchor()),
    ],
)
def test_other_transitions_are_refused(act: Callable[[], object]) -> None:
    with pytest.raises(IllegalTransition, match="applies to"):
        act()


def test_confidence_is_the_mean_of_what_was_reported() -> None:
    anchor = discover(1, a_detection(confidence=(1.0, 0.0)), CONFIG)
    anchor = track(anchor, a_detection(confidence=(0.0, 1.0)), CONFIG)
    assert anchor.confidence == pytest.approx([0.5, 0.5])
    assert anchor.last_confidence == pytest.approx([0.0, 1.0])


def test_more_views_make_the_centre_more_certain() -> None:
    anchor = a_tracked_anchor()
    before = anchor.estimate.sigma_m(CONFIG)
    for k in range(10):
        anchor = track(anchor, a_detection(x=1.0, stamp_s=10.1 + 0.1 * k), CONFIG)
    after = anchor.estimate.sigma_m(CONFIG)
    assert np.all(after < before)
    assert np.all(after >= CONFIG.pose_sigma_m)  # the camera's own error does not average out


def test_centre_is_less_certain_along_the_line_of_sight() -> None:
    sigma = a_tracked_anchor().estimate.sigma_m(CONFIG)
    assert sigma[0] > sigma[1]  # seen along x


def test_object_that_was_moved_is_where_it_is_now() -> None:
    anchor = a_tracked_anchor()
    for k in range(20):
        anchor = track(anchor, a_detection(x=1.0, stamp_s=10.1 + 0.1 * k), CONFIG)
    anchor = track(anchor, a_detection(x=1.5, stamp_s=12.2), CONFIG)
    assert anchor.centroid_map[0] == pytest.approx(1.5)
