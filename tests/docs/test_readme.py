"""The first screen keeps its promises: the code runs as printed, all links and commands exist."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from fluentboard.model.fluent import Fluent, Property
from fluentboard_client import Client
from fluentboard_modules.demo.service_process import ServiceProcess

CHECKOUT = Path(__file__).resolve().parents[2]
README = (CHECKOUT / "README.md").read_text(encoding="utf-8")


def test_example_is_ten_lines_and_prints_changes_as_shown(tmp_path: Path) -> None:
    (example,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert len([line for line in example.splitlines() if line.strip()]) <= 10
    (shown,) = re.findall(r"```text\n(.*?)```", README, re.DOTALL)
    with ServiceProcess(tmp_path / "board") as service, Client(service.address) as board:
        script = example.replace("http://127.0.0.1:8080", service.address)
        reader = subprocess.Popen(
            [sys.executable, "-u", "-c", script], stdout=subprocess.PIPE, text=True
        )
        with reader:
            assert reader.stdout is not None
            try:
                told = [reader.stdout.readline()]
                place = (Property("hasX", "xsd:float", 3.5), Property("hasY", "xsd:float", 4.0))
                pose = (Property("hasPose", "Pose", "pose1"),)
                board.assert_fluents(
                    [
                        Fluent("pose1", "Pose", properties=place),
                        Fluent("chair1", "Chair", properties=pose),
                    ]
                )
                told.append(reader.stdout.readline())
            finally:
                reader.kill()
    assert told == ["commit 1: no rows\n", "commit 2: + chair=chair1 x=3.5 y=4\n"]
    form = re.compile(r"commit \d+: (no rows|\+ chair=chair\d+ x=[\d.]+ y=[\d.]+)")
    assert all(form.fullmatch(line) for line in shown.splitlines())


def test_everything_it_links_to_is_there() -> None:
    links = re.findall(r"\]\((?!https?:)([^)#\s]+)", README)
    assert [link for link in links if not (CHECKOUT / link).exists()] == []


def test_commands_it_names_exist() -> None:
    named = set(re.findall(r"`fluentboard (\w+)", README))
    helped = subprocess.run(
        [sys.executable, "-m", "fluentboard", "--help"], capture_output=True, text=True, check=True
    )
    assert [name for name in named if f" {name} " not in helped.stdout] == []
    targets = set(re.findall(r"^make (\w+)", README, re.MULTILINE))
    makefile = (CHECKOUT / "Makefile").read_text(encoding="utf-8")
    assert [name for name in targets if f"\n{name}:" not in makefile] == []


def test_make_help_tells_of_every_target() -> None:
    makefile = (CHECKOUT / "Makefile").read_text(encoding="utf-8")
    phony = re.findall(r"^\.PHONY: (.+)$", makefile, re.MULTILINE)[0].split()
    assert re.findall(r"^## (\w+): \S", makefile, re.MULTILINE) == phony
    assert [name for name in phony if f"\n{name}:" not in makefile] == []


def test_badges_do_not_crowd_the_first_screen() -> None:
    assert len(re.findall(r"!\[[^]]*\]\(https?:", README)) <= 3
