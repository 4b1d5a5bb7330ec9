"""A search in a simulated room: it ends, it counts its time, it survives what goes wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fluentboard.errors import InvalidInput, UnreachableView
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.search.config import PlannerConfig, SearchConfig, ViewSamplingConfig
from fluentboard_modules.search.execution import ObjectSearch
from fluentboard_modules.search.occupancy import OccupancyMap
from fluentboard_modules.search.record import Moment, SearchRecord, SearchStep
from fluentboard_modules.search.region import SearchVolume, region_of
from fluentboard_modules.simulation.robots import PR2, View
from fluentboard_modules.simulation.search_scenes import SearchScene, hidden_pepper_mill
from fluentboard_modules.simulation.watchful_robot import WatchfulSimulatedRobot

CONFIG = SearchConfig(
    resolution_m=0.1,
    threshold=0.2,
    new_views=5,
    sampling=ViewSamplingConfig(views=25, rays=(32, 24)),
    planner=PlannerConfig(rounds_max=3, idle_rounds=2),
)


@pytest.fixture(scope="module")
def room() -> SearchScene:
    return hidden_pepper_mill(1)


def search_in(
    room: SearchScene, config: SearchConfig = CONFIG, robot: WatchfulSimulatedRobot | None = None
) -> ObjectSearch:
    if robot is None:
        robot = WatchfulSimulatedRobot(
            PR2, room.scene, room.start, np.random.default_rng(0), image_width=80
        )
    occupancy = OccupancyMap(config.resolution_m)
    volumes = [SearchVolume(v.name, v.box, 0.2) for v in room.scene.search_volumes]
    return ObjectSearch(
        robot,
        occupancy,
        region_of(occupancy, volumes),
        robot.costmap,
        config,
        np.random.default_rng(1),
    )


def test_a_search_goes_on_until_little_is_left_to_see(room: SearchScene) -> None:
    search = search_in(room)
    search.look_around()
    steps: list[SearchStep] = []
    while (step := search.step()) is not None:
        steps.append(step)
        assert len(steps) < 40
    record = search.record
    assert record.outcome == "below-threshold"
    assert record.steps == steps
    probability = [m.probability for m in record.moments]
    assert probability == sorted(probability)
    assert probability[-1] > 0.4
    assert 0.0 < record.expected_time_s(with_planning=False) < record.duration_s
    assert all(step.revealed_cells >= step.kept_cells >= 0 for step in steps)
    kept = sum(step.kept_cells for step in steps) / sum(step.expected_cells for step in steps)
    assert kept > 0.75  # what views promise comes true, on the way or at the view
    assert sum(len(step.path) > 1 for step in steps) > 2


def test_the_same_seed_gives_the_same_search(room: SearchScene) -> None:
    searches = [search_in(room), search_in(room)]
    for search in searches:
        search.step()
        search.step()
    first, second = (search.record for search in searches)
    assert [s.view for s in first.steps] == [s.view for s in second.steps]


def test_a_search_ends_with_its_budget(room: SearchScene) -> None:
    search = search_in(room, CONFIG.model_copy(update={"time_budget_s": 1.0}))
    assert search.step() is not None
    assert search.step() is None
    assert search.record.outcome == "out-of-time"


class StubbornRobot(WatchfulSimulatedRobot):
    """Does not get anywhere."""

    def move_to(self, view: View) -> float:
        raise UnreachableView("something stands in the way; remove it")


def test_a_view_that_cannot_be_reached_is_given_up(room: SearchScene) -> None:
    robot = StubbornRobot(PR2, room.scene, room.start, np.random.default_rng(0), image_width=80)
    search = search_in(room, robot=robot)
    first, second = search.step(), search.step()
    assert first is not None
    assert second is not None
    assert not first.is_reached
    assert first.view not in second.candidates
    assert second.view != first.view


def test_on_its_way_the_robot_watches_what_it_passes_and_has_not_seen(room: SearchScene) -> None:
    search = search_in(room)
    region, occupancy = search.region, search.occupancy
    near = region.volumes[0].box.pose
    way = np.array([[near.x + 0.2, near.y], [near.x + 0.4, near.y]])
    watched = region.worth_watching(occupancy, way, 1.0)
    assert np.hypot(*(watched[:2] - (near.x, near.y))) < 0.2
    # What has been seen is worth no look.
    occupancy.set_cells(region.cells[region.members[0]], -1.0)
    watched = region.worth_watching(occupancy, way, 20.0)
    assert np.hypot(*(watched[:2] - (near.x, near.y))) > 0.3
    # Where nothing is in reach, the middle of all will do.
    nowhere = np.full((2, 2), 100.0)
    assert region.worth_watching(occupancy, nowhere, 1.0) == pytest.approx(region.centre(occupancy))


def test_cells_of_others_are_left_to_them(room: SearchScene) -> None:
    search = search_in(room)
    search.elsewhere[:] = True
    assert search.step() is None
    assert search.record.outcome == "exhausted"


def test_the_step_is_shown_before_the_robot_moves(room: SearchScene) -> None:
    search = search_in(room)
    shown: list[View] = []
    step = search.step(lambda planned: shown.append(planned.view))
    assert step is not None
    assert shown == [step.view]


def test_a_view_that_somebody_else_has_just_claimed_is_left_to_him(room: SearchScene) -> None:
    search = search_in(room)
    refused: list[SearchStep] = []

    def claim(planned: SearchStep) -> bool:
        if refused:
            return True
        refused.append(planned)
        search.elsewhere[search.cells_seen_from(PR2.T_map_sensor(planned.view))] = True
        return False

    step = search.step(claim)
    assert step is not None
    assert step.view != refused[0].view
    assert [s.view for s in search.record.steps] == [step.view]


def test_the_expected_time_weighs_each_second_with_the_chance_to_need_it() -> None:
    record = SearchRecord(View(0.0, 0.0, 0.0))
    record.moments += [Moment(10.0, 1.0, 0.5), Moment(20.0, 1.0, 0.5), Moment(30.0, 2.0, 0.75)]
    assert record.expected_time_s(False) == pytest.approx(10.0 + 5.0 + 5.0)
    assert record.expected_time_s() == pytest.approx(10.0 + 5.0 + 5.0 + 1.0 + 0.5)


def test_what_is_too_far_to_be_recognised_stays_unseen(room: SearchScene) -> None:
    searches = [
        search_in(room, CONFIG.model_copy(update={"detector_range_m": range_m}))
        for range_m in (None, 1.5)
    ]
    for search in searches:
        step = search.step()
        assert step is not None
    far, near = searches
    left = near.region.unknown(near.occupancy)
    view = near.record.steps[-1].view
    eye = PR2.T_map_sensor(view).translation
    seen = near.occupancy.centres(near.region.cells[~left])
    assert len(seen)
    assert np.linalg.norm(seen - eye, axis=1).max() < 1.5 + 2 * CONFIG.resolution_m
    assert left.sum() > far.region.unknown(far.occupancy).sum()


def test_a_detector_that_reaches_no_farther_than_the_camera_is_blind_is_refused(
    room: SearchScene,
) -> None:
    with pytest.raises(InvalidInput, match="detector range"):
        search_in(room, CONFIG.model_copy(update={"detector_range_m": 0.2}))


def test_a_detector_that_misses_gets_a_second_look(room: SearchScene) -> None:
    sure = search_in(room, CONFIG.model_copy(update={"threshold": 0.1}))
    unsure = search_in(room, CONFIG.model_copy(update={"threshold": 0.1, "recall": 0.5}))
    for search in (sure, unsure):
        while search.step() is not None:
            assert len(search.record.steps) < 60
    assert len(unsure.record.steps) > len(sure.record.steps)
    assert unsure.region.looks.max() >= 2
    assert sure.region.looks.max() == 0
    # Half of what the first look at a cell would have shown is still to be found there.
    once = unsure.region.looks == 1
    belief = unsure.region.probability(unsure.occupancy)[once & ~unsure.region.excluded]
    prior = unsure.region.prior[once & ~unsure.region.excluded]
    assert belief == pytest.approx(0.5 * prior / (1.0 - 0.5 * prior))


def test_a_higher_threshold_ends_a_search_earlier(room: SearchScene) -> None:
    patient = search_in(room)
    hasty = search_in(room, CONFIG.model_copy(update={"threshold": 0.5}))
    for search in (patient, hasty):
        while search.step() is not None:
            pass
        assert search.record.outcome == "below-threshold"
    assert hasty.record.duration_s < patient.record.duration_s
    assert hasty.record.probability < patient.record.probability


class BlindRobot(WatchfulSimulatedRobot):
    """Its camera measures nothing."""

    def sense(self) -> SensorFrame:
        frame = super().sense()
        return replace(frame, depth_m=np.zeros_like(frame.depth_m))

    def frames_on_the_way(self) -> tuple[tuple[float, SensorFrame], ...]:
        return ()


def test_views_that_never_keep_their_promise_are_blacklisted(room: SearchScene) -> None:
    robot = BlindRobot(PR2, room.scene, room.start, np.random.default_rng(0), image_width=80)
    config = CONFIG.model_copy(update={"misses_max": 1, "new_views": 0})
    search = search_in(room, config, robot)
    while search.step() is not None:
        assert len(search.record.steps) < 40
    assert search.region.excluded.any()
    assert search.record.probability == 0.0
    promised = [step.expected_cells for step in search.record.steps]
    assert all(promised)  # no view is taken for what it failed to show before
    assert int(search.region.excluded.sum()) == sum(promised)
    # What is given up was not seen.
    assert not any(step.revealed_cells or step.kept_cells for step in search.record.steps)


def test_gaps_that_cannot_hold_the_object_are_not_searched(room: SearchScene) -> None:
    search = search_in(room)
    search.step()
    robot = WatchfulSimulatedRobot(
        PR2, room.scene, room.start, np.random.default_rng(0), image_width=80
    )
    small = ObjectSearch(
        robot,
        search.occupancy,
        region_of(
            search.occupancy, [SearchVolume(v.name, v.box, 0.2) for v in room.scene.search_volumes]
        ),
        robot.costmap,
        CONFIG.model_copy(update={"object_size_m": 0.4}),
        np.random.default_rng(1),
    )
    assert small.region.excluded.any()
    assert not small.region.probability(small.occupancy)[small.region.excluded].any()
