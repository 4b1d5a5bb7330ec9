"""`fluentboard demo`: service, subscription, mapping, query, pictures, one after the other."""

from __future__ import annotations

import contextlib
import tempfile
import threading
import time
from collections.abc import Generator, Sequence
from pathlib import Path

from rich.console import Console
from rich.rule import Rule
from rich.syntax import Syntax
from rich.table import Table
from rich.text import Text

from fluentboard.errors import FluentboardError
from fluentboard_client import Client, Delta, Row, Snapshot
from fluentboard_client.results import term_text
from fluentboard_modules.demo.findings import (
    Finding,
    Match,
    TruePiece,
    compare,
    furniture_findings,
)
from fluentboard_modules.demo.overview import save_overview
from fluentboard_modules.demo.service_process import ServiceProcess
from fluentboard_modules.demo.timeline import rows_of, save_timeline, time_span
from fluentboard_modules.frames.sensor_frame import FrameSource
from fluentboard_modules.frames.sources import open_source
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.map_frame import place, read_gravity
from fluentboard_modules.mapping.worker import MappingModule
from fluentboard_modules.progress import FrameProgress
from fluentboard_modules.worker import WorkReport, run, stop_on_signals

FURNITURE = ("Table", "Desk", "Counter", "CoffeeTable", "Cabinet", "Shelf", "Chair", "Stool")
"""Classes of furniture in the order in which tables and pictures show them."""

LIVE_QUERY = """\
SELECT ?thing ?class ?x ?y WHERE {
  ?class rdfs:subClassOf furniture:Furniture .
  ?thing a ?class ; upper:hasPose ?pose .
  ?pose upper:hasX ?x ; upper:hasY ?y ; upper:hasFinishEarliest ?end .
  FILTER(?end = "INF"^^xsd:double)
}"""

QUESTION = """\
SELECT ?area ?of ?height ?length ?width WHERE {
  ?area a race:PlacingArea ; race:isAreaOf ?of ; upper:hasBoundingBox ?box .
  ?box upper:hasXSize ?length ; upper:hasYSize ?width ;
       upper:hasPose/upper:hasZ ?height ; upper:hasFinishEarliest ?end .
  FILTER(?end = "INF"^^xsd:double)
} ORDER BY ?area"""


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
        _headline(console, "An empty board")
        with ServiceProcess(Path(data) / "board") as service:
            console.print(f"The service answers at [bold]{service.address}[/].")
            with Client(service.address, author="demo") as board:
                _headline(console, "Mapping, and what a subscriber hears meanwhile")
                config = MappingConfig()
                source, T_map_world = place(
                    open_source(frames), config, gravity and read_gravity(gravity)
                )
                module = MappingModule(source.name, T_map_world, config)
                console.print(Syntax(LIVE_QUERY, "sparql", background_color="default"))
                with (
                    Client(service.address, author=module.name) as writer,
                    _announced(board, console),
                    FrameProgress(console) as progress,
                ):
                    report = run(module, source, writer, progress=progress, stop=stop)
                _tell_effort(console, report)
                _headline(console, "What the board knows now")
                findings = present_furniture(board)
                _show_findings(console, findings, true_pieces(source))
                _headline(console, "Where can something be put down?")
                _ask(console, board)
                _headline(console, "Pictures")
                written = _draw(board, module, source, findings, output)
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
    scene = getattr(source, "scene", None)
    if scene is None:
        return None
    return [
        TruePiece(instance.name, instance.cls, instance.box)
        for instance in scene.objects
        if instance.cls in FURNITURE
    ]


def _headline(console: Console, text: str) -> None:
    console.print()
    console.print(Rule(Text(text, "bold"), align="left", style="dim"))


@contextlib.contextmanager
def _announced(board: Client, console: Console) -> Generator[None, None, None]:
    """Prints the changes of the live query as they arrive."""
    subscription = board.subscribe(LIVE_QUERY)
    arrived = threading.Event()
    heard = 0

    def listen() -> None:
        nonlocal heard
        try:
            for event in subscription:
                if isinstance(event, Snapshot):
                    console.print(f"  commit {event.commit:>4}  {len(event.rows)} rows so far")
                elif isinstance(event, Delta):
                    heard = event.commit
                    for line in delta_lines(event):
                        console.print(line)
                arrived.set()
        except FluentboardError as problem:
            console.print(f"[red]{problem}[/]")
            arrived.set()

    listener = threading.Thread(target=listen, daemon=True)
    listener.start()
    arrived.wait(10.0)
    try:
        yield
    finally:
        # The last changes are on their way: wait until nothing has come for a moment.
        quiet_since, last = time.monotonic(), heard
        while time.monotonic() - quiet_since < 0.3:
            time.sleep(0.05)
            if heard != last:
                quiet_since, last = time.monotonic(), heard
        subscription.close()
        listener.join()


def delta_lines(delta: Delta) -> list[Text]:
    """A change of the live query in words: one line for each thing that came, moved or went."""
    gone = {term_text(row["thing"]): row for row in delta.removed}
    lines: list[Text] = []
    for row in delta.added:
        name = term_text(row["thing"])
        before = gone.pop(name, None)
        start = Text(f"  commit {delta.commit:>4}  ")
        if before is None:
            lines.append(
                start
                + Text("+ ", "green")
                + Text(f"{name:<10}", "bold")
                + Text(f" a {term_text(row['class'])} at {_place(row)}")
            )
        else:
            lines.append(
                start
                + Text("~ ", "yellow")
                + Text(f"{name:<10}", "bold")
                + Text(f" {_place(before)} → {_place(row)}", "dim")
            )
    lines += [
        Text(f"  commit {delta.commit:>4}  ") + Text("- ", "red") + Text(name, "bold")
        for name in gone
    ]
    return lines


def _place(row: Row) -> str:
    x, y = (value if isinstance(value, float) else 0.0 for value in (row["x"], row["y"]))
    return f"({x:.2f}, {y:.2f})"


def _tell_effort(console: Console, report: WorkReport) -> None:
    per_frame = report.duration_s / max(report.frames, 1)
    console.print(
        f"{report.frames} frames in {report.duration_s:.1f} s ({per_frame:.2f} s each), "
        f"{report.commands} commands written, last commit {report.commit}."
    )


def _show_findings(
    console: Console, findings: Sequence[Finding], truth: list[TruePiece] | None
) -> None:
    matches = (
        [Match(finding, None) for finding in findings]
        if truth is None
        else compare(findings, truth)
    )
    table = _plain_table()
    for name in ("fluent", "class"):
        table.add_column(name)
    for name in ("x", "y", "top", "size", "seen in", "sure"):
        table.add_column(name, justify="right")
    if truth is not None:
        table.add_column("truth")
    for match in matches:
        table.add_row(*_cells(match, with_truth=truth is not None))
    console.print(table)
    if truth is not None:
        right = sum(match.found is not None and match.true is not None for match in matches)
        console.print(
            f"{right} of {len(truth)} pieces found, "
            f"{sum(match.true is None for match in matches)} invented."
        )


def _cells(match: Match, *, with_truth: bool) -> list[Text]:
    found, true = match.found, match.true
    if found is None:
        assert true is not None
        empty = [Text("")] * 6
        return [Text(f"({true.name})", "dim"), Text(true.class_name), *empty, Text("missed", "red")]
    box = found.box
    top = box.pose.z + 0.5 * box.z_size
    cells = [
        Text(found.name, "bold"),
        Text(found.class_name),
        Text(f"{box.pose.x:.2f}"),
        Text(f"{box.pose.y:.2f}"),
        Text(f"{top:.3f} m"),
        Text(f"{box.x_size:.2f} x {box.y_size:.2f}"),
        Text(f"{found.frames} frames" if found.frames else ""),
        Text("" if found.confidence is None else f"{100.0 * found.confidence:.0f} %"),
    ]
    if with_truth:
        cells.append(
            Text("invented", "red")
            if true is None
            else Text(f"{100.0 * match.distance_m:.1f} cm off", "green")
        )
    return cells


def _plain_table() -> Table:
    return Table(box=None, pad_edge=False, header_style="dim", padding=(0, 2, 0, 0))


def _ask(console: Console, board: Client) -> None:
    console.print(Syntax(QUESTION, "sparql", background_color="default"))
    rows = board.select(QUESTION)
    table = _plain_table()
    for name in rows[0] if rows else ():
        is_number = all(isinstance(row[name], (int, float)) for row in rows)
        table.add_column(name, justify="right" if is_number else "left")
    for row in rows:
        table.add_row(*(Text(_short(value)) for value in row.values()))
    console.print(table)


def _short(value: object) -> str:
    return f"{value:.2f}" if isinstance(value, float) else term_text(value)  # type: ignore[arg-type]


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
    scene = getattr(source, "scene", None)
    if scene is not None:
        overview = save_overview(
            scene, findings, rows, span_s, output / "overview.png", title=title
        )
        written.insert(0, (overview, "the room, and its fluents on a time line"))
    timeline = save_timeline(rows, span_s, output / "timeline.png", title=title)
    written.append((timeline, "the fluents on a time line"))
    exported = output / "fluents.yaml"
    with exported.open("wb") as file:
        for piece in board.export("yaml"):
            file.write(piece)
    written.append((exported, f"everything on the board: {len(everything)} fluents"))
    return written


def _rank(class_name: str) -> int:
    return FURNITURE.index(class_name) if class_name in FURNITURE else len(FURNITURE)
