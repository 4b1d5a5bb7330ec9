"""Compiled rules against Pellet on many random sets of planes: the same classes, every time."""

from __future__ import annotations

import time

import numpy as np

from bench.measuring import Report
from fluentboard_modules.mapping.pellet import PelletReasoner
from fluentboard_modules.mapping.plane_sets import random_plane_set
from fluentboard_modules.mapping.rules import FurnitureRules, load_rules
from fluentboard_ontology import read

_SETS = 500
_SEED = 1


def run() -> list[Report]:
    """Classifies every set with both; a disagreement ends the run."""
    rules = load_rules(read("furniture"))
    reasoner = PelletReasoner(rules.rules)
    by_pellet = FurnitureRules(rules.rules, reasoner)
    rng = np.random.default_rng(_SEED)
    sets = [random_plane_set(rng) for _ in range(_SETS)]
    by_pellet.classify(sets[0], explain=False)  # starts Java
    seconds = {"compiled rules": 0.0, "Pellet, warm": 0.0}
    hypotheses = 0
    for number, planes in enumerate(sets):
        answers: list[object] = []
        for name, classifier in (("compiled rules", rules), ("Pellet, warm", by_pellet)):
            begin = time.perf_counter()
            found = classifier.classify(planes, explain=False)
            seconds[name] += time.perf_counter() - begin
            answers.append(found)
        if answers[0] != answers[1]:
            raise SystemExit(f"set {number} of seed {_SEED} is classified differently")
        hypotheses += len(found.hypotheses)
    reasoner.close()
    ours, pellet = seconds.values()
    return [
        Report(
            f"Compiled rules and Pellet on {_SETS} random sets of planes",
            "ms",
            {name: 1e3 * total / _SETS for name, total in seconds.items()},
            {"Pellet, warm": pellet / ours},
            "identical classes on at least 200 sets",
            [
                f"Identical labels and hypotheses on all {_SETS} sets: {sum(map(len, sets))} "
                f"planes that are nearly furniture, {hypotheses} hypotheses. Means per set."
            ],
        )
    ]
