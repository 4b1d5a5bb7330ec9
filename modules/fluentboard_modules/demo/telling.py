"""What the demo prints: headlines, changes as they arrive, tables of findings and answers."""

from __future__ import annotations

import threading
import time
from collections.abc import Generator, Sequence
from contextlib import contextmanager

from rich.console import Console
from rich.rule import Rule
from rich.syntax import Syntax
from rich.table import Table
from rich.text import Text

from fluentboard.errors import FluentboardError
from fluentboard_client import Client, Delta, Row, Snapshot, Term, term_text
from fluentboard_modules.demo.findings import Finding
from fluentboard_modules.mapping.evaluation import Match, TruePiece, compare
from fluentboard_modules.worker import WorkReport

LIVE_QUERY = """\
SELECT ?thing ?class ?x ?y WHERE {
  ?class rdfs:subClassOf furniture:Furniture .
  ?thing a ?class ; upper:hasPose ?pose .
  ?pose upper:hasX ?x ; upper:hasY ?y ; upper:hasFinishEarliest ?end .
  FILTER(?end = "INF"^^xsd:double)
}"""
"""Where every open piece of furniture stands at present."""

QUESTION = """\
SELECT ?area ?of ?height ?length ?width WHERE {
  ?area a race:PlacingArea ; race:isAreaOf ?of ; upper:hasBoundingBox ?box .
  ?box upper:hasXSize ?length ; upper:hasYSize ?width ;
       upper:hasPose/upper:hasZ ?height .
} ORDER BY ?area"""
"""Where something can be put down; asked for the present, so that ended boxes are not seen."""


def headline(console: Console, text: str) -> None:
    """Begins a section."""
    console.print()
    console.print(Rule(Text(text, "bold"), align="left", style="dim"))


@contextmanager
def announced(board: Client, console: Console) -> Generator[None, None, None]:
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
    start = Text(f"  commit {delta.commit:>4}  ")
    gone = {term_text(row["thing"]): row for row in delta.removed}
    lines: list[Text] = []
    for row in delta.added:
        name, place = term_text(row["thing"]), _place(row)
        before = gone.pop(name, None)
        if before is None:
            sign = Text("+ ", "green")
            change = Text(f"a {term_text(row['class'])} at {place}")
        else:
            sign = Text("~ ", "yellow")
            was = _place(before)
            change = Text(f"{was} → {place}" if was != place else f"{place}, box revised", "dim")
        lines.append(start + sign + Text(f"{name:<10} ", "bold") + change)
    lines += [start + Text("- ", "red") + Text(name, "bold") for name in gone]
    return lines


def _place(row: Row) -> str:
    x, y = (value if isinstance(value, float) else 0.0 for value in (row["x"], row["y"]))
    return f"({x:.2f}, {y:.2f})"


def tell_effort(console: Console, report: WorkReport) -> None:
    """Says how long it took and how much was written."""
    per_frame = report.duration_s / max(report.frames, 1)
    console.print(
        f"{report.frames} frames in {report.duration_s:.1f} s ({per_frame:.2f} s each), "
        f"{report.commands} commands written, last commit {report.commit}."
    )


def show_findings(
    console: Console, findings: Sequence[Finding], truth: list[TruePiece] | None
) -> None:
    """Prints the furniture that the board knows, next to the truth where that is known."""
    matches = (
        [Match(finding, None) for finding in findings]
        if truth is None
        else compare(findings, truth)
    )
    table = _plain_table()
    for name in ("fluent", "class"):
        table.add_column(name, no_wrap=True)
    for name in ("x", "y", "top", "size", "frames", "sure"):
        table.add_column(name, justify="right", no_wrap=True)
    if truth is not None:
        table.add_column("truth", no_wrap=True)
    for match in matches:
        table.add_row(*_cells(match, with_truth=truth is not None))
    console.print(table)
    if truth is not None:
        right = sum(match.found is not None and match.true is not None for match in matches)
        console.print(
            f"{right} of {len(truth)} pieces found, "
            f"{sum(match.true is None for match in matches)} invented."
        )


def _cells(match: Match[Finding], *, with_truth: bool) -> list[Text]:
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
        Text(f"{top:.3f}"),
        Text(f"{box.x_size:.2f} x {box.y_size:.2f}"),
        Text(str(found.frames or "")),
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


def ask(console: Console, board: Client) -> None:
    """Prints a SPARQL query and its answer."""
    console.print(Syntax(QUESTION, "sparql", background_color="default"))
    rows = board.select(QUESTION, at="now")
    table = _plain_table()
    for name in rows[0] if rows else ():
        is_number = all(isinstance(row[name], (int, float)) for row in rows)
        table.add_column(name, justify="right" if is_number else "left")
    for row in rows:
        table.add_row(*(Text(_short(value)) for value in row.values()))
    console.print(table)


def _short(value: Term | None) -> str:
    return f"{value:.2f}" if isinstance(value, float) else term_text(value)
