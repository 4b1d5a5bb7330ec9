"""docs/reference/simulator.md says what the code does."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fluentboard_modules.frames.simulated_sources import SIMULATED_SCENES
from fluentboard_modules.simulation.robots import ROBOTS, Robot
from fluentboard_modules.simulation.table_service import TABLEWARE_CLASSES

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "simulator.md"
TEXT = PAGE.read_text(encoding="utf-8")


def test_every_scene_robot_and_class_of_tableware_is_named() -> None:
    for scene in SIMULATED_SCENES:
        assert f"| `{scene.removeprefix('sim:')}` |" in TEXT
    for name in (*ROBOTS, *TABLEWARE_CLASSES):
        assert f"`{name}`" in TEXT, name


def test_everything_that_a_real_robot_needs_is_in_the_table() -> None:
    members = {name for name in vars(Robot) if not name.startswith("_")}
    for member in members:
        assert re.search(rf"^\| `{member}[(`]", TEXT, re.MULTILINE), member


@pytest.mark.parametrize("number", range(3))
def test_python_of_the_page_runs(number: int, capsys: pytest.CaptureFixture[str]) -> None:
    examples = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    assert len(examples) == 3
    exec(compile(examples[number], "simulator.md", "exec"), {})
    assert capsys.readouterr().out
