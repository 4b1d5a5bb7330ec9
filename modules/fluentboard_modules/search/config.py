"""Settings of the active search, each with a unit and where its value comes from."""

from __future__ import annotations

import math

from pydantic import BaseModel, ConfigDict, Field


class _Settings(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class SensorModelConfig(_Settings):
    """What a reading does to a cell: OctoMap's inverse sensor model and its defaults."""

    hit_probability: float = Field(default=0.7, gt=0.5, lt=1.0)
    miss_probability: float = Field(default=0.4, gt=0.0, lt=0.5)
    probability_min: float = Field(default=0.1192, gt=0.0, lt=0.5, description="Clamp below.")
    probability_max: float = Field(default=0.971, gt=0.5, lt=1.0, description="Clamp above.")
    fade_margin: float = Field(
        default=0.05,
        gt=0.0,
        lt=0.5,
        description="A fading cell is unknown again when its probability is so near to one half.",
    )

    @property
    def log_odds_updates(self) -> tuple[float, float, float, float]:
        """Log-odds of a hit, of a miss, and the lowest and highest that a cell can have."""
        hit, miss, low, high = (
            math.log(p / (1.0 - p))
            for p in (
                self.hit_probability,
                self.miss_probability,
                self.probability_min,
                self.probability_max,
            )
        )
        return hit, miss, low, high
