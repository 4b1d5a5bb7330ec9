"""Anchoring on the fifteen simulated tables: Tables 4.4 to 4.7 beside the thesis's numbers."""

from __future__ import annotations

from bench.measuring import Report
from fluentboard_modules.anchoring.config import RecognitionConfig
from fluentboard_modules.anchoring.evaluation_run import (
    ResultTable,
    record_tables,
    table_results,
    training_of,
)
from fluentboard_modules.anchoring.recognisers import recogniser_of


def run() -> list[Report]:
    """Simulates, anchors and judges all scenes; about ten minutes on two cores."""
    recogniser = recogniser_of(RecognitionConfig(recogniser="spin-images"))
    records = record_tables(range(1, 16), recogniser, frames=40)
    tables, context = table_results(records, recogniser.classes, *training_of(thesis=False))
    accuracy = {
        f"{name}, all objects": 100.0 * context.accuracy(name) for name in context.predicted
    }
    return [accuracy_report(accuracy, tables)]


def accuracy_report(accuracy: dict[str, float], tables: list[ResultTable]) -> Report:
    """The report: accuracies, and every table as a note."""
    return Report(
        "Anchoring on fifteen simulated tables",
        "%",
        accuracy,
        {},
        "CRF+A+Loc more than 10.18 points above Loc, small objects more than 29 points",
        [note for table in tables for note in (_markdown(table), "")],
    )


def _markdown(table: ResultTable) -> str:
    lines = [f"**{table.title}**", "", "| " + " | ".join(table.columns) + " |"]
    lines.append("|" + " --- |" * len(table.columns))
    lines += ["| " + " | ".join(row) + " |" for row in table.rows]
    return "\n".join([*lines, "", table.note])
