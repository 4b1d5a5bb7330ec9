"""The depth noise has the statistics of its formulas, and is the same for the same seed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.simulation.noise import (
    NoiseConfig,
    axial_sigma_m,
    lateral_sigma_px,
    noisy_depth,
    projector_shadow,
)

SHAPE = (120, 160)
FOCAL = 580.0
ONLY_AXIAL = NoiseConfig.none().model_copy(update={"axial": 1.0})
ONLY_LATERAL = NoiseConfig.none().model_copy(update={"lateral": 1.0})
ONLY_QUANTISED = NoiseConfig.none().model_copy(update={"quantisation": True})
NO_RNG = np.random.default_rng(0)  # nothing is drawn from it


def flat(depth_m: float) -> NDArray[np.float32]:
    return np.full(SHAPE, depth_m, dtype=np.float32)


def facing(angle_rad: float) -> FloatArray:
    return np.full(SHAPE, angle_rad)


def step(near_m: float, far_m: float, first: int = 60, end: int = 100) -> NDArray[np.float32]:
    depth = flat(far_m)
    depth[:, first:end] = near_m
    return depth


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 60.0, 75.0])
@pytest.mark.parametrize("depth_m", [0.6, 1.0, 2.0, 3.5])
def test_the_axial_deviation_is_that_of_the_formula(
    depth_m: float, angle_deg: float, rng: np.random.Generator
):
    angle = math.radians(angle_deg)
    noisy = noisy_depth(flat(depth_m), facing(angle), FOCAL, ONLY_AXIAL, rng).depth_m
    steep = angle / (math.pi / 2 - angle)
    expected = 0.0012 + 0.0019 * (depth_m - 0.4) ** 2 + 0.0001 / math.sqrt(depth_m) * steep**2
    # 19,200 samples: the standard deviation is known to 0.5 %, three of which are 1.5 %.
    assert float(noisy.std()) == pytest.approx(expected, rel=0.02)
    assert float(noisy.mean()) == pytest.approx(depth_m, abs=4.0 * expected / math.sqrt(noisy.size))


@given(st.floats(0.5, 5.0), st.floats(0.5, 5.0))
def test_what_is_farther_is_noisier(first_m: float, second_m: float):
    near, far = sorted((first_m, second_m))
    frontal = np.zeros(1)
    assert axial_sigma_m(np.array([near]), frontal) <= axial_sigma_m(np.array([far]), frontal)


@given(st.floats(0.0, math.pi / 2), st.floats(0.0, math.pi / 2))
def test_what_is_steeper_is_noisier(first_rad: float, second_rad: float):
    low, high = (np.array([a]) for a in sorted((first_rad, second_rad)))
    assert axial_sigma_m(np.ones(1), low) <= axial_sigma_m(np.ones(1), high)
    assert lateral_sigma_px(low) <= lateral_sigma_px(high)
    assert np.isfinite(axial_sigma_m(np.ones(1), high)).all()


def test_an_edge_wanders_by_the_lateral_deviation(rng: np.random.Generator):
    column = np.broadcast_to(np.arange(SHAPE[1], dtype=np.float32), SHAPE) + 10.0
    shown = noisy_depth(column, facing(0.0), FOCAL, ONLY_LATERAL, rng).depth_m
    wander = (shown - column)[:, 10:-10]
    # Rounding to whole pixels adds a variance of 1/12.
    assert float(wander.std()) == pytest.approx(math.sqrt(0.8**2 + 1.0 / 12.0), rel=0.02)


def test_a_smaller_image_wanders_by_fewer_pixels(rng: np.random.Generator):
    edge = step(1.0, 3.0)
    small = noisy_depth(edge, facing(0.0), FOCAL / 16.0, ONLY_LATERAL, rng).depth_m
    assert np.array_equal(small, edge)


def test_labels_taken_along_agree_with_the_depth(rng: np.random.Generator):
    clean = step(1.0, 3.0)
    config = NoiseConfig(dropout=0.05)
    noisy = noisy_depth(clean, facing(0.2), FOCAL, config, rng)
    labels = (clean < 2.0).astype(int).ravel()[noisy.source]
    measured = noisy.depth_m > 0.0
    assert ((noisy.depth_m < 2.0) == (labels == 1))[measured].all()


@given(st.floats(0.4, 8.0))
def test_a_quantised_depth_has_a_disparity_in_eighths_of_a_pixel(depth_m: float):
    shown = float(
        noisy_depth(flat(depth_m), facing(0.0), FOCAL, ONLY_QUANTISED, NO_RNG).depth_m[0, 0]
    )
    eighths = 8.0 * 580.0 * 0.075 / shown
    # Depths are of single precision: of 870 eighths, that is 1e-4.
    assert eighths == pytest.approx(round(eighths), abs=2e-4)
    # Khoshelham 2012: steps of about 2.87 mm per square metre of depth; rounding errs by half one.
    assert abs(shown - depth_m) <= 0.55 * depth_m**2 / (8.0 * 580.0 * 0.075) + 1e-6


def test_unknown_depth_stays_unknown_when_quantised():
    assert not noisy_depth(flat(0.0), facing(0.0), FOCAL, ONLY_QUANTISED, NO_RNG).depth_m.any()


def test_the_shadow_lies_left_of_the_nearer_surface_and_is_as_wide_as_the_disparity():
    depth = step(1.0, 2.0).astype(np.float64)
    shadow = projector_shadow(depth, 400.0, 0.075)
    width = 400.0 * 0.075 * (1.0 / 1.0 - 1.0 / 2.0)
    columns = np.flatnonzero(shadow.all(axis=0))
    assert columns.max() == 59
    assert len(columns) == pytest.approx(width, abs=2)
    assert not shadow[:, 60:].any()


def test_a_narrow_post_throws_its_shadow_aside():
    # The post is narrower than the shift of its shadow, so background shows between the two.
    depth = step(0.8, 2.4, 80, 84).astype(np.float64)
    shadow = projector_shadow(depth, 580.0, 0.075)
    columns = np.flatnonzero(shadow.all(axis=0))
    assert 3 <= len(columns) <= 5
    assert columns.max() < 60


def test_a_slanted_surface_throws_no_shadow_on_itself():
    slope = np.broadcast_to(np.linspace(1.0, 2.5, SHAPE[1]), SHAPE)
    assert not projector_shadow(slope, 525.0, 0.075).any()
    assert not projector_shadow(slope[:, ::-1], 525.0, 0.075).any()


@pytest.mark.parametrize(
    ("angle_deg", "low", "high"), [(60, 0.0, 0.01), (81, 0.4, 0.6), (88, 1, 1)]
)
def test_grazing_surfaces_get_lost(
    angle_deg: float, low: float, high: float, rng: np.random.Generator
):
    config = NoiseConfig(lateral=0.0, dropout=0.0)
    angle = facing(math.radians(angle_deg))
    noisy = noisy_depth(flat(1.5), angle, FOCAL, config, rng).depth_m
    assert low <= float((noisy == 0.0).mean()) <= high


@given(st.integers(0, 2**32 - 1))
def test_the_same_seed_gives_the_same_bytes(seed: int):
    clean = step(1.0, 3.0)
    first, second = (
        noisy_depth(clean, facing(0.4), FOCAL, NoiseConfig(), np.random.default_rng(seed))
        for _ in range(2)
    )
    assert first.depth_m.tobytes() == second.depth_m.tobytes()
    assert first.source.tobytes() == second.source.tobytes()


def test_another_seed_gives_other_bytes():
    clean = step(1.0, 3.0)
    first, second = (
        noisy_depth(clean, facing(0.4), FOCAL, NoiseConfig(), np.random.default_rng(seed))
        for seed in (1, 2)
    )
    assert first.depth_m.tobytes() != second.depth_m.tobytes()


def test_no_noise_changes_nothing(rng: np.random.Generator):
    clean = step(1.0, 3.0)
    clean[0, :] = 0.0
    assert np.array_equal(
        noisy_depth(clean, facing(1.2), FOCAL, NoiseConfig.none(), rng).depth_m, clean
    )


def test_what_has_no_depth_gets_none(rng: np.random.Generator):
    nothing = np.zeros(SHAPE, dtype=np.float32)
    assert not noisy_depth(nothing, facing(0.0), FOCAL, NoiseConfig(), rng).depth_m.any()
