"""Recording and LiveSource: what some sources can do beyond giving their frames."""

from __future__ import annotations

from typing import Protocol, Self, runtime_checkable

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.frames.sensor_frame import FrameSource


@runtime_checkable
class Recording(FrameSource, Protocol):
    """Frames with poses in a world frame, which `frames.gravity` can turn into the map frame."""

    @property
    def gravity_world(self) -> FloatArray | None:
        """`(3,)` unit vector along which things fall; None for a world with z up."""
        ...

    def in_map(self, T_map_world: Transform) -> Self:
        """The same recording with its frames placed in another map frame."""
        ...

    def every(self, step: int) -> Self:
        """The same recording with only every step-th frame."""
        ...


@runtime_checkable
class LiveSource(FrameSource, Protocol):
    """A source that never ends by itself, and skips what its reader is too slow for."""

    @property
    def dropped(self) -> int:
        """Frames skipped so far."""
        ...

    def stop(self) -> None:
        """Ends the iteration soon; may be called from any thread and from a signal handler."""
        ...
