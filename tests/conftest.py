"""What all tests share: Hypothesis repeats itself, randomness is seeded, real data is optional."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

settings.register_profile("ci", derandomize=True, deadline=None, database=None)
settings.load_profile("ci")  # `pytest --hypothesis-profile default` explores further

_CHECKOUT = Path(__file__).resolve().parent.parent


@pytest.fixture
def rng() -> np.random.Generator:
    """The one source of random scenes and noise, the same in every run."""
    return np.random.default_rng(2018)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real recordings, or a skip where there is none."""
    folder = Path(os.environ.get("FLUENTBOARD_SHARED_DATA") or _CHECKOUT.parent / "shared" / "data")
    if not folder.is_dir():
        pytest.skip(f"no recordings in {folder}; set FLUENTBOARD_SHARED_DATA to their folder")
    return folder
