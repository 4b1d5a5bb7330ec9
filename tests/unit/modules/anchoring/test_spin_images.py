"""Spin images and the recogniser that compares them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fluentboard.errors import InvalidInput, InvalidModel
from fluentboard.model.geometry import BoundingBox, FloatArray, Pose
from fluentboard_modules.anchoring.config import RecognitionConfig
from fluentboard_modules.anchoring.observation import Cluster
from fluentboard_modules.anchoring.recogniser_sizes import SizeRecogniser
from fluentboard_modules.anchoring.recogniser_spin_images import load_recogniser, train_recogniser
from fluentboard_modules.anchoring.recogniser_training import household_models
from fluentboard_modules.anchoring.recognisers import context_of, recogniser_of
from fluentboard_modules.anchoring.spin_images import SpinImageConfig, describe

EYE = np.array([0.0, -1.0, 0.8])


def ball(rng: np.random.Generator, radius: float = 0.05) -> FloatArray:
    way = rng.normal(size=(300, 3))
    return radius * way / np.linalg.norm(way, axis=1, keepdims=True)


def slab(rng: np.random.Generator, size: float = 0.2) -> FloatArray:
    return rng.uniform(-0.5, 0.5, (300, 3)) * (size, size, 0.005)


def cluster(points: FloatArray) -> Cluster:
    box = BoundingBox(Pose(0.0, 0.0, 0.0), *(float(v) for v in np.ptp(points, axis=0)))
    return Cluster(points, np.zeros((len(points), 2), np.int64), box, 1.0, EYE)


def test_an_object_has_ten_spin_images_of_45_components() -> None:
    images = describe(ball(np.random.default_rng(0)), EYE)
    assert images.shape == (10, 45)
    assert images.sum(axis=1) == pytest.approx(np.ones(10))


@settings(max_examples=20)
@given(yaw=st.floats(-3.0, 3.0), shift=st.floats(-2.0, 2.0), seed=st.integers(0, 1000))
def test_spin_images_do_not_change_under_rigid_motion(yaw: float, shift: float, seed: int) -> None:
    points = slab(np.random.default_rng(seed))
    motion = Pose.from_rpy(shift, 0.3, -shift, yaw=yaw).to_transform()
    there, back = describe(points, EYE), describe(motion.apply(points), motion.apply(EYE))
    assert np.allclose(there, back, atol=1e-6)


def test_the_number_of_points_hardly_matters() -> None:
    points = ball(np.random.default_rng(1))
    config = SpinImageConfig(normal_radius_m=0.05)
    assert (
        np.abs(describe(points, EYE, config)[0] - describe(points[::2], EYE, config)[0]).max() < 0.1
    )


def test_no_points_have_empty_spin_images() -> None:
    assert not describe(np.zeros((0, 3)), EYE).any()


def test_a_recogniser_tells_balls_from_slabs_and_is_the_same_from_disk(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    examples = [ball(rng) for _ in range(4)] + [slab(rng) for _ in range(4)]
    trained = train_recogniser([cluster(p) for p in examples], ["Ball"] * 4 + ["Slab"] * 4)
    trained.save(tmp_path / "shapes.npz")
    loaded = load_recogniser(tmp_path / "shapes.npz")
    for made, best in ((ball(rng), 0), (slab(rng), 1)):
        confidence = trained.recognise(cluster(made))
        assert int(np.argmax(confidence)) == best
        assert confidence.sum() == pytest.approx(1.0)
        assert np.array_equal(loaded.recognise(cluster(made)), confidence)


def test_nothing_can_be_learned_from_nothing() -> None:
    with pytest.raises(InvalidInput, match="no examples"):
        train_recogniser([], [])


def test_a_damaged_recogniser_is_refused(tmp_path: Path) -> None:
    (tmp_path / "r.npz").write_bytes(b"PK")
    with pytest.raises(InvalidModel, match="train recogniser"):
        load_recogniser(tmp_path / "r.npz")


def test_the_built_in_models_fit_each_other() -> None:
    config = RecognitionConfig(recogniser="spin-images", context="tableware")
    recogniser = recogniser_of(config)
    context = context_of(config, recogniser)
    assert context is not None
    assert context.classes == recogniser.classes
    assert {"Fork", "Mug", "Plate"} <= set(recogniser.classes)


def test_the_household_has_what_searches_look_for() -> None:
    classes = recogniser_of(RecognitionConfig(recogniser="household")).classes
    assert {"Book", "Bottle", "Mug", "PepperMill"} <= set(classes)
    assert classes == tuple(sorted(household_models(services=1)))


def test_the_built_in_context_refuses_a_recogniser_of_other_classes() -> None:
    config = RecognitionConfig(recogniser="geometric", context="tableware")
    with pytest.raises(InvalidModel):
        context_of(config, recogniser_of(config))


def test_sizes_tell_what_is_usual_and_a_class_never_seen_stays_possible() -> None:
    small, large = (BoundingBox(Pose(0.0, 0.0, 0.0), s, s, s) for s in (0.1, 0.5))
    odd = BoundingBox(Pose(0.0, 0.0, 0.0), 0.4, 0.3, 0.02)
    boxes, labels = [small] * 5 + [large] * 5, ["Mug"] * 5 + ["Monitor"] * 5
    sizes = SizeRecogniser.of_boxes(boxes, labels, ("Laptop", "Monitor", "Mug"))
    assert [int(np.argmax(sizes.rate(box))) for box in (large, small, odd)] == [1, 2, 0]
