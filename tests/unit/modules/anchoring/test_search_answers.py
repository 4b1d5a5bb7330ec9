"""Answers to searches that ask where an unseen object would fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from fluentboard.model.fluent import Fluent, Property
from fluentboard_modules.anchoring.context_model import CrfContextModel
from fluentboard_modules.anchoring.crf_data import LabelledGraphs
from fluentboard_modules.anchoring.crf_training import train_crf
from fluentboard_modules.anchoring.datasets import LabelledScene
from fluentboard_modules.anchoring.observation import SceneObject
from fluentboard_modules.anchoring.search_answers import SearchView, answers
from fluentboard_modules.statements import Ending

Laid = Callable[..., tuple[list[LabelledScene], LabelledGraphs]]


@pytest.fixture
def context(laid_tables: Laid) -> CrfContextModel:
    return CrfContextModel(train_crf(laid_tables(20)[1]).model)


@pytest.fixture
def plate(scene_object: Callable[..., SceneObject]) -> SceneObject:
    return scene_object("plate", 0.5, -0.33, (0.26, 0.26, 0.02), confidence=(0.05, 0.05, 0.9))


def board(source: str = "context", target: str = "race:Fork") -> SearchView:
    geometry: list[Fluent] = []
    volumes: list[Fluent] = []
    for name, x in (("left", 0.33), ("right", 0.67)):
        place = [("hasX", x), ("hasY", -0.33), ("hasZ", 0.85), ("hasYaw", 0.0)]
        sizes = [("hasXSize", 0.12), ("hasYSize", 0.12), ("hasZSize", 0.2)]
        geometry += [
            Fluent(f"pose_{name}", "Pose", properties=_numbers(place)),
            Fluent(
                f"box_{name}",
                "BBox",
                properties=(Property("hasPose", "Pose", f"pose_{name}"), *_numbers(sizes)),
            ),
        ]
        box = Property("hasBoundingBox", "BBox", f"box_{name}")
        volumes.append(Fluent(name, "SearchVolume", properties=(box,)))
    search = Fluent(
        "search1",
        "SearchObjectActivity",
        properties=(
            Property("hasTargetClass", "xsd:string", target),
            Property("hasProbabilitySource", "xsd:string", source),
            Property("hasSearchVolume", "SearchVolume", "left"),
            Property("hasSearchVolume", "SearchVolume", "right"),
        ),
    )
    return SearchView([search], volumes, [], {fluent.name: fluent for fluent in geometry})


def _numbers(values: list[tuple[str, float]]) -> tuple[Property, ...]:
    return tuple(Property(name, "xsd:double", value) for name, value in values)


def written(view: SearchView, plate: SceneObject, context: CrfContextModel) -> list[Fluent]:
    found = answers(view, [plate], context, 5.0)
    return [statement for statement in found if isinstance(statement, Fluent)]


def test_every_volume_gets_a_belief_and_the_one_left_of_the_plate_the_higher(
    context: CrfContextModel, plate: SceneObject
) -> None:
    beliefs = written(board(), plate, context)
    about = {b.values("isBeliefAbout")[0]: float(b.values("hasProbability")[0]) for b in beliefs}
    assert set(about) == {"left", "right"}
    assert about["left"] > about["right"]
    assert {b.values("isBeliefOfSearch") for b in beliefs} == {("search1",)}


def test_what_has_been_answered_is_not_answered_again(
    context: CrfContextModel, plate: SceneObject
) -> None:
    told = written(board(), plate, context)
    assert answers(replace(board(), beliefs=told), [plate], context, 6.0) == []


def test_beliefs_end_with_their_search(context: CrfContextModel, plate: SceneObject) -> None:
    told = written(board(), plate, context)
    left = answers(replace(board(), searches=[], beliefs=told), [plate], context, 6.0)
    assert {s.name for s in left if isinstance(s, Ending)} == {b.name for b in told}


@pytest.mark.parametrize("view", [board("uniform"), board(target="Elephant")])
def test_other_searches_are_left_to_others(
    view: SearchView, context: CrfContextModel, plate: SceneObject
) -> None:
    assert answers(view, [plate], context, 5.0) == []
