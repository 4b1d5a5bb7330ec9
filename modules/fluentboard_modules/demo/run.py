"""`fluentboard demo`: service, subscription, mapping, query, search, pictures, in turn."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.syntax import Syntax

from fluentboard_client import Client
from fluentboard_modules.demo.findings import Finding, furniture_findings
from fluentboard_modules.demo.overview import (
    View,
    save_overview,
    view_of_frame,
    view_of_scene,
)
from fluentboard_modules.demo.searching import can_search, pictures_of, search_scene
from fluentboard_modules.demo.service_process import ServiceProcess
from fluentboard_modules.demo.telling import (
    LIVE_QUERY,
    announced,
    ask,
    headline,
    show_findings,
    tell_effort,
)
from fluentboard_modules.demo.timeline import rows_of, save_timeline, time_span
from fluentboard_modules.frames.sensor_frame import FrameSource
from fluentboard_modules.frames.sources import open_source
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.evaluation import TruePiece, true_furniture
from fluentboard_modules.mapping.map_frame import place, read_gravity
from fluentboard_modules.mapping.worker import MappingModule
from fluentboard_modules.progress import FrameProgress
from fluentboard_modules.simulation.scene import Scene
from fluentboard_modules.worker import run, stop_on_signals

FURNITURE = ("Table", "Desk", "Counter", "CoffeeTable", "Cabinet", "Shelf", "Chair", "Stool")
"""Classes of furniture in the order in which tables and pictures show them."""


def run_demo(frames: str, *, gravity: Path | None, keep: bool, output: Path) -> None:
    """Runs the demo from an empty board to pictures of what was found.

    Args:
        frames: as for `open_source`.
        gravity: file with the direction things fall.
        keep: leave the service up until Ctrl-C.
        output: folder for pictures and fluents.

    Raises:
        FluentboardError: the source is not what it should be, or a step failed.
    """
    console = Console(highlight=False)
    output.mkdir(parents=True, exist_ok=True)
    with (
        tempfile.TemporaryDirectory(prefix="fluentboard-demo-") as data,
        stop_on_signals() as stop,
    ):
        headline(console, "An empty board")
        with ServiceProcess(Path(data) / "board") as service:
            console.print(f"The service answers at [bold]{service.address}[/].")
            with Client(service.address, author="demo") as board:
                headline(console, "Mapping, and what a subscriber hears meanwhile")
                config = MappingConfig()
                source, T_map_world = place(
                    open_source(frames), config, gravity and read_gravity(gravity)
                )
                module = MappingModule(source.name, T_map_world, config)
                console.print(Syntax(LIVE_QUERY, "sparql", background_color="default"))
                with (
                    Client(service.address, author=module.name) as writer,
                    announced(board, console),
                    FrameProgress(console) as progress,
                ):
                    report = run(module, source, writer, progress=progress, stop=stop)
                tell_effort(console, report)
                headline(console, "What the board knows now")
                findings = present_furniture(board)
                show_findings(console, findings, true_pieces(source))
                headline(console, "Where can something be put down?")
                ask(console, board)
                scene: Scene | None = getattr(source, "scene", None)
                if scene is not None and can_search(scene) and not stop.is_asked:
                    headline(console, "A guest asks for the pepper mill")
                    search_scene(board, console, scene, module.span_s[-1], stop, output)
                headline(console, "Pictures")
                written = _draw(board, module, source, findings, output)
                written += pictures_of(output)
                for path, what in written:
                    console.print(f"  [bold]{path}[/]  {what}")
            if keep and not stop.is_asked:
                console.print(
                    f"\nThe board stays at [bold]{service.address}[/]; for example\n"
                    f"  fluentboard watch -b {service.address} "
                    "'SELECT ?chair WHERE { ?chair a furniture:Chair }'\n"
                    "Ctrl-C ends it."
                )
                while not stop.wait(3600.0):
                    pass


def present_furniture(board: Client) -> list[Finding]:
    """The furniture that the board knows at present, by class and name."""
    parts = {
        fluent.name: fluent
        for class_name in ("Pose", "BBox", "Plane")
        for fluent in board.fluents(class_name, is_open=True)
    }
    found = furniture_findings(board.fluents("Furniture", is_open=True), parts)
    return sorted(found, key=lambda finding: (_rank(finding.class_name), finding.name))


def true_pieces(source: FrameSource) -> list[TruePiece] | None:
    """The furniture that is really there, if the source is a simulation."""
    scene: Scene | None = getattr(source, "scene", None)
    return None if scene is None else true_furniture(scene, FURNITURE)


def _draw(
    board: Client,
    module: MappingModule,
    source: FrameSource,
    findings: Sequence[Finding],
    output: Path,
) -> list[tuple[Path, str]]:
    everything = list(board.fluents())
    rows = [row for row in rows_of(everything, FURNITURE) if row.poses]
    title = f"What the board remembers of {Path(source.name).name}"
    what = {
        "map.png": "planes and furniture from above",
        "view.png": "the frame that shows most of the furniture",
    }
    written = [(path, what[path.name]) for path in module.draw(output)]
    span_s = time_span(rows, *module.span_s)
    view = _view(module, source)
    if view is not None:
        overview = save_overview(view, findings, rows, span_s, output / "overview.png", title=title)
        written.insert(0, (overview, "the room, and its fluents on a time line"))
    timeline = save_timeline(rows, span_s, output / "timeline.png", title=title)
    written.append((timeline, "the fluents on a time line"))
    exported = output / "fluents.yaml"
    with exported.open("wb") as file:
        for piece in board.export("yaml"):
            file.write(piece)
    written.append((exported, f"everything on the board: {len(everything)} fluents"))
    return written


def _view(module: MappingModule, source: FrameSource) -> View | None:
    """The simulated room from outside, or what the most telling frame shows of a real one."""
    scene = getattr(source, "scene", None)
    if scene is not None:
        return view_of_scene(scene)
    frame = module.best_view
    return None if frame is None else view_of_frame(frame)


def _rank(class_name: str) -> int:
    return FURNITURE.index(class_name) if class_name in FURNITURE else len(FURNITURE)
