"""The last act of the demo: somebody asks for something, and a robot searches until it is found."""

from __future__ import annotations

import threading
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.syntax import Syntax

from fluentboard.errors import FluentboardError
from fluentboard.model.interval import Interval
from fluentboard_client import Client, Delta, Row, term_text
from fluentboard_modules.search.record import SearchRecord
from fluentboard_modules.search.request import request_fluents
from fluentboard_modules.search.worker import SearchWorker
from fluentboard_modules.search.worlds import SearchWorld, world_in_scene
from fluentboard_modules.simulation.navigation import costmap
from fluentboard_modules.simulation.robots import ROBOTS, View
from fluentboard_modules.simulation.scene import Scene
from fluentboard_modules.worker import StopRequest

TARGET_CLASS = "PepperMill"
_SEARCH = "search1"
_ROBOT = "PR2"
_PAUSE_S = 10.0  # between the end of the drive and the question

PROGRESS_QUERY = """\
SELECT ?looks ?seconds ?seen ?left WHERE {
  ?search a race:SearchObjectActivity ; race:hasSearchProgress ?progress .
  ?progress race:hasViewCount ?looks ; race:hasElapsedTime ?seconds ;
            race:hasCumulativeProbability ?seen ; race:hasRemainingProbability ?left .
}"""
"""How far the searches on the board have come."""

STORY_QUERY = """\
SELECT ?result ?found ?class ?x ?y ?z WHERE {
  ?search a race:SearchObjectActivity ; upper:hasResult ?result .
  OPTIONAL { ?search race:hasFoundObject ?found . ?found a ?class ; upper:hasPose ?pose .
             ?pose upper:hasX ?x ; upper:hasY ?y ; upper:hasZ ?z . }
}"""
"""How they ended."""


def can_search(scene: Scene | None) -> bool:
    """There is something to search for, and a room to do it in."""
    return scene is not None and bool(scene.of_class(TARGET_CLASS))


def search_scene(
    board: Client, console: Console, scene: Scene, last_s: float, stop: StopRequest, output: Path
) -> SearchRecord | None:
    """Asks the board for a pepper mill, and lets a robot of the scene answer.

    The robot knows what the board knows: the placing areas that mapping has written. Its own map of
    the room is empty at first.

    Args:
        board: where it is asked, and where the story is told.
        console: hears of the progress.
        scene: what the robot stands in.
        last_s: time of the last frame on the board.
        stop: how to end it early.
        output: pictures go to a folder in there.

    Returns:
        What happened; None if it was stopped before.
    """
    began_s = last_s + _PAUSE_S
    world = _world(scene, began_s)
    board.assert_fluents(
        request_fluents(_SEARCH, target_class=TARGET_CLASS, start=Interval.at(began_s))
    )
    console.print(
        f"A guest asks for a {TARGET_CLASS}: the fluent [bold]{_SEARCH}[/] of the class "
        "SearchObjectActivity is on the board, and a robot takes it up.\n"
        "It looks above the placing areas that mapping has found."
    )
    console.print(Syntax(PROGRESS_QUERY, "sparql", background_color="default"))
    worker = SearchWorker(
        world, board, stop, name=_ROBOT.lower(), seed=1, recognise=True, plot=output
    )
    with _progress_told(board, console):
        worker.run(once=True)
    for row in board.select(STORY_QUERY):
        console.print(f"  {_sentence(row)}")
    return worker.records[0] if worker.records else None


def pictures_of(output: Path) -> list[tuple[Path, str]]:
    """The pictures of the search that are worth naming."""
    what = {
        "search.gif": "the search as a film",
        "probability.png": "the probability of having seen it, over time",
    }
    folder = output / _SEARCH
    found = [(folder / name, text) for name, text in what.items()]
    last = sorted(folder.glob("look*.png"))[-1:]
    found += [(path, "the last look, with what was still unseen") for path in last]
    return [(path, text) for path, text in found if path.exists()]


def _world(scene: Scene, start_s: float) -> SearchWorld:
    """A robot as far from all that is sought as it can drive."""
    model = ROBOTS[_ROBOT]
    room = costmap(scene, model.radius_m)
    sought = [thing.T_map_model.translation[:2] for thing in scene.of_class(TARGET_CLASS)]
    # What can be driven to from where there is most room.
    open_place = np.unravel_index(int(np.argmin(room.cost)), room.cost.shape)
    costs = room.path_costs(*room.position(int(open_place[0]), int(open_place[1])))
    rows, columns = np.nonzero(np.isfinite(costs))
    places = np.array([room.position(int(r), int(c)) for r, c in zip(rows, columns, strict=True)])
    nearest = np.min([np.linalg.norm(places - spot, axis=1) for spot in sought], axis=0)
    x, y = places[int(np.argmax(nearest))].tolist()
    aside = float(np.arctan2(*(places.mean(axis=0) - (x, y))[::-1]))
    view = View(x, y, aside)
    return world_in_scene(scene, model, view, np.random.default_rng(1), start_s)


@contextmanager
def _progress_told(board: Client, console: Console) -> Generator[None, None, None]:
    """Prints the progress as subscribers hear of it."""
    subscription = board.subscribe(PROGRESS_QUERY)
    is_listening = threading.Event()

    def listen() -> None:
        try:
            for event in subscription:
                is_listening.set()
                if isinstance(event, Delta):
                    for row in event.added:
                        console.print(f"  commit {event.commit:>4}  {_progress(row)}")
        except FluentboardError as problem:
            console.print(f"[red]{problem}[/]")
        is_listening.set()

    listener = threading.Thread(target=listen, daemon=True)
    listener.start()
    is_listening.wait(10.0)
    try:
        yield
    finally:
        listener.join(0.5)
        subscription.close()
        listener.join()


def _progress(row: Row) -> str:
    seconds, seen, left = (_number(row, key) for key in ("seconds", "seen", "left"))
    return (
        f"look {term_text(row['looks'])} after {seconds:.0f} s: {100.0 * seen:.0f} % of the "
        f"chances seen; before it, {100.0 * left:.0f} % were left to find it"
    )


def _sentence(row: Row) -> str:
    if row.get("found") is None:
        return f"The search ended: {term_text(row['result'])}."
    x, y, z = (_number(row, key) for key in "xyz")
    return (
        f"[green]Found[/]: [bold]{term_text(row['found'])}[/], a {term_text(row['class'])} at "
        f"({x:.2f}, {y:.2f}), {z:.2f} m above the floor."
    )


def _number(row: Row, key: str) -> float:
    value = row[key]
    return float(value) if isinstance(value, (int, float)) else 0.0
