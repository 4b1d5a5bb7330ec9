"""MAP, marginals and gradients of the CRF against brute force and finite differences."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.anchoring.crf import LocalForm, Potentials
from fluentboard_modules.anchoring.crf_data import LabelledGraphs
from fluentboard_modules.anchoring.crf_training import PseudoLikelihood, TrainingConfig
from fluentboard_modules.anchoring.datasets import LabelledScene, labelled_graphs
from fluentboard_modules.anchoring.map_inference import most_probable
from fluentboard_modules.anchoring.marginals import class_marginals
from fluentboard_modules.anchoring.observation import SceneObject, SupportPlane
from fluentboard_modules.anchoring.scene_graph import build_scene_graph, edge_parity

SEEDS = st.integers(0, 2**32 - 1)
TABLE = SupportPlane(
    0.7, np.array([[-1.0, -0.6], [1.0, -0.6], [1.0, 0.6], [-1.0, 0.6]]), np.zeros(2)
)


def potentials(
    seed: int, count: int, classes: int, share: float = 0.7, tree: bool = False
) -> Potentials:
    rng = np.random.default_rng(seed)
    if tree:
        pairs = [(int(rng.integers(j)), j) for j in range(1, count)]
    else:
        pairs = [(i, j) for i in range(count) for j in range(i + 1, count) if rng.random() < share]
    edges = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    return Potentials(
        2.0 * rng.normal(size=(count, classes)),
        edges,
        rng.normal(size=(len(edges), classes, classes)),
    )


def totals(potentials: Potentials) -> NDArray[np.float64]:
    """Scores of all joint assignments of a small graph, one after the other."""
    count, classes = potentials.unary.shape
    assignments = list(product(range(classes), repeat=count))
    grids = np.array(assignments, dtype=np.int64).reshape(len(assignments), count).T
    total = potentials.unary[np.arange(count)[:, None], grids].sum(axis=0)
    for (a, b), table in zip(potentials.edges, potentials.pairwise, strict=True):
        total = total + table[grids[a], grids[b]]
    return np.asarray(total, dtype=np.float64)


def log_partition(potentials: Potentials) -> float:
    return float(np.logaddexp.reduce(totals(potentials)))


def scene(seed: int, count: int) -> list[SceneObject]:
    rng = np.random.default_rng(seed)
    made: list[SceneObject] = []
    for k in range(count):
        x, y, yaw = (float(v) for v in rng.uniform(-0.9, 0.9, 3))
        length, width, height = (float(v) for v in rng.uniform(0.01, 0.3, 3))
        box = BoundingBox(Pose.from_rpy(x, y, 0.75, yaw=3.0 * yaw), length, width, height)
        on = TABLE if rng.random() < 0.8 else None
        made.append(SceneObject(str(k), box, rng.dirichlet(np.ones(3)), on))
    return made


def labelled(seed: int) -> LabelledGraphs:
    rng = np.random.default_rng(seed)
    scenes: list[LabelledScene] = []
    for k in range(3):
        objects = scene(seed + k, int(rng.integers(1, 6)))
        labels = rng.choice(["a", "b", "c"], len(objects))
        scenes.append(LabelledScene(str(k), str(k), tuple(objects), tuple(map(str, labels))))
    graphs = labelled_graphs(scenes, ("a", "b", "c"))
    return graphs.with_confidence(rng.dirichlet(np.ones(3), len(graphs.y)))


@given(seed=SEEDS, count=st.integers(0, 6), classes=st.integers(1, 4))
def test_branch_and_bound_finds_the_best_of_all_assignments(
    seed: int, count: int, classes: int
) -> None:
    graph = potentials(seed, count, classes)
    found = most_probable(graph)
    assert found.is_optimal
    assert found.score == pytest.approx(totals(graph).max(), abs=1e-7)
    assert found.score == pytest.approx(graph.score(found.labels))


@given(seed=SEEDS, count=st.integers(1, 12), classes=st.integers(2, 5))
def test_icm_never_beats_the_exact_method_and_cannot_be_bettered_by_one_change(
    seed: int, count: int, classes: int
) -> None:
    graph = potentials(seed, count, classes, 0.4)
    local = most_probable(graph, "icm")
    assert local.score <= most_probable(graph).score + 1e-7
    for node in range(count):
        for label in range(classes):
            changed = local.labels.copy()
            changed[node] = label
            assert graph.score(changed) <= local.score + 1e-6


def test_a_search_that_is_cut_short_says_so() -> None:
    found = most_probable(potentials(3, 14, 6, 1.0), expanded_max=5)
    assert not found.is_optimal


@given(seed=SEEDS, count=st.integers(1, 5), classes=st.integers(1, 4))
def test_exact_marginals_are_sums_over_all_assignments(seed: int, count: int, classes: int) -> None:
    graph = potentials(seed, count, classes)
    marginals = class_marginals(graph, "exact")
    total = log_partition(graph)
    for node in range(count):
        for label in range(classes):
            fixed = graph.unary.copy()
            fixed[node, np.arange(classes) != label] = -np.inf
            part = log_partition(Potentials(fixed, graph.edges, graph.pairwise))
            assert marginals[node, label] == pytest.approx(np.exp(part - total), abs=1e-9)


@given(seed=SEEDS, count=st.integers(1, 5), classes=st.integers(2, 4))
def test_messages_are_exact_on_trees(seed: int, count: int, classes: int) -> None:
    graph = potentials(seed, count, classes, tree=True)
    assert np.allclose(
        class_marginals(graph, "messages"), class_marginals(graph, "exact"), atol=1e-4
    )


@settings(max_examples=15)
@given(seed=SEEDS, count=st.integers(1, 5))
def test_samples_come_close_to_exact_marginals(seed: int, count: int) -> None:
    graph = potentials(seed, count, 3)
    calm = Potentials(0.5 * graph.unary, graph.edges, 0.5 * graph.pairwise)
    sampled = class_marginals(calm, "sampling", sweeps=4000)
    assert np.allclose(sampled, class_marginals(calm, "exact"), atol=0.08)


@settings(max_examples=15)
@given(seed=st.integers(0, 10_000), form=st.sampled_from(["logarithm", "product", "none"]))
def test_the_gradient_is_that_of_the_pseudo_likelihood(seed: int, form: LocalForm) -> None:
    data = labelled(seed)
    x, e = np.nan_to_num(data.x), np.nan_to_num(data.e)
    config = TrainingConfig(form)
    objective = PseudoLikelihood(data, config, x, e, edge_parity(data.edge_names))
    rng = np.random.default_rng(seed)
    at = 0.3 * rng.normal(size=objective.size)
    gradient = objective(at)[1]
    for _ in range(5):
        direction = rng.normal(size=objective.size)
        step = 1e-5 * direction
        slope = (objective(at + step)[0] - objective(at - step)[0]) / 2e-5
        assert slope == pytest.approx(float(gradient @ direction), rel=1e-4, abs=1e-6)


@given(seed=SEEDS, count=st.integers(2, 8), data=st.data())
def test_features_do_not_depend_on_the_order_of_the_objects(
    seed: int, count: int, data: st.DataObject
) -> None:
    objects = scene(seed % 100_000, count)
    order = data.draw(st.permutations(range(count)))
    there = build_scene_graph(objects)
    back = build_scene_graph([objects[k] for k in order])
    place = {k: i for i, k in enumerate(order)}
    assert np.allclose(back.x[[place[k] for k in range(count)]], there.x, equal_nan=True)
    features = {(int(a), int(b)): e for (a, b), e in zip(back.edges, back.e, strict=True)}
    names = ("bias", "volume_ratio", "hdist_centroids", "table_border_diff", "table_center_diff")
    sign = edge_parity(
        (
            *names,
            "table_angle_diff",
            "side_offset",
            "abs_side_offset",
            "abs_volume_ratio",
            "abs_table_border_diff",
        )
    )
    for (a, b), e in zip(there.edges, there.e, strict=True):
        a, b = int(a), int(b)
        if (place[a], place[b]) in features:
            assert np.allclose(features[place[a], place[b]], e, equal_nan=True)
        else:
            turned = sign * features[place[b], place[a]]
            # An angle of half a turn has no sign.
            half = np.isclose(np.abs(e), np.pi)
            turned[half] = e[half]
            assert np.allclose(turned, e, equal_nan=True)
