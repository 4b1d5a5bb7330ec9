"""The commands import, export, query and watch against a real service."""

from __future__ import annotations

import csv
import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_client import Client
from fluentboard_modules.demo.service_process import ServiceProcess

LISTING = Path(__file__).resolve().parents[1] / "golden" / "listing_2_2.yaml"
# Tests that run in the background may have been told to ignore the signal, and so their children.
INTERRUPTIBLE = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    "from fluentboard.cli import main; main()"
)
HELD = "SELECT ?h ?mug WHERE { ?h a race:Holding ; upper:hasPassiveObject ?mug }"


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServiceProcess]:
    with ServiceProcess(tmp_path_factory.mktemp("board")) as running:
        imported = command(running, "import", str(LISTING))
        assert imported.returncode == 0, imported.stderr
        yield running


def command(
    service: ServiceProcess, *arguments: str, given: str = ""
) -> subprocess.CompletedProcess[str]:
    whole = [sys.executable, "-m", "fluentboard", *arguments, "--board", service.address]
    return subprocess.run(whole, input=given, capture_output=True, text=True, check=False)


def test_listing_is_imported_and_shown_as_a_table(service: ServiceProcess) -> None:
    shown = command(service, "query", HELD).stdout.split()
    assert shown[:2] == ["h", "mug"]
    assert shown[-4:] == ["holding0", "mug1", "1", "row"]


def test_query_gives_json_and_csv(service: ServiceProcess) -> None:
    document = json.loads(command(service, "query", "-", "--format", "json", given=HELD).stdout)
    (binding,) = document["results"]["bindings"]
    assert binding["mug"]["value"].endswith("/mug1")
    (row,) = csv.DictReader(command(service, "query", HELD, "--format", "csv").stdout.splitlines())
    assert row["h"].endswith("/holding0")


def test_query_may_ask_about_one_time(service: ServiceProcess) -> None:
    ask = "ASK { ?h a race:Holding }"
    assert command(service, "query", ask, "--at", "100").stdout == "no\n"
    assert command(service, "query", ask, "--at", "140").stdout == "yes\n"
    assert command(service, "query", ask, "--at", "140", "--certainly").stdout == "no\n"


def test_export_gives_back_what_was_imported(service: ServiceProcess, tmp_path: Path) -> None:
    file = tmp_path / "board.yaml"
    assert command(service, "export", "--output", str(file)).returncode == 0
    text = file.read_text(encoding="utf-8")
    assert "Class_Instance: [Holding, holding0]" in text
    assert "StartTime: [119.621, 161.817]" in text
    assert list(tmp_path.iterdir()) == [file]  # and nothing half-written beside it
    lines = command(service, "export", "--format", "jsonl").stdout.splitlines()
    assert {json.loads(line)["name"] for line in lines} >= {"holding0", "on4"}


def test_trajectory_shows_poses_distance_and_positions(service: ServiceProcess) -> None:
    with Client(service.address) as board:
        for number, (x, start, finish) in enumerate(
            [(1.0, UNKNOWN, Interval.at(50.0)), (3.0, Interval.at(60.0), UNKNOWN)]
        ):
            values = (Property("hasX", "xsd:double", x),)
            board.assert_fluents(Fluent(f"p{number}", "Pose", start, finish, values))
        poses = tuple(Property("hasPose", "Pose", f"p{number}") for number in range(2))
        board.assert_fluents(Fluent("mug7", "Mug", properties=poses))
    shown = command(service, "trajectory", "mug7", "--at", "55", "--at", "70").stdout.splitlines()
    assert "2 poses, at least 2.000 m travelled" in shown
    assert shown[-2:] == ["at 55 s: not known", "at 70 s: certain at p1"]
    table = command(service, "trajectory", "mug7", "--format", "csv", "--during", "55,90").stdout
    (row,) = csv.DictReader(table.splitlines())
    assert (row["pose"], row["start"], row["finish"], row["x"]) == ("p1", "60", "?", "3.0")


def test_wrong_file_is_refused_with_file_line_and_value(
    service: ServiceProcess, tmp_path: Path
) -> None:
    file = tmp_path / "wrong.yaml"
    file.write_text("!Fluent\nClass_Instance: [Mug, mug9]\nStartTime: [7.0, 3.0]\n")
    shown = command(service, "import", str(file))
    assert shown.returncode == 1
    assert shown.stderr.startswith(("interval-reversed: ", "invalid-yaml: "))
    assert shown.stderr.count("\n") == 1
    assert "mug9" not in command(service, "export").stdout


def test_watch_prints_changes_until_it_is_told_to_stop(service: ServiceProcess) -> None:
    watching = subprocess.Popen(
        [
            *(sys.executable, "-m", "fluentboard", "watch", "--board", service.address),
            "SELECT ?fork WHERE { ?fork a race:Fork }",
        ],
        stdout=subprocess.PIPE,
        text=True,
    )
    with watching:
        try:
            assert watching.stdout is not None
            assert watching.stdout.readline().endswith(": no rows\n")
            with Client(service.address) as board:
                commit = board.assert_fluents(Fluent("fork1", "Fork")).commit
            assert watching.stdout.readline() == f"commit {commit}: + fork=fork1\n"
            watching.send_signal(signal.SIGTERM)
            assert watching.wait(timeout=20.0) == 0
        finally:
            watching.kill()


def test_export_of_a_window_has_what_held_in_it(service: ServiceProcess) -> None:
    with Client(service.address) as board:
        board.assert_fluents(Fluent("knife1", "Knife", Interval(10.0, 12.0), Interval(20.0, 22.0)))

    def names(*flags: str) -> set[str]:
        lines = command(service, "export", "--format", "jsonl", *flags).stdout.splitlines()
        return {json.loads(line)["name"] for line in lines}

    assert "knife1" in names("--during", "21,40")
    assert "knife1" not in names("--during", "21,40", "--certainly")
    assert "knife1" not in names("--during", "22,40")
    wrong = command(service, "export", "--during", "40")
    assert wrong.returncode == 2
    assert "'40' is no window" in wrong.stderr


def test_followed_changes_are_told_until_interrupted(service: ServiceProcess) -> None:
    with Client(service.address) as board:
        since = board.assert_fluents(Fluent("spoon1", "Spoon")).commit
    flags = ("--since", str(since - 1), "--follow", "--format", "jsonl")
    following = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTIBLE, "changes", "--board", service.address, *flags],
        stdout=subprocess.PIPE,
        text=True,
    )
    with following:
        try:
            assert following.stdout is not None
            assert json.loads(following.stdout.readline())["commit"] == since
            with Client(service.address) as board:
                commit = board.end("spoon1", Interval.at(9.0)).commit
            (event,) = (told := json.loads(following.stdout.readline()))["events"]
            assert (told["commit"], event["event"]) == (commit, "ended")
            following.send_signal(signal.SIGINT)
            assert following.wait(timeout=20.0) == 0
        finally:
            following.kill()
