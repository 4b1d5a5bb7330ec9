"""Settings of live frames, each with its default and unit."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field


class FrameSettings(BaseModel):
    """How many live frames are kept."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    ring_max_bytes: int = Field(
        default=512 * 2**20,
        ge=1,
        description="Size of all kept frames together; beyond it the oldest are dropped.",
    )
    ring_frames: int = Field(
        default=300, ge=1, description="Frames kept of each sensor; beyond it the oldest."
    )
    frame_max_bytes: int = Field(default=16 * 2**20, ge=1, description="Longest frame.")
    sensors_max: int = Field(default=32, ge=1, description="Most sensors that may send frames.")
    wait_max_s: float = Field(
        default=30.0,
        gt=0.0,
        allow_inf_nan=False,
        description="Longest that a request may wait for the next frame.",
    )
