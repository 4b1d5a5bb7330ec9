"""Where an unseen object would fit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.anchoring.context_model import CrfContextModel
from fluentboard_modules.anchoring.context_prediction import (
    CandidateVolume,
    candidate_places,
    class_probability_at,
    volume_probabilities,
)
from fluentboard_modules.anchoring.crf_data import LabelledGraphs
from fluentboard_modules.anchoring.crf_training import train_crf
from fluentboard_modules.anchoring.datasets import LabelledScene
from fluentboard_modules.anchoring.observation import SceneObject, SupportPlane

Laid = Callable[..., tuple[list[LabelledScene], LabelledGraphs]]
Make = Callable[..., SceneObject]


@pytest.fixture
def context(laid_tables: Laid) -> CrfContextModel:
    return CrfContextModel(train_crf(laid_tables(20)[1]).model)


@pytest.fixture
def plate(scene_object: Make) -> SceneObject:
    return scene_object("plate", 0.5, -0.33, (0.26, 0.26, 0.02), confidence=(0.05, 0.05, 0.9))


def test_a_fork_is_expected_to_the_left_of_a_plate_and_a_knife_to_its_right(
    context: CrfContextModel, plate: SceneObject, table: SupportPlane
) -> None:
    places = np.array([[0.33, -0.33, 0.76], [0.67, -0.33, 0.76]])
    rating = class_probability_at(places, table, [plate], context.infer([plate]), context)
    fork, knife, _ = context.classes
    assert (fork, knife) == ("Fork", "Knife")
    assert rating[0, 0] > rating[0, 1]
    assert rating[1, 1] > rating[1, 0]
    assert rating.sum(axis=1) == pytest.approx([1.0, 1.0])


def test_the_volume_beside_a_plate_is_likelier_to_hold_a_fork(
    context: CrfContextModel, plate: SceneObject, table: SupportPlane
) -> None:
    volumes = [
        CandidateVolume(name, BoundingBox(Pose(x, -0.33, 0.85), 0.12, 0.12, 0.2), table)
        for name, x in (("left", 0.33), ("right", 0.67))
    ]
    found = volume_probabilities("Fork", volumes, [plate], context)
    assert 0.0 < found["right"] < found["left"] < 1.0


def test_without_anything_known_all_volumes_are_as_usual(context: CrfContextModel) -> None:
    box = BoundingBox(Pose(0.0, 0.0, 0.85), 0.3, 0.3, 0.2)
    found = volume_probabilities("Fork", [CandidateVolume("v", box)], [], context)
    assert found == {"v": pytest.approx(0.2)}


def test_a_class_that_the_model_does_not_know_cannot_be_predicted(
    context: CrfContextModel,
) -> None:
    with pytest.raises(InvalidInput, match="Elephant"):
        volume_probabilities("Elephant", [], [], context)


def test_places_where_something_stands_do_not_count(
    plate: SceneObject, table: SupportPlane
) -> None:
    box = BoundingBox(Pose(0.5, -0.33, 0.85), 0.2, 0.2, 0.2)
    volume = CandidateVolume("v", box, table)
    assert len(candidate_places(volume, [], 0.1)) == 4
    assert len(candidate_places(volume, [plate], 0.1)) == 0
