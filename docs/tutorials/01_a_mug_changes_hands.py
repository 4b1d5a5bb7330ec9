"""Tutorial 1: a mug changes hands, and nobody knows exactly when.

Starts a board, writes the three facts of Listing 2.2 of the thesis, asks who holds the mug at
different times, hears of a change as it happens, and draws the facts on a time line.

    .venv/bin/python docs/tutorials/01_a_mug_changes_hands.py [PICTURE.png]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Certainty, Interval
from fluentboard_client import Client, Delta
from fluentboard_modules.demo.service_process import ServiceProcess
from fluentboard_modules.demo.timeline import Row, save_timeline

ON = (
    Property("hasPhysicalEntity", "Mug", "mug1"),
    Property("hasArea", "PlacingAreaEastRight", "placingAreaEastRightCounter1"),
)
HOLDING = (
    Property("hasPassiveObject", "Mug", "mug1"),
    Property("hasGripper", "Gripper", "rightGripper1"),
)
HELD_NOW = """
SELECT ?held WHERE {
  ?h a race:Holding ; upper:hasPassiveObject ?held ; upper:hasFinishEarliest ?end .
  FILTER(?end = "INF"^^xsd:double)
}"""


def main(picture: Path) -> None:
    """Tells the story; the time line goes to the picture."""
    # A board of its own in a temporary folder. `fluentboard serve` starts one that stays.
    with (
        tempfile.TemporaryDirectory() as folder,
        ServiceProcess(Path(folder) / "board") as service,
        Client(service.address, author="tutorial") as board,
    ):
        print("1. The robot picked up mug1 some time between 119.6 s and 161.8 s.")
        somewhen = Interval(119.621, 161.817)
        mug = Fluent("mug1", "Mug")
        on = Fluent("on4", "On", finish=somewhen, properties=ON)
        holding = Fluent("holding0", "Holding", start=somewhen, properties=HOLDING)
        receipt = board.assert_fluents([mug, on, holding])
        print(f"   commit {receipt.commit}")
        for warning in receipt.warnings:
            print(f"   the board remarks: {warning}")

        print("2. Does the gripper hold the mug?")
        for time_s in (100.0, 140.0, 170.0):
            answer = board.fluent("holding0").holds_at(time_s)
            words = {Certainty.CERTAIN: "yes", Certainty.POSSIBLE: "perhaps"}.get(answer, "no")
            print(f"   at {time_s:.0f} s: {words}")

        print("3. Everything that may hold at 140 s:")
        for fluent in board.fluents(at=140.0):
            print(f"   {fluent.name} ({fluent.class_name})")

        print("4. A subscriber hears when the mug is put down again.")
        with board.subscribe(HELD_NOW) as changes:
            print(f"   {next(changes)}")
            board.end("holding0", 203.5)
            for change in changes:
                print(f"   {change}")
                if isinstance(change, Delta):
                    break

        print("5. Nothing is forgotten:")
        for change in board.history("holding0"):
            print(f"   commit {change.commit}: {change.kind} by {change.author}")

        rows = [Row(board.fluent(name)) for name in ("on4", "holding0")]
        save_timeline(rows, (100.0, 220.0), picture, title="Who has the mug?")
        print(f"The time line is in {picture.name}.")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("a_mug_changes_hands.png"))
