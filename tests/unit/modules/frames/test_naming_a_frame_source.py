"""What `--frames` may say."""

from __future__ import annotations

import pytest

from fluentboard.errors import InvalidFrame, InvalidInput
from fluentboard_modules.frames.sources import open_source


def test_unknown_simulation_names_what_there_is() -> None:
    with pytest.raises(InvalidInput, match="there is simulated-restaurant"):
        open_source("simulated-kitchen")


def test_seed_is_a_number() -> None:
    with pytest.raises(InvalidInput, match="'simulated-restaurant:x'"):
        open_source("simulated-restaurant:x")


@pytest.mark.parametrize("text", ["/no/such/folder", "/no/such/table.pcd"])
def test_source_that_is_not_there_is_named(text: str) -> None:
    with pytest.raises(InvalidFrame, match=text):
        open_source(text)
