"""Joint recognition of a scene: variants, beliefs, refusals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fluentboard.errors import InvalidModel
from fluentboard_modules.anchoring.context_model import VARIANTS, CrfContextModel
from fluentboard_modules.anchoring.crf_data import LabelledGraphs
from fluentboard_modules.anchoring.crf_training import train_crf
from fluentboard_modules.anchoring.datasets import LabelledScene
from fluentboard_modules.anchoring.observation import SceneObject
from fluentboard_modules.anchoring.scene_graph import SceneGraphConfig

Laid = Callable[..., tuple[list[LabelledScene], LabelledGraphs]]


@pytest.fixture
def context(laid_tables: Laid) -> CrfContextModel:
    config = SceneGraphConfig(context_range_m=1.0)
    return CrfContextModel(train_crf(laid_tables(12, config)[1]).model, config)


def test_beliefs_name_the_best_class_and_sum_to_one(
    context: CrfContextModel, laid_tables: Laid
) -> None:
    scene = laid_tables(1, seed=9)[0][0]
    beliefs = context.infer(scene.objects)
    assert {name: belief.best for name, belief in beliefs.items()} == {
        o.name: label for o, label in zip(scene.objects, scene.labels, strict=True)
    }
    assert all(belief.marginals.sum() == pytest.approx(1.0) for belief in beliefs.values())


def test_the_variants_are_those_of_table_4_7() -> None:
    assert list(VARIANTS) == ["Loc", "CRF+A", "CRF+Loc", "CRF+A+Loc"]


def test_local_recognition_alone_ignores_the_context(
    context: CrfContextModel, scene_object: Callable[..., SceneObject]
) -> None:
    seen = scene_object("thing", 0.0, 0.0, confidence=(0.2, 0.6, 0.0))
    belief = replace(context, variant=VARIANTS["Loc"]).infer([seen])["thing"]
    assert belief.best == "Knife"
    assert belief.marginals == pytest.approx([0.25, 0.75, 0.0])


def test_without_anchors_only_what_is_seen_takes_part(
    context: CrfContextModel, laid_tables: Laid
) -> None:
    scene = laid_tables(1)[0][0]
    objects = [replace(o, is_tracked=k < 3) for k, o in enumerate(scene.objects)]
    seen = replace(context, variant=VARIANTS["CRF+Loc"]).infer(objects)
    assert set(seen) == {o.name for o in objects[:3]}
    assert set(context.infer(objects)) == {o.name for o in objects}


def test_beliefs_name_the_neighbours_they_draw_on(
    context: CrfContextModel, scene_object: Callable[..., SceneObject]
) -> None:
    objects = [
        scene_object(name, x, 0.0, confidence=(0.3, 0.3, 0.4))
        for name, x in (("a", -0.9), ("b", -0.7), ("c", 0.9))
    ]
    beliefs = context.infer(objects)
    assert [beliefs[name].neighbours for name in "abc"] == [("b",), ("a",), ()]


def test_confidences_of_another_recogniser_are_refused(
    context: CrfContextModel, scene_object: Callable[..., SceneObject]
) -> None:
    with pytest.raises(InvalidModel, match="2 confidences"):
        context.infer([scene_object("a", 0.0, 0.0, confidence=(0.5, 0.5))])


def test_scene_graphs_of_other_features_are_refused(context: CrfContextModel) -> None:
    with pytest.raises(InvalidModel, match="features"):
        CrfContextModel(context.model, SceneGraphConfig.of_the_thesis())


def test_nothing_in_view_gives_no_beliefs(context: CrfContextModel) -> None:
    assert context.infer([]) == {}


def test_the_order_of_the_objects_does_not_matter(
    context: CrfContextModel, laid_tables: Laid
) -> None:
    scene = laid_tables(1, seed=4)[0][0]
    there, back = context.infer(scene.objects), context.infer(scene.objects[::-1])
    for name, belief in there.items():
        assert back[name].best == belief.best
        assert np.allclose(back[name].marginals, belief.marginals, atol=1e-4)
