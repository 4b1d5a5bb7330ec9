"""Every tutorial runs, draws its figure, and tells what it promises."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

TUTORIALS = sorted(
    (Path(__file__).resolve().parents[2] / "docs" / "tutorials").glob("[0-9][0-9]_*.py")
)

PROMISED = {
    "01_a_mug_changes_hands": [
        "at 100 s: no",
        "at 140 s: perhaps",
        "at 170 s: yes",
        "commit 2: = held=mug1",
        "commit 3: - held=mug1",
        "commit 3: ended by tutorial",
    ],
}


@pytest.mark.parametrize("script", TUTORIALS, ids=lambda path: path.stem)
def test_tutorial_runs_and_tells_what_it_promises(script: Path, tmp_path: Path) -> None:
    picture = tmp_path / "figure.png"
    shown = subprocess.run(
        [sys.executable, str(script), str(picture)], capture_output=True, text=True, check=False
    )
    assert (shown.returncode, shown.stderr) == (0, "")
    told = [line.strip() for line in shown.stdout.splitlines()]
    assert [line for line in PROMISED[script.stem] if line not in told] == []
    assert picture.stat().st_size > 1000


def test_tutorials_are_numbered_without_a_gap() -> None:
    assert [int(path.name[:2]) for path in TUTORIALS] == list(range(1, len(TUTORIALS) + 1))
