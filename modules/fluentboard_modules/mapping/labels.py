"""Furniture labels beside a recording: which pieces there are, and where they stand.

A label file is YAML with a list `furniture`, or the fluents that `fluentboard simulate` writes as
`truth.yaml` and `fluentboard export` as YAML:

    furniture:
      - class: Table            # of the furniture ontology
        name: table1            # optional
        pose: {x: 1.2, y: 3.4, yaw_deg: 30}    # middle of its footprint, map frame, metres
        size: [1.4, 0.8, 0.74]                 # along its x and y, and its height

The x axis of a piece points to its front; of pieces without one, along either side.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from fluentboard.errors import FluentboardError, InvalidInput
from fluentboard.model.fluent import Fluent
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard.model.yaml_format import read_fluents
from fluentboard_modules.geometry_fluents import box_of, pose_of
from fluentboard_modules.mapping.evaluation import TruePiece

FILE_NAMES = ("labels.yaml", "truth.yaml")
"""Where labels are looked for beside a recording, in this order."""


class _Place(BaseModel):
    model_config = ConfigDict(extra="forbid")

    x: float = Field(allow_inf_nan=False)
    y: float = Field(allow_inf_nan=False)
    z: float = Field(default=0.0, allow_inf_nan=False)
    yaw_deg: float = Field(default=0.0, allow_inf_nan=False)


class _Piece(BaseModel):
    model_config = ConfigDict(extra="forbid", populate_by_name=True)

    class_name: str = Field(alias="class")
    name: str = ""
    pose: _Place
    size: tuple[float, float, float]


class _Labels(BaseModel):
    model_config = ConfigDict(extra="forbid")

    furniture: list[_Piece]


def labels_beside(recording: str) -> Path:
    """The label file in or beside a recording on disk.

    Raises:
        InvalidInput: there is none.
    """
    folder = Path(recording)
    places = [folder / name for name in FILE_NAMES]
    places += [folder.parent / name for name in FILE_NAMES]
    places.append(folder.with_name(f"{folder.name}.labels.yaml"))
    for place in places:
        if place.is_file():
            return place
    raise InvalidInput(
        f"no labels beside {recording}; give --labels FILE, or write {FILE_NAMES[0]} there"
    )


def read_labels(path: Path, classes: Sequence[str]) -> list[TruePiece]:
    """The labelled furniture of a file.

    Args:
        path: the file.
        classes: that can be found; fluents of other classes are passed over.

    Raises:
        InvalidInput: it cannot be read, is no label file, or names a class that nothing finds.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInput(f"labels {path} cannot be read: {error}") from error
    if "!Fluent" in text:
        return _of_fluents(path, text, classes)
    try:
        labels = _Labels.model_validate(yaml.safe_load(text))
    except (yaml.YAMLError, ValidationError) as error:
        raise InvalidInput(f"labels {path}: {_reason(error)}") from error
    pieces: list[TruePiece] = []
    for number, piece in enumerate(labels.furniture, 1):
        if piece.class_name not in classes:
            raise InvalidInput(
                f"labels {path}, piece {number}: no class {piece.class_name!r} to find; there are "
                f"{', '.join(sorted(classes))}"
            )
        x_size, y_size, height = piece.size
        if min(piece.size) <= 0.0:
            raise InvalidInput(f"labels {path}, piece {number}: sizes are above 0, in metres")
        middle = Pose.from_rpy(
            piece.pose.x,
            piece.pose.y,
            piece.pose.z + 0.5 * height,
            yaw=math.radians(piece.pose.yaw_deg),
        )
        name = piece.name or f"{piece.class_name}{number}"
        box = BoundingBox(middle, x_size, y_size, height)
        pieces.append(TruePiece(name, piece.class_name, box))
    return pieces


def _of_fluents(path: Path, text: str, classes: Sequence[str]) -> list[TruePiece]:
    """Open fluents of these classes with their newest open boxes."""
    try:
        fluents = {fluent.name: fluent for fluent in read_fluents(text.splitlines(), str(path))}
        return [
            piece
            for fluent in fluents.values()
            if fluent.class_name in classes and fluent.is_open
            if (piece := _of_fluent(fluent, fluents)) is not None
        ]
    except InvalidInput:
        raise
    except FluentboardError as error:
        raise InvalidInput(f"labels {path}: {error}") from error


def _of_fluent(fluent: Fluent, fluents: Mapping[str, Fluent]) -> TruePiece | None:
    boxes = _open(fluent, "hasBoundingBox", fluents)
    if not boxes:
        return None
    box = box_of(boxes[-1], fluents)
    poses = _open(fluent, "hasPose", fluents)
    if poses:  # the pose looks to the front; boxes may be turned by a quarter
        yaw_rad = pose_of(poses[-1]).yaw_rad
        quarters = round((yaw_rad - box.pose.yaw_rad) / (0.5 * math.pi))
        x_size, y_size = (box.x_size, box.y_size) if quarters % 2 == 0 else (box.y_size, box.x_size)
        at = Pose.from_rpy(box.pose.x, box.pose.y, box.pose.z, yaw=yaw_rad)
        box = BoundingBox(at, x_size, y_size, box.z_size)
    return TruePiece(fluent.name, fluent.class_name, box)


def _open(fluent: Fluent, relation: str, fluents: Mapping[str, Fluent]) -> list[Fluent]:
    named = (fluents.get(str(name)) for name in fluent.values(relation))
    return [part for part in named if part is not None and part.is_open]


def _reason(error: Any) -> str:
    """The first thing wrong, in one line."""
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the file"
        return f"{where}: {first['msg'].lower()}; give a list `furniture` of class, pose and size"
    return " ".join(str(error).split())
