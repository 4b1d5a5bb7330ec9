"""Over HTTP on one connection: a point query and a single write, against oxigraph serve."""

from __future__ import annotations

import itertools
import json
import random
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable
from pathlib import Path

from bench.measuring import Report, compare
from bench.workload import fluents, ntriples, vocabulary
from fluentboard.model.json_format import fluent_to_json
from fluentboard_ontology import FLUENT

FLUENTS = 20_000
REQUESTS = 200
SMALL = 2_000


class Connection:
    """One kept-alive connection without a client library's cost in the way."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port))
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._file = self._socket.makefile("rb")

    def request(
        self, method: str, target: str, headers: dict[str, str], body: bytes = b""
    ) -> bytes:
        """Sends a request and reads the whole reply; anything but 2xx is an error."""
        head = f"{method} {target} HTTP/1.1\r\nHost: localhost\r\nContent-Length: {len(body)}\r\n"
        head += "".join(f"{name}: {value}\r\n" for name, value in headers.items())
        self._socket.sendall(head.encode() + b"\r\n" + body)
        status = int(self._file.readline().split()[1])
        length, chunked = 0, False
        while (line := self._file.readline().strip().lower()) != b"":
            if line.startswith(b"content-length:"):
                length = int(line.split(b":")[1])
            chunked = chunked or line.startswith(b"transfer-encoding: chunked")
        if chunked:
            reply = b""
            while size := int(self._file.readline(), 16):
                reply += self._file.read(size)
                self._file.readline()
            self._file.readline()
        else:
            reply = self._file.read(length)
        assert 200 <= status < 300, (status, reply[:300])
        return reply


def run() -> list[Report]:
    """Both measurements, with all servers up at the same time."""
    folder = Path(tempfile.mkdtemp(prefix="fluentboard-bench-"))
    binaries = Path(sys.executable).parent
    ports = [free_port() for _ in range(4)]
    words = vocabulary()
    text, small = (ntriples(fluents(count), words) for count in (FLUENTS, SMALL))
    (folder / "small.nt").write_text(small, encoding="utf-8")
    commands = [
        ["fluentboard", "serve", "--port", str(ports[0]), "--data", str(folder / "board")],
        ["oxigraph", "serve", "--bind", f"127.0.0.1:{ports[1]}", "--location", str(folder / "ox")],
        ["rdflib-endpoint", "serve", "--port", str(ports[2]), str(folder / "small.nt")],
    ]
    process = ["--durability", "process", "--data", str(folder / "process")]
    commands.append(["fluentboard", "serve", "--port", str(ports[3]), *process])
    servers = [
        subprocess.Popen(
            [binaries / command[0], *command[1:]],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for command in commands
    ]
    try:
        for port, path in zip(ports, ("/ready", "/", "/", "/ready"), strict=True):
            wait_until_ready(port, path)
        board, oxigraph, rdflib_endpoint, lax = (Connection(port) for port in ports)
        made = [fluent_to_json(fluent) for fluent in fluents(FLUENTS)]
        for first in range(0, len(made), 1000):
            _post_json(board, made[first : first + 1000])
        oxigraph.request(
            "POST", "/store?default", {"Content-Type": "application/n-triples"}, text.encode()
        )
        for connection in (board, lax):  # what the load left to do in the background is done now
            connection.request("GET", "/sparql?query=ASK%20%7B%7D%20%23%20settled", {})
        return [_queries(board, oxigraph, rdflib_endpoint), _writes(board, lax, oxigraph)]
    finally:
        for server in servers:
            server.terminate()
        for server in servers:
            server.wait(20)
        shutil.rmtree(folder, ignore_errors=True)


def _queries(board: Connection, oxigraph: Connection, endpoint: Connection) -> Report:
    def point(connection: Connection, path: str, among: int, count: int) -> Callable[[], float]:
        # Each subject once: an answer that is known from before would be no measurement.
        numbers = itertools.cycle(random.Random(7).sample(range(among // 4), among // 4))

        def once() -> float:
            begin = time.perf_counter()
            for _ in range(count):
                subject = f"{FLUENT}o{next(numbers)}_pose"
                query = urllib.parse.quote(f"SELECT ?p ?o {{ <{subject}> ?p ?o }}")
                reply = connection.request(
                    "GET", f"{path}?query={query}", {"Accept": "application/sparql-results+json"}
                )
            assert len(json.loads(reply)["results"]["bindings"]) == 9
            return (time.perf_counter() - begin) * REQUESTS / count

        return once

    return compare(
        "Point query over HTTP, one connection",
        {
            "fluentboard": point(board, "/sparql", FLUENTS, REQUESTS),
            "oxigraph serve": point(oxigraph, "/query", FLUENTS, REQUESTS),
            f"rdflib-endpoint ({SMALL:,} fluents)": point(endpoint, "/", SMALL, 10),
        },
        rounds=9,
        operations=REQUESTS,
        unit="us",
        target="at least 0.6 times oxigraph serve",
        notes=[f"{FLUENTS:,} fluents; a different subject in each request."],
    )


def _writes(board: Connection, lax: Connection, oxigraph: Connection) -> Report:
    numbers = itertools.count()
    words = vocabulary()
    count = 100

    def in_board(connection: Connection) -> float:
        bodies = [[fluent_to_json(fluent)] for fluent in fluents(count, f"w{next(numbers)}_")]
        begin = time.perf_counter()
        for body in bodies:
            _post_json(connection, body)
        return time.perf_counter() - begin

    def in_oxigraph() -> float:
        bodies = [
            f"INSERT DATA {{ {ntriples([fluent], words)} }}".encode()
            for fluent in fluents(count, f"w{next(numbers)}_")
        ]
        begin = time.perf_counter()
        for body in bodies:
            oxigraph.request("POST", "/update", {"Content-Type": "application/sparql-update"}, body)
        return time.perf_counter() - begin

    return compare(
        "Single write over HTTP, one connection",
        {
            "fluentboard --durability process (no fsync)": lambda: in_board(lax),
            "oxigraph serve (no fsync)": in_oxigraph,
            "fluentboard (fsync before each reply)": lambda: in_board(board),
        },
        rounds=9,
        operations=count,
        unit="us",
        target="at least 0.6 times oxigraph serve",
        notes=[
            "One fluent, about 9 triples, per request. oxigraph serve acknowledges before the disk "
            "has the write; with fsync, the reply takes as long as the disk does."
        ],
    )


def _post_json(connection: Connection, body: list[dict[str, object]]) -> None:
    connection.request(
        "POST", "/fluents", {"Content-Type": "application/json"}, json.dumps(body).encode()
    )


def free_port() -> int:
    """A port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def wait_until_ready(port: int, path: str) -> None:
    """Returns when a server answers."""
    deadline = time.monotonic() + 60.0
    while True:
        try:
            urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=5).close()
            return
        except urllib.error.HTTPError:
            return
        except OSError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.1)
