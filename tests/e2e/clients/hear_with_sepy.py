"""Subscribes with sepy, unmodified, and prints what it is told while it updates the board.

Called by the tests: `python hear_with_sepy.py ADDRESS`.
"""

from __future__ import annotations

import json
import queue
import sys
import urllib.request
from typing import Any

from sepy.SAPObject import SAPObject  # type: ignore[import-untyped]
from sepy.SEPA import SEPA  # type: ignore[import-untyped]

CUPS = "SELECT ?cup { GRAPH <urn:sepy> { ?cup a <urn:Cup> } }"


def values(bindings: list[dict[str, Any]]) -> list[str]:
    return [row["cup"]["value"] for row in bindings]


def main(address: str) -> None:
    with urllib.request.urlopen(address + "/subscribe") as reply:
        jsap = json.load(reply)
    told: queue.Queue[dict[str, list[str]]] = queue.Queue()

    def hear(added: list[dict[str, Any]], removed: list[dict[str, Any]]) -> None:
        told.put({"added": values(added), "removed": values(removed)})

    sepa: Any = SEPA(SAPObject(jsap, log=50), logLevel=50)
    found: list[Any] = [{"queried": len(sepa.sparql_query(CUPS)["results"]["bindings"])}]
    name = sepa.sparql_subscribe(CUPS, "cups", hear)
    found.append(told.get(timeout=20))
    for step in ("INSERT", "DELETE"):
        sepa.sparql_update(f"{step} DATA {{ GRAPH <urn:sepy> {{ <urn:cup1> a <urn:Cup> }} }}")
        found.append(told.get(timeout=20))
    sepa.connectionManager.closeWebsocket(name)
    print(json.dumps(found))


main(sys.argv[1])
