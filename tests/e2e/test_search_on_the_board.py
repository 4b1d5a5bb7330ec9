"""Searches on a real board: requests, claims of several robots, context, success and cancelling."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from fluentboard.errors import InvalidInput, UnreachableView
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_client import Client
from fluentboard_modules.demo.service_process import ServiceProcess
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.geometry_fluents import pose_fluent
from fluentboard_modules.search.board_memory import BoardMemory
from fluentboard_modules.search.config import PlannerConfig, SearchConfig, ViewSamplingConfig
from fluentboard_modules.search.occupancy import OccupancyMap
from fluentboard_modules.search.octomap_files import read_octomap, write_octomap
from fluentboard_modules.search.record import SearchRecord
from fluentboard_modules.search.region import SearchVolume
from fluentboard_modules.search.request import read_request, request_fluents
from fluentboard_modules.search.run import cancel
from fluentboard_modules.search.worker import SearchWorker
from fluentboard_modules.search.worlds import open_world
from fluentboard_modules.simulation.robots import PR2, View
from fluentboard_modules.simulation.search_scenes import hidden_pepper_mill
from fluentboard_modules.simulation.watchful_robot import WatchfulSimulatedRobot
from fluentboard_modules.worker import StopRequest

QUICK = SearchConfig(
    resolution_m=0.1,
    new_views=5,
    sampling=ViewSamplingConfig(views=25, rays=(40, 30)),
    planner=PlannerConfig(rounds_max=3, idle_rounds=2),
)
SOURCE = "sim:search?seed=1"


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServiceProcess]:
    with ServiceProcess(tmp_path_factory.mktemp("search") / "board") as running:
        yield running


HASTY = QUICK.model_copy(update={"time_budget_s": 40.0})


@cache
def volumes_of_the_room() -> Mapping[str, BoundingBox]:
    return open_world(SOURCE).volumes


def ask(
    board: Client,
    name: str,
    *,
    source: str = "",
    cls: str = "PepperMill",
    is_afresh: bool = False,
) -> None:
    volumes = [
        SearchVolume(f"{name}_{volume}", box, 0.2) for volume, box in volumes_of_the_room().items()
    ]
    board.assert_fluents(
        request_fluents(
            name,
            target_class=cls,
            volumes=volumes,
            source=source,
            is_afresh=is_afresh,
            start=Interval.at(1.0),
        )
    )


def serve(
    service: ServiceProcess, robot: str = "pr2", config: SearchConfig = QUICK
) -> SearchRecord:
    with Client(service.address, author=f"search/{robot}") as board:
        worker = SearchWorker(
            open_world(SOURCE, start_s=2.0),
            board,
            StopRequest(),
            name=robot,
            config=config,
            recognise=config is QUICK,
            seed=len(robot),
        )
        worker.run(once=True)
        return worker.records[-1]


def test_a_search_finds_the_mill_and_the_board_tells_the_story(service: ServiceProcess) -> None:
    with Client(service.address) as board:
        ask(board, "search_mill")
        record = serve(service)
        assert record.outcome == "found"
        activity = board.fluent("search_mill")
        assert not activity.finish.is_unknown
        assert list(activity.values("hasResult")) == ["found"]
        (mill,) = activity.values("hasFoundObject")
        assert board.fluent(str(mill)).class_name == "PepperMill"
        views = [board.fluent(str(v)) for v in activity.values("hasView")]
        assert len(views) == len(record.steps)
        assert not any(view.finish.is_unknown for view in views)
        seen = [
            float(board.fluent(str(p)).values("hasCumulativeProbability")[0])
            for p in activity.values("hasSearchProgress")
        ]
        assert seen == sorted(seen)
        # What is known already needs no search.
        ask(board, "search_again")
        assert serve(service).steps == []


def test_robots_share_a_search_by_claiming_views(service: ServiceProcess) -> None:
    with Client(service.address) as board:
        ask(board, "search_shared", cls="Vase")
        records: dict[str, SearchRecord] = {}

        def go(robot: str) -> None:
            records[robot] = serve(service, robot, HASTY)

        threads = [threading.Thread(target=go, args=(robot,)) for robot in ("left", "right2")]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        activity = board.fluent("search_shared")
        assert not activity.finish.is_unknown
        assert len(activity.values("hasResult")) == 1
        assert set(map(str, activity.values("hasRobot"))) == {"left", "right2"}
        looks = [len(record.steps) for record in records.values()]
        assert all(looks)
        assert not any(
            board.fluent(str(view)).finish.is_unknown for view in activity.values("hasView")
        )


def test_robots_that_think_alike_do_not_look_alike(service: ServiceProcess) -> None:
    """Equal robots at one place, asked at once, without volumes that they could agree upon."""
    with Client(service.address) as board:
        start = Interval.at(50.0)  # their clocks stand at 2
        board.assert_fluents(request_fluents("search_alike", target_class="Vase", start=start))
        both = threading.Barrier(2)

        class Together(WatchfulSimulatedRobot):
            """Waits for the other before its first plan."""

            looks = 0

            def sense(self) -> SensorFrame:
                if self.looks == 0:
                    both.wait(20.0)
                self.looks += 1
                return super().sense()

        def go(name: str) -> None:
            room = hidden_pepper_mill(1)
            robot = Together(
                PR2, room.scene, room.start, np.random.default_rng(0), image_width=80, start_s=2.0
            )
            with Client(service.address, author=f"search/{name}") as own:
                world = replace(open_world(SOURCE), robot=robot)
                SearchWorker(world, own, StopRequest(), name=name, config=HASTY).run(once=True)

        threads = [threading.Thread(target=go, args=(name,)) for name in ("pr6", "pr7")]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        activity = board.fluent("search_alike")
        assert not activity.finish.is_unknown
        assert activity.finish.earliest is not None
        assert activity.finish.earliest > 50.0
        taken = [
            board.fluent(str(pose)).values("hasX") + board.fluent(str(pose)).values("hasY")
            for view in map(board.fluent, map(str, activity.values("hasView")))
            if list(view.values("hasViewOutcome")) == ["taken"]
            for pose in view.values("hasPose")
        ]
        assert len(taken) > 1
        assert len(set(taken)) == len(taken)


def test_ending_the_activity_cancels_the_search(service: ServiceProcess) -> None:
    with Client(service.address) as board:
        ask(board, "search_cancelled", cls="Candle")

        class Interrupted(WatchfulSimulatedRobot):
            """Somebody ends the search while it drives to its first view."""

            def move_to(self, view: View) -> float:
                if board.fluent("search_cancelled").finish.is_unknown:
                    board.end("search_cancelled", 5.0)
                return super().move_to(view)

        room = hidden_pepper_mill(1)
        robot = Interrupted(
            PR2, room.scene, room.start, np.random.default_rng(0), None, image_width=80, start_s=2.0
        )
        world = replace(open_world(SOURCE), robot=robot)
        worker = SearchWorker(world, board, StopRequest(), name="pr3", config=QUICK)
        worker.run(once=True)
        assert worker.records[-1].outcome == "cancelled"
        assert len(worker.records[-1].steps) == 1
        assert list(board.fluent("search_cancelled").values("hasResult")) == ["cancelled"]


def test_a_search_is_cancelled_by_name(service: ServiceProcess) -> None:
    with Client(service.address) as board:
        ask(board, "search_by_name", cls="Vase")
        cancel(service.address, "search_by_name")
        assert not board.fluent("search_by_name").finish.is_unknown
        cancel(service.address, "search_by_name")  # it has ended, and stays so
        with pytest.raises(InvalidInput, match="no search"):
            cancel(service.address, "poseBBSearch_by_name_around_table1")


def test_a_search_survives_a_goal_that_fails_and_a_board_that_crashes(tmp_path: Path) -> None:
    """The robot goes on while the board is away, and tells everything when it is back."""
    first = ServiceProcess(tmp_path / "board")
    first.start()
    again = ServiceProcess(tmp_path / "board", port=int(first.address.rsplit(":", 1)[1]))
    back = threading.Timer(0.5, again.start)
    goals: list[View] = []

    class Unlucky(WatchfulSimulatedRobot):
        """Its first goal fails, and on its way to the second the board crashes."""

        def move_to(self, view: View) -> float:
            goals.append(view)
            if len(goals) == 1:
                raise UnreachableView("somebody stands in the way")
            if len(goals) == 2:
                first.kill()
                back.start()
            return super().move_to(view)

    room = hidden_pepper_mill(1)
    robot = Unlucky(
        PR2, room.scene, room.start, np.random.default_rng(0), None, image_width=80, start_s=2.0
    )
    try:
        with Client(first.address, author="search/pr2") as board:
            ask(board, "search_unlucky")
            world = replace(open_world(SOURCE), robot=robot)
            worker = SearchWorker(
                world, board, StopRequest(), name="pr2", config=QUICK, recognise=True
            )
            worker.run(once=True)
            record = worker.records[-1]
            assert record.outcome == "found"
            assert [step.is_reached for step in record.steps[:2]] == [False, True]
            assert all(view != goals[0] for view in goals[1:])
            activity = board.fluent("search_unlucky")
            assert list(activity.values("hasResult")) == ["found"]
            views = [board.fluent(str(v)) for v in activity.values("hasView")]
            assert [list(v.values("hasViewOutcome")) for v in views[:2]] == [
                ["unreachable"],
                ["taken"],
            ]
            assert len(views) == len(record.steps)
    finally:
        if back.ident is not None:
            back.join()
        first.kill()
        again.kill()


def test_a_robot_that_knows_everything_looks_again_when_it_shall_search_afresh(
    service: ServiceProcess, tmp_path: Path
) -> None:
    kept = tmp_path / "kept.bt"
    known = OccupancyMap(QUICK.resolution_m)
    for box in volumes_of_the_room().values():
        known.set_cells(known.cells_in(box), -1.0)
    write_octomap(known, kept)
    with Client(service.address, author="search/pr4") as board:
        worker = SearchWorker(
            open_world(SOURCE, start_s=2.0),
            board,
            StopRequest(),
            name="pr4",
            config=QUICK.model_copy(update={"time_budget_s": 12.0}),
            map_file=kept,
        )
        ask(board, "search_known", cls="Fork")
        worker.run(once=True)
        assert worker.records[-1].outcome == "exhausted"
        assert not worker.records[-1].steps
        ask(board, "search_afresh", cls="Fork", is_afresh=True)
        worker.run(once=True)
        assert worker.records[-1].steps
        # What it saw is kept, and the board says where.
        assert read_octomap(kept).known_count > known.known_count
        assert list(board.fluent("occupancyMap_pr4").values("hasMapFile")) == [str(kept)]


def test_a_search_waits_for_who_recognises_what_it_has_seen(service: ServiceProcess) -> None:
    with Client(service.address, author="search/pr5") as board:
        ask(board, "search_spoon", cls="Spoon")
        since = Interval.at(3.0)

        def recognise() -> None:
            with Client(service.address, author="anchoring") as other:
                pose = pose_fluent("poseSpoon", Pose(1.0, 2.0, 0.8), since)
                link = Property("hasPose", "Pose", pose.name)
                other.assert_fluents([pose, Fluent("spoon1", "Spoon", since, UNKNOWN, (link,))])

        late = threading.Timer(1.0, recognise)
        worker = SearchWorker(
            open_world(SOURCE, start_s=2.0),
            board,
            StopRequest(),
            name="pr5",
            config=QUICK,
            recognition_s=30.0,
        )
        late.start()
        worker.run(once=True)
        late.join()
        assert worker.records[-1].outcome == "found"
        assert worker.records[-1].steps == []  # it had seen enough from where it stood
        assert list(board.fluent("search_spoon").values("hasFoundObject")) == ["spoon1"]


def test_what_is_hardly_recognised_ends_no_search_that_wants_to_be_sure(
    service: ServiceProcess,
) -> None:
    since = Interval.at(3.0)
    pose = pose_fluent("poseVase7", Pose(1.0, 2.0, 0.8), since)
    vase = Fluent("vase7", "Jug", since, UNKNOWN, (Property("hasPose", "Pose", pose.name),))
    with Client(service.address, author="anchoring") as board:
        board.assert_fluents([pose, vase])
        for number, (confidence, is_found) in enumerate([(0.4, False), (0.8, True)]):
            evidence = (
                Property("isEvidenceFor", "Jug", "vase7"),
                Property("hasConfidence", "xsd:double", confidence),
            )
            board.assert_fluents(
                Fluent(f"classEvidence{number}", "ClassEvidence", since, UNKNOWN, evidence)
            )
            asked = request_fluents(
                f"search_sure{number}",
                target_class="Jug",
                settings={"hasMinimumConfidence": 0.6},
                start=Interval.at(4.0),
            )
            board.assert_fluents(asked)
            memory = BoardMemory(board, "pr8", lambda: False)
            request = read_request(asked[-1], {}, QUICK)
            assert (memory.found(request) is not None) is is_found
            board.end(f"search_sure{number}", 5.0)


def test_the_context_of_anchoring_sets_the_probabilities(service: ServiceProcess) -> None:
    with Client(service.address) as board:
        ask(board, "search_context", source="context", cls="Flowers")
        activity = board.fluent("search_context")
        volumes = [str(v) for v in activity.values("hasSearchVolume")]
        likely = volumes[-1]
        for volume in volumes:
            board.assert_fluents(
                Fluent(
                    f"belief_{volume}",
                    "VolumeBelief",
                    Interval.at(1.0),
                    properties=(
                        Property("isBeliefOfSearch", "SearchObjectActivity", "search_context"),
                        Property("isBeliefAbout", "SearchVolume", volume),
                        Property("hasProbability", "xsd:double", 0.9 if volume == likely else 0.01),
                        Property("hasProbabilitySource", "xsd:string", "context"),
                    ),
                )
            )
        record = serve(service, config=HASTY)
        assert record.steps
        box = volumes_of_the_room()[likely.removeprefix("search_context_")]
        first = record.steps[0].view
        away = np.hypot(first.x - box.pose.x, first.y - box.pose.y)
        assert away < 3.2


def test_a_request_that_cannot_be_served_fails(service: ServiceProcess) -> None:
    with Client(service.address) as board:
        board.assert_fluents(Fluent("search_nothing", "SearchObjectActivity", Interval.at(1.0)))
        with Client(service.address, author="search/pr2") as other:
            SearchWorker(
                open_world(SOURCE, start_s=2.0), other, StopRequest(), name="pr2", config=QUICK
            ).run(once=True)
        assert list(board.fluent("search_nothing").values("hasResult")) == ["failed"]
