"""Killed, restarted, robbed of its store, out of disk: what was acknowledged is there, whole."""

from __future__ import annotations

import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import pytest

from fluentboard_modules.demo.service_process import ServiceProcess

# More in the bench; each start takes about a second.
KILLS = int(os.environ.get("FLUENTBOARD_TEST_KILLS", "20"))
WRITERS = 4
BATCH = 3


class Writer:
    """Writes batches until the service is gone, and remembers what was acknowledged.

    A batch is `BATCH` new fluents and the ending of one fluent of the batch before, so a torn one
    would show.
    """

    def __init__(self, address: str, name: str) -> None:
        self._client = httpx.Client(base_url=address, trust_env=False, timeout=10.0)
        self._name = name
        self.acknowledged: list[list[str]] = []
        self.asked: list[list[str]] = []

    def run(self) -> None:
        with self._client:
            for number in range(100_000):
                batch = [f"{self._name}_{number}_{k}" for k in range(BATCH)]
                self.asked.append(batch)
                commands = [{"op": "assert", "fluent": {"name": n, "class": "Mug"}} for n in batch]
                try:
                    reply = self._client.post("/commands", json={"commands": commands})
                except httpx.TransportError:
                    return
                assert reply.status_code == 200, reply.text
                self.acknowledged.append(batch)


def client(service: ServiceProcess) -> httpx.Client:
    return httpx.Client(base_url=service.address, trust_env=False)


def names_on(address: str) -> set[str]:
    found: set[str] = set()
    with httpx.stream("GET", address + "/export?format=jsonl", trust_env=False) as reply:
        for line in reply.iter_lines():
            found.add(line.split('"', 4)[3])
    return found


def mugs_in_store(address: str) -> set[str]:
    query = {"query": "SELECT ?mug WHERE { ?mug a race:Mug }"}
    reply = httpx.get(
        address + "/sparql", params=query, headers={"Accept": "text/csv"}, trust_env=False
    )
    assert reply.status_code == 200, reply.text
    return {line.rpartition("/")[2] for line in reply.text.split()[1:]}


# A connection that the kill cuts off may complain when it is collected.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_no_acknowledged_write_is_lost_or_torn_by_a_kill(tmp_path: Path) -> None:
    rng = random.Random(2018)
    acknowledged: list[list[str]] = []
    asked: list[list[str]] = []
    for kill in range(KILLS):
        service = ServiceProcess(tmp_path)
        service.start()
        writers = [Writer(service.address, f"k{kill}w{n}") for n in range(WRITERS)]
        with ThreadPoolExecutor(WRITERS) as threads:
            running = [threads.submit(writer.run) for writer in writers]
            while not any(writer.acknowledged for writer in writers):
                time.sleep(0.001)
            time.sleep(rng.uniform(0.0, 0.1))
            service.kill()
            for future in running:
                future.result()
        for writer in writers:
            acknowledged += writer.acknowledged
            asked += writer.asked

    with ServiceProcess(tmp_path) as service:
        names = names_on(service.address)
        in_store = mugs_in_store(service.address)
    lost = [batch for batch in acknowledged if not names.issuperset(batch)]
    torn = [batch for batch in asked if 0 < len(names.intersection(batch)) < len(batch)]
    assert acknowledged
    assert (lost, torn) == ([], [])
    assert in_store == names


def test_a_restart_finds_everything_as_it_was(tmp_path: Path) -> None:
    paths = ("/fluents", "/fluents/mug1/history")
    with ServiceProcess(tmp_path) as service, client(service) as board:
        board.post("/fluents", json={"name": "mug1", "class": "Mug", "start": [1, 2]})
        board.post("/fluents/mug1/end", json={"at": [5.0, 6.0]})
        before = [board.get(path).text for path in paths]
    with ServiceProcess(tmp_path) as service, client(service) as board:
        assert [board.get(path).text for path in paths] == before


def test_the_same_key_is_remembered_across_a_restart(tmp_path: Path) -> None:
    commits: list[int] = []
    for _ in range(2):
        with ServiceProcess(tmp_path) as service, client(service) as board:
            reply = board.post(
                "/fluents",
                json={"name": "mug1", "class": "Mug"},
                headers={"Idempotency-Key": "the first mug"},
            )
            commits.append(reply.json()["commit"])
    assert commits[0] == commits[1]


def test_a_deleted_store_is_rebuilt_from_the_journal(tmp_path: Path) -> None:
    with ServiceProcess(tmp_path) as service:
        fluents = [{"name": f"mug{n}", "class": "Mug"} for n in range(50)]
        httpx.post(service.address + "/fluents", json=fluents, trust_env=False).raise_for_status()
        before = mugs_in_store(service.address)
    shutil.rmtree(tmp_path / "store")
    with ServiceProcess(tmp_path) as service:
        assert len(before) == 50
        assert mugs_in_store(service.address) == before


def test_two_services_do_not_share_a_folder(tmp_path: Path) -> None:
    with ServiceProcess(tmp_path) as service:
        second = subprocess.run(
            [sys.executable, "-m", "fluentboard", "serve", "--port", "0", "--data", str(tmp_path)],
            capture_output=True,
            text=True,
            timeout=30,
            check=False,
        )
        assert second.returncode != 0
        assert "storage-failed" in second.stderr
        assert httpx.get(service.address + "/ready", trust_env=False).status_code == 200


def limited(data: Path, file_max_bytes: int) -> tuple[subprocess.Popen[str], str]:
    """A service whose files cannot grow beyond a size, as on a full disk."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (file_max_bytes, file_max_bytes))

    process = subprocess.Popen(
        [sys.executable, "-m", "fluentboard", "serve", "--port", "0", "--data", str(data)],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        preexec_fn=limit,
    )
    assert process.stdout is not None
    line = process.stdout.readline()
    return process, line.split()[-1]


def until_refused(write: Callable[[int], httpx.Response]) -> tuple[int, httpx.Response]:
    """How often a write succeeded, and the reply that refused the next one."""
    for number in range(10_000):
        reply = write(number)
        if not reply.is_success:
            return number, reply
    raise AssertionError("the disk never filled up")


def test_a_full_disk_refuses_writes_and_keeps_what_was_acknowledged(tmp_path: Path) -> None:
    text = "x" * 20_000
    with ServiceProcess(tmp_path):
        pass  # the ontologies are loaded while there is room
    process, address = limited(tmp_path, 6 * 2**20)
    try:
        with httpx.Client(base_url=address, trust_env=False, timeout=30.0) as board:

            def write(number: int) -> httpx.Response:
                batch = [
                    {
                        "name": f"mug{number}_{k}",
                        "class": "Mug",
                        "properties": [["hasName", "xsd:string", text]],
                    }
                    for k in range(BATCH)
                ]
                return board.post("/fluents", json=batch)

            written, refusal = until_refused(write)
            assert (refusal.status_code, refusal.json()["code"]) == (507, "storage-failed")
            assert board.get("/health").status_code == 200
            assert board.get("/fluents/mug0_0").status_code == 200
    finally:
        process.send_signal(signal.SIGKILL)
        process.communicate()

    with ServiceProcess(tmp_path) as service:
        names = names_on(service.address)
        assert names == {f"mug{number}_{k}" for number in range(written) for k in range(BATCH)}
        assert mugs_in_store(service.address) == names


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_stops_the_service_in_order(tmp_path: Path, number: signal.Signals) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "fluentboard", "serve", "--port", "0", "--data", str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    address = process.stdout.readline().split()[-1]
    httpx.get(address + "/health", trust_env=False).raise_for_status()
    threading.Timer(0.0, process.send_signal, [number]).start()
    _, log = process.communicate(timeout=20)
    assert process.returncode == 0
    assert "Traceback" not in log
