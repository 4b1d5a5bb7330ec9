"""`fluentboard work search` and `fluentboard search`: a robot that searches, and asking for it."""

from __future__ import annotations

import json
import logging
import time
import uuid
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from fluentboard.clock import SystemClock
from fluentboard.errors import BoardUnreachable, InvalidInput
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Interval
from fluentboard_client import Client
from fluentboard_modules.frames.live import FramePublisher
from fluentboard_modules.search.config import SearchConfig
from fluentboard_modules.search.record import SearchRecord
from fluentboard_modules.search.region import SearchVolume
from fluentboard_modules.search.request import read_request, request_fluents
from fluentboard_modules.search.worker import SearchWorker
from fluentboard_modules.search.worlds import IMAGE_WIDTH, RECOGNITION_WIDTH, open_world
from fluentboard_modules.worker import stop_on_signals

logger = logging.getLogger(__name__)

_LOOK_AGAIN_S = 0.5


def run_search_worker(
    source: str,
    board_url: str,
    *,
    robot: str = "PR2",
    name: str = "",
    map_file: Path | None = None,
    publish: bool = False,
    recognition_s: float = 0.0,
    recognise: bool = False,
    once: bool = False,
    seed: int = 0,
    token: str | None = None,
    config: SearchConfig | None = None,
    plot: Path | None = None,
) -> list[SearchRecord]:
    """Serves search requests of a board with a robot of `source`; see `SearchWorker`.

    Args:
        source: see `open_world`.
        board_url: address of the board.
        robot: model of the robot.
        name: of the robot on the board; the model's in lower case if not given.
        map_file: kept map.
        publish: send frames to the board, as those of the sensor of the robot's name.
        recognition_s: how long to wait after every look for who recognises things.
        recognise: in simulation, recognise what is sought without an anchoring worker.
        once: end after one request.
        seed: of everything random.
        token: bearer token.
        config: for what requests leave open.
        plot: pictures of the searches go there.
    """
    name = name or robot.lower()
    world = open_world(
        source,
        robot,
        seed,
        SystemClock().now_s(),
        RECOGNITION_WIDTH if publish else IMAGE_WIDTH,
    )
    with (
        stop_on_signals() as stop,
        Client(board_url, author=f"search/{name}", token=token) as board,
    ):
        publisher = FramePublisher(board_url, name, token=token) if publish else None
        worker = SearchWorker(
            world,
            board,
            stop,
            name=name,
            config=config,
            seed=seed,
            map_file=map_file,
            publisher=publisher,
            recognition_s=recognition_s,
            plot=plot,
            recognise=recognise,
        )
        try:
            worker.run(once)
        except BoardUnreachable:
            if not stop.is_asked:
                raise
        finally:
            if publisher is not None:
                publisher.close()
        return worker.records


def ask_for(
    board_url: str,
    *,
    target_class: str = "",
    target_name: str = "",
    volumes: Sequence[SearchVolume] = (),
    source: str = "",
    settings: Mapping[str, float] | None = None,
    is_afresh: bool = False,
    wait_s: float | None = None,
    token: str | None = None,
    told: Callable[[Fluent], object] = lambda progress: None,
) -> Fluent:
    """Asks for a search and waits for its end.

    Args:
        board_url: address of the board.
        target_class: what is sought, by class.
        target_name: what is sought, by name.
        volumes: where; none: above the placing areas on the board.
        source: where the probabilities shall come from.
        settings: `hasTimeBudget` and so on.
        is_afresh: forget before the search what maps know of the volumes.
        wait_s: at most so long; 0: only ask; None: until it ends.
        token: bearer token.
        told: hears of every new progress fluent.

    Whoever interrupts the waiting (Ctrl-C) cancels the search.

    Returns:
        The activity as it then stands: with `hasResult` and perhaps `hasFoundObject`, if it ended.

    Raises:
        InvalidInput: no robot would serve such a request; nothing has been written.
    """
    name = f"search_{target_name or target_class}_{uuid.uuid4().hex[:8]}"
    fluents = request_fluents(
        name,
        target_class=target_class,
        target_name=target_name,
        volumes=[SearchVolume(f"{v.name}_{name}", v.box, v.probability) for v in volumes],
        source=source,
        settings=settings,
        is_afresh=is_afresh,
        start=Interval.at(SystemClock().now_s()),
    )
    by_name = {fluent.name: fluent for fluent in fluents}
    read_request(by_name[name], by_name, SearchConfig())  # refuses here what robots would refuse
    with Client(board_url, author="search-request", token=token) as board:
        board.assert_fluents(fluents)
        if target_class and not _is_known(board, target_class):
            logger.warning("the board knows no class %r: is it spelled so?", target_class)
        try:
            return _await_end(board, name, wait_s, told)
        except KeyboardInterrupt:
            _end(board, name)
            raise


def cancel(board_url: str, search: str, token: str | None = None) -> None:
    """Ends a search, whoever serves it; one that has ended stays as it is.

    Args:
        board_url: address of the board.
        search: name of the activity.
        token: bearer token.

    Raises:
        InvalidInput: what has that name is no search.
    """
    with Client(board_url, author="search-request", token=token) as board:
        _end(board, search)


def _end(board: Client, search: str) -> None:
    activity = board.fluent(search)
    if activity.class_name != "SearchObjectActivity":
        raise InvalidInput(f"{search!r} is no search but a {activity.class_name}; give a search")
    if activity.finish.is_unknown:
        # Robots in a simulation may be ahead of our clock.
        start = activity.start.latest or 0.0
        board.end(search, max(SystemClock().now_s(), start))


def _await_end(
    board: Client, search: str, wait_s: float | None, told: Callable[[Fluent], object]
) -> Fluent:
    begun = time.monotonic()
    heard: set[str] = set()
    while True:
        activity = board.fluent(search)
        for progress in map(str, activity.values("hasSearchProgress")):
            if progress not in heard:
                heard.add(progress)
                told(board.fluent(progress))
        if not activity.finish.is_unknown and activity.values("hasResult"):
            return activity
        if wait_s is not None and time.monotonic() - begun >= wait_s:
            return activity
        time.sleep(_LOOK_AGAIN_S)


def _is_known(board: Client, class_name: str) -> bool:
    """Whether an ontology of the board has a class of that short name."""
    short = json.dumps("#" + class_name.rpartition("#")[2].rpartition(":")[2])
    return board.ask(
        f"ASK {{ ?class rdfs:subClassOf ?above . FILTER(STRENDS(STR(?class), {short})) }}"
    )
