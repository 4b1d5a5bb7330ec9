"""The settings of anchoring, fitted to the recording."""

from __future__ import annotations

import logging

from fluentboard_modules.anchoring.config import AnchoringConfig
from fluentboard_modules.frames.recordings import LiveSource
from fluentboard_modules.frames.sensor_frame import FrameSource

logger = logging.getLogger(__name__)


def for_short_recordings(config: AnchoringConfig, source: FrameSource) -> AnchoringConfig:
    """Settings with which a single image, or a few, can show an object at all.

    A track becomes an anchor when `world.confirm_frames` frames have shown it. A recording that
    has fewer would leave nothing on the board; unless the settings name that number themselves, it
    is lowered to what the recording has.
    """
    if isinstance(source, LiveSource):
        return config
    frames = len(source)
    world = config.world
    if not 0 < frames < world.confirm_frames:
        return config
    if "confirm_frames" in world.model_fields_set:
        logger.warning(
            "%s has %d frames, and world.confirm_frames asks for %d before an object is anchored",
            source.name,
            frames,
            world.confirm_frames,
        )
        return config
    world = world.model_copy(update={"confirm_frames": frames})
    return config.model_copy(update={"world": world})
