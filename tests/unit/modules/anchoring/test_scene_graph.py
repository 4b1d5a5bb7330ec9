"""Nodes, edges and features of scene graphs (Tables 4.2 and 4.3)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fluentboard.errors import InvalidConfiguration
from fluentboard_modules.anchoring.observation import SceneObject
from fluentboard_modules.anchoring.scene_graph import (
    THESIS_EDGE_FEATURES,
    SceneGraphConfig,
    build_scene_graph,
)

Make = Callable[..., SceneObject]


def test_anchors_out_of_view_join_along_chains_of_neighbours(scene_object: Make) -> None:
    objects = [
        scene_object("seen", -0.9, 0.0),
        scene_object("near", -0.5, 0.0, tracked=False),
        scene_object("next", -0.1, 0.0, tracked=False),
        scene_object("far", 0.9, 0.0, tracked=False),
    ]
    graph = build_scene_graph(objects, SceneGraphConfig(context_range_m=0.5))
    assert graph.members.tolist() == [0, 1, 2]
    assert graph.edges.tolist() == [[0, 1], [1, 2]]


def test_nothing_in_view_makes_an_empty_graph(scene_object: Make) -> None:
    graph = build_scene_graph([scene_object("a", 0.0, 0.0, tracked=False)])
    assert graph.x.shape[0] == 0
    assert graph.edges.shape == (0, 2)


def test_no_objects_make_an_empty_graph() -> None:
    graph = build_scene_graph([])
    assert (len(graph.members), graph.edges.shape, graph.e.shape[0]) == (0, (0, 2), 0)


def test_features_are_those_of_the_tables(scene_object: Make) -> None:
    objects = [
        scene_object("a", 0.3, 0.4, (0.2, 0.1, 0.05)),
        scene_object("b", 0.3, -0.3, (0.1, 0.1, 0.1)),
    ]
    graph = build_scene_graph(objects, SceneGraphConfig.of_the_thesis(1.0))
    diagonal = np.hypot(0.2, 0.1)
    assert graph.x[0] == pytest.approx(
        [1.0, 0.001, 0.02, 0.05 * diagonal, 2.0, 0.05 / diagonal, 0.1, 0.5]
    )
    angle = np.arctan2(-0.3, 0.3) - np.arctan2(0.4, 0.3)
    distance = np.hypot(0.3, 0.3)
    assert graph.e[0] == pytest.approx([1.0, 0.0, 0.7, -0.1, 0.5 - distance, angle], abs=1e-12)


def test_features_of_the_table_are_unknown_without_one(scene_object: Make) -> None:
    objects = [scene_object("a", 0.0, 0.0, on=None), scene_object("b", 0.2, 0.0)]
    graph = build_scene_graph(objects, SceneGraphConfig.of_the_thesis(1.0))
    assert np.isnan(graph.x[0]).tolist() == [False] * 6 + [True] * 2
    assert np.isnan(graph.e[0]).tolist() == [False] * 3 + [True] * 3


def test_what_lies_to_the_right_of_a_guest_does_so_from_every_side_of_the_table(
    scene_object: Make,
) -> None:
    config = SceneGraphConfig(edge_features=("side_offset",))
    for side in (-1.0, 1.0):
        plate = scene_object("plate", 0.4, side * 0.35)
        knife = scene_object("knife", 0.4 - side * 0.2, side * 0.35)
        assert build_scene_graph([plate, knife], config).e[0, 0] == pytest.approx(0.2)


def test_a_crowd_keeps_its_nearest_neighbours_only(scene_object: Make) -> None:
    objects = [scene_object(str(k), 0.05 * k - 0.9, 0.0) for k in range(30)]
    graph = build_scene_graph(objects, SceneGraphConfig(context_range_m=2.0, neighbours_max=2))
    assert {tuple(edge) for edge in graph.edges.tolist()} >= {(k, k + 1) for k in range(29)}
    assert len(graph.edges) <= 60


def test_a_feature_that_does_not_exist_is_refused() -> None:
    with pytest.raises(InvalidConfiguration, match="taste"):
        SceneGraphConfig(edge_features=(*THESIS_EDGE_FEATURES, "taste"))
