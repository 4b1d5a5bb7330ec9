"""Detection: what a detector saw in one frame, as fluents that any program can post, and back.

A detection has the confidence of each class and a box: in the image, or in the map. It is a fluent
of the class `ObjectDetection` that holds while the frame was exposed:

    - name: det_head_1690000000250_1
      type: ObjectDetection
      start: [1690000000.25, 1690000000.25]
      finish: [1690000000.251, 1690000000.251]
      hasSensor: head
      hasConfidences: '{"Mug": 0.83, "Dish": 0.1}'
      hasImage: colour
      hasLeft: 301.5      # pixels; the centre of the first pixel is at 0
      hasTop: 200.0
      hasRight: 352.0
      hasBottom: 261.0

A box in the map is a `hasBoundingBox` with its pose, as in Listing 4.1.
"""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

from fluentboard.errors import FluentboardError, InvalidInput
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard.model.interval import Interval

logger = logging.getLogger(__name__)

DETECTION_CLASS = "ObjectDetection"
EXPOSURE_S = 0.001
"""How long a detection holds from the stamp of its frame on: an instant would never hold."""

IMAGES = ("depth", "colour")
_SIDES = ("hasLeft", "hasTop", "hasRight", "hasBottom")
_SIZES = ("hasXSize", "hasYSize", "hasZSize")
_COORDINATES = ("hasX", "hasY", "hasZ", "hasRoll", "hasPitch", "hasYaw")


@dataclass(frozen=True, slots=True)
class ImageBox:
    """An upright rectangle in an image, in pixels; the centre of the first pixel is at 0.

    Attributes:
        left: smallest column.
        top: smallest row.
        right: largest column.
        bottom: largest row.
        image: `depth` or `colour`; the two may be images of different cameras.

    Raises:
        InvalidInput: a side is not finite, the sides are the wrong way round, or there is no such
            image.
    """

    left: float
    top: float
    right: float
    bottom: float
    image: str = "colour"

    def __post_init__(self) -> None:
        sides = (self.left, self.top, self.right, self.bottom)
        if not all(math.isfinite(side) for side in sides):
            raise InvalidInput(f"image box {sides} is not finite; give pixels")
        if self.left >= self.right or self.top >= self.bottom:
            raise InvalidInput(
                f"image box {sides} is empty; give left < right and top < bottom, in pixels"
            )
        if self.image not in IMAGES:
            raise InvalidInput(f"no image is called {self.image!r}; give depth or colour")

    def overlap(self, other: ImageBox) -> float:
        """Area that both cover over the area that either covers, 0 to 1 (IoU)."""
        width = min(self.right, other.right) - max(self.left, other.left)
        height = min(self.bottom, other.bottom) - max(self.top, other.top)
        if width <= 0.0 or height <= 0.0:
            return 0.0
        common = width * height
        return common / (self.area + other.area - common)

    @property
    def area(self) -> float:
        """In square pixels."""
        return (self.right - self.left) * (self.bottom - self.top)


@dataclass(frozen=True, slots=True)
class ObjectDetection:
    """One object that a detector saw in one frame.

    Attributes:
        confidences: by the detector's name of the class, each in [0, 1]; they need not sum to 1.
        box: where, in an image or in the map.

    Raises:
        InvalidInput: there is no confidence, or one is not between 0 and 1.
    """

    confidences: Mapping[str, float]
    box: ImageBox | BoundingBox

    def __post_init__(self) -> None:
        if not self.confidences:
            raise InvalidInput("a detection has no class; give a confidence for at least one")
        for name, value in self.confidences.items():
            if not 0.0 <= value <= 1.0:
                raise InvalidInput(f"confidence {value} of {name!r}; each must lie between 0 and 1")


def detection_fluents(
    detections: Sequence[ObjectDetection], stamp_s: float, sensor: str = "camera"
) -> list[Fluent]:
    """The fluents that say what a detector saw in a frame; assert all of a frame in one batch.

    The names follow from sensor, time and order, so a repeated batch changes nothing.

    Args:
        detections: of the frame.
        stamp_s: when the frame was taken, as its source says, in seconds.
        sensor: name of the sensor.
    """
    start, finish = Interval.at(stamp_s), Interval.at(stamp_s + EXPOSURE_S)
    word = "".join(letter if letter.isalnum() else "_" for letter in sensor) or "camera"
    fluents: list[Fluent] = []
    for number, detection in enumerate(detections, 1):
        name = f"det_{word}_{round(stamp_s * 1000.0)}_{number}"
        values = {key: float(value) for key, value in detection.confidences.items()}
        properties = [
            Property("hasSensor", "xsd:string", sensor),
            Property("hasConfidences", "xsd:string", json.dumps(values, ensure_ascii=False)),
        ]
        box = detection.box
        if isinstance(box, ImageBox):
            sides = zip(_SIDES, (box.left, box.top, box.right, box.bottom), strict=True)
            properties.append(Property("hasImage", "xsd:string", box.image))
            properties += [Property(key, "xsd:double", float(side)) for key, side in sides]
        else:
            properties.append(Property("hasBoundingBox", "BBox", f"{name}_box"))
            fluents += _box_fluents(f"{name}_box", box, start, finish)
        fluents.append(Fluent(name, DETECTION_CLASS, start, finish, tuple(properties)))
    return fluents


def read_detections(
    fluents: Iterable[Fluent], geometry: Mapping[str, Fluent], sensor: str = ""
) -> list[ObjectDetection]:
    """The detections that fluents tell of; those that say too little are left out, with a warning.

    Args:
        fluents: of the class `ObjectDetection`.
        geometry: boxes and their poses, by name.
        sensor: only those of this sensor, and those of none; empty for all.
    """
    found: list[ObjectDetection] = []
    for fluent in fluents:
        sensors = fluent.values("hasSensor")
        if sensor and sensors and sensor not in sensors:
            continue
        try:
            found.append(_detection(fluent, geometry))
        except FluentboardError as problem:
            logger.warning("detection %s is left out: %s", fluent.name, problem.message)
    return found


def _box_fluents(name: str, box: BoundingBox, start: Interval, finish: Interval) -> list[Fluent]:
    pose = f"{name}_pose"
    sizes = zip(_SIZES, box.sizes.tolist(), strict=True)
    places = zip(_COORDINATES, (box.pose.x, box.pose.y, box.pose.z, *box.pose.rpy), strict=True)
    return [
        Fluent(
            name,
            "BBox",
            start,
            finish,
            (
                Property("hasPose", "Pose", pose),
                *(Property(key, "xsd:float", float(size)) for key, size in sizes),
            ),
        ),
        Fluent(
            pose,
            "Pose",
            start,
            finish,
            tuple(Property(key, "xsd:float", float(value)) for key, value in places),
        ),
    ]


def _detection(fluent: Fluent, geometry: Mapping[str, Fluent]) -> ObjectDetection:
    told = fluent.values("hasConfidences")
    try:
        values: object = json.loads(str(told[-1])) if told else None
    except ValueError:
        values = None
    if not isinstance(values, dict):
        raise InvalidInput(
            'hasConfidences is missing or no JSON object; give one such as {"Mug": 0.83}'
        )
    confidences: dict[str, float] = {}
    for name, value in cast("dict[str, object]", values).items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InvalidInput(f"confidence {value!r} of {name!r} is no number")
        confidences[name] = float(value)
    return ObjectDetection(confidences, _box(fluent, geometry))


def _box(fluent: Fluent, geometry: Mapping[str, Fluent]) -> ImageBox | BoundingBox:
    sides = [_number(fluent, key) for key in _SIDES]
    if None not in sides:
        left, top, right, bottom = (side for side in sides if side is not None)
        image = fluent.values("hasImage")
        return ImageBox(left, top, right, bottom, str(image[-1]) if image else "colour")
    for name in fluent.values("hasBoundingBox"):
        box = geometry.get(str(name))
        poses = box.values("hasPose") if box is not None else ()
        pose = geometry.get(str(poses[-1])) if poses else None
        if box is None or pose is None:
            continue
        x, y, z, roll, pitch, yaw = (_number(pose, key) or 0.0 for key in _COORDINATES)
        x_size, y_size, z_size = (_number(box, key) or 0.0 for key in _SIZES)
        return BoundingBox(Pose.from_rpy(x, y, z, roll, pitch, yaw), x_size, y_size, z_size)
    raise InvalidInput(
        "no box; give hasLeft, hasTop, hasRight and hasBottom in pixels, or a hasBoundingBox whose "
        "pose is on the board"
    )


def _number(fluent: Fluent, key: str) -> float | None:
    values = fluent.values(key)
    try:
        return float(values[-1]) if values else None
    except (TypeError, ValueError):
        raise InvalidInput(f"{key} = {values[-1]!r} is no number") from None
