"""Settings: the shape that the settings of all modules share."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Settings(BaseModel):
    """A group of settings: complete defaults, never changed, and unknown names are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)
