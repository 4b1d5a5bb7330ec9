"""Values as people read them."""

from __future__ import annotations

import math

import pytest

from fluentboard_client.results import Iri, Term, term_text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "-"),
        (True, "true"),
        (3, "3"),
        (0.7400000001, "0.74"),
        (1423225357.28, "1423225357.28"),
        (1423225357.0, "1423225357"),
        (-250000.5, "-250000.5"),
        (1.5e-9, "1.5e-09"),
        (2.5e20, "2.5e+20"),
        (math.inf, "inf"),
        (Iri("http://example.org/things#mug1"), "mug1"),
    ],
)
def test_times_keep_their_digits_and_lengths_lose_their_noise(
    value: Term | None, text: str
) -> None:
    assert term_text(value) == text
