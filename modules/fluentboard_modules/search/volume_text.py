"""Search volumes as text on the command line."""

from __future__ import annotations

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.search.region import SearchVolume


def volume_of_text(text: str) -> SearchVolume:
    """The volume of a text such as `table1:0.4:2.9,2.2,0.9:1.2,0.8,0.3:0.1`.

    Name, probability, centre x,y,z and edge lengths in metres, and, if the box is turned, its yaw
    in radians.

    Raises:
        InvalidInput: the text is not of this form.
    """
    parts = text.split(":")
    try:
        name, probability, centre, size = parts[:4]
        yaw = float(parts[4]) if len(parts) == 5 else 0.0
        x, y, z = (float(v) for v in centre.split(","))
        length, width, height = (float(v) for v in size.split(","))
        chance = float(probability)
        if len(parts) > 5 or not name:
            raise ValueError
    except ValueError:
        raise InvalidInput(
            f"{text!r} is no search volume; write NAME:P:X,Y,Z:L,W,H or NAME:P:X,Y,Z:L,W,H:YAW, "
            "such as table1:0.4:2.9,2.2,0.9:1.2,0.8,0.3"
        ) from None
    return SearchVolume(
        name, BoundingBox(Pose.from_rpy(x, y, z, yaw=yaw), length, width, height), chance
    )
