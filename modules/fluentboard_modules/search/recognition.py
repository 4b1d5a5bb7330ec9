"""In simulation: what is sought is recognised when a frame shows enough of it."""

from __future__ import annotations

import numpy as np

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.geometry_fluents import box_fluents, pose_fluent
from fluentboard_modules.search.request import SearchRequest
from fluentboard_modules.search.worlds import SearchWorld
from fluentboard_modules.statements import Statement

_PIXELS_TO_RECOGNISE = 40  # of an image of 640 pixels width


def recognised(frame: SensorFrame, request: SearchRequest, world: SearchWorld) -> list[Statement]:
    """The sought thing as an object with its true pose, or nothing.

    Args:
        frame: with labels; without them nothing is recognised.
        request: what is sought.
        world: whose things have labels.
    """
    if frame.labels is None:
        return []
    enough = _PIXELS_TO_RECOGNISE * (frame.camera.width / 640.0) ** 2
    range_m = min(world.robot.model.range_m[1], request.config.detector_range_m or np.inf)
    counts = np.bincount(frame.labels[frame.depth_m <= range_m])
    for label, thing in world.things.items():
        sought = request.target_name == thing.name or request.target_class == thing.cls
        if sought and label < len(counts) and counts[label] >= enough:
            since, stem = Interval.at(frame.stamp_s), f"{thing.name}_{request.name}"
            pose = pose_fluent(f"pose_{stem}", thing.pose, since)
            box = box_fluents(f"bBox_{stem}", f"poseBB_{stem}", thing.box, since)
            links = (
                Property("hasPose", "Pose", pose.name),
                Property("hasBoundingBox", "BBox", box[0].name),
                Property("hasConfidence", "xsd:double", 1.0),
            )
            return [pose, *box, Fluent(thing.name, thing.cls, since, UNKNOWN, links)]
    return []
