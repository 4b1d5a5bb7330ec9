"""Text files of recordings: matrices, poses, cameras, gravity; every number is checked."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fluentboard.errors import FluentboardError, InvalidFrame
from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.frames.image_files import png_size
from fluentboard_modules.frames.sensor_frame import Camera

INTRINSICS_FILE = "camera-intrinsics.txt"
GRAVITY_FILE = "gravity-direction.txt"


def read_text(path: Path) -> str:
    """The text of a file.

    Raises:
        InvalidFrame: it cannot be read or is not text.
    """
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidFrame(f"{path}: cannot be read ({error}); restore the file") from error


def read_numbers(path: Path, shape: tuple[int, ...] | None = None) -> FloatArray:
    """The numbers of a text file.

    Args:
        path: the file.
        shape: of the result; as many numbers as it has must be there. None: `(n,)`, all there are.

    Raises:
        InvalidFrame: the file cannot be read, holds no number or not as many as wanted.
    """
    words = read_text(path).split()
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError as error:  # 7-Scenes itself holds "-1.#IND" where tracking was lost
        raise InvalidFrame(f"{path}: holds something that is not a number ({error})") from error
    if shape is None:
        return numbers
    if numbers.size != np.prod(shape):
        expected = "x".join(str(side) for side in shape)
        raise InvalidFrame(f"{path}: holds {numbers.size} numbers, expected {expected}")
    return numbers.reshape(shape)


def read_pose(path: Path) -> Transform:
    """The pose in a file of a 4x4 matrix.

    Raises:
        InvalidFrame: it is none; the message names the file.
    """
    return pose_from_matrix(read_numbers(path, (4, 4)), str(path))


def pose_from_matrix(matrix: FloatArray, where: str) -> Transform:
    """The pose that a recorded `(4, 4)` matrix means.

    Args:
        matrix: as recorded.
        where: names the matrix in errors.

    Raises:
        InvalidFrame: it is not a rigid motion, or tracking was lost.
    """
    if not np.isfinite(matrix).all():
        raise InvalidFrame(f"{where}: the pose holds NaN or infinity (tracking was lost)")
    # Poses of 7-Scenes are off a rotation by up to 2e-4 (filtered by their tracker, then printed);
    # left alone, the errors add up in products. The nearest rotation is that of the SVD.
    left, stretch, right = np.linalg.svd(matrix[:3, :3])
    if np.abs(stretch - 1.0).max() < 0.01:
        matrix = matrix.copy()
        matrix[:3, :3] = left @ right
    try:
        return Transform(matrix)
    except FluentboardError as error:
        raise InvalidFrame(f"{where}: {error.message}") from error


def read_camera(path: Path, depths: Iterable[Path]) -> Camera | None:
    """The camera of a file of a 3x3 matrix, None if there is no such file.

    The file holds no image size, so the size is that of the first depth image that has one.

    Args:
        path: the file.
        depths: depth images.

    Raises:
        InvalidFrame: the file is damaged, or no depth image is readable.
    """
    if not path.is_file():
        return None
    matrix = read_numbers(path, (3, 3))
    size = next((size for depth in depths if (size := png_size(depth)) is not None), None)
    if size is None:
        raise InvalidFrame(f"{path.parent}: not one depth image of the recording can be read")
    return Camera.from_matrix(*size, matrix)


def read_json(path: Path) -> Mapping[str, Any]:
    """The object in a JSON file.

    Raises:
        InvalidFrame: it cannot be read or is no object.
    """
    try:
        document: Any = json.loads(read_text(path))
    except json.JSONDecodeError as error:
        raise InvalidFrame(f"{path}: is not JSON ({error}); restore the file") from error
    if not isinstance(document, dict):
        raise InvalidFrame(f"{path}: holds no JSON object; restore the file")
    return document


def camera_from_json(document: Mapping[str, Any], where: str) -> Camera:
    """The camera in Open3D's JSON: width, height and the matrix column by column.

    Args:
        document: with `width`, `height` and `intrinsic_matrix`, at the top or below `intrinsic`.
        where: names the document in errors.

    Raises:
        InvalidFrame: a member is missing or is not what it should be.
    """
    members = document.get("intrinsic", document)
    try:
        width, height = int(members["width"]), int(members["height"])
        matrix = np.array(members["intrinsic_matrix"], dtype=np.float64).reshape(3, 3).T
    except (KeyError, TypeError, ValueError) as error:
        raise InvalidFrame(
            f"{where}: no camera in it ({error!r}); it needs width, height and intrinsic_matrix, "
            "nine numbers column by column"
        ) from error
    if abs(matrix[2, 2] - 1.0) > 1e-9 or not np.isfinite(matrix).all():
        raise InvalidFrame(
            f"{where}: intrinsic_matrix ends in {matrix[2, 2]}, not in 1; give its nine numbers "
            "column by column"
        )
    return Camera.from_matrix(width, height, matrix)


def read_gravity(path: Path) -> FloatArray | None:
    """`(3,)`; the unit vector of a gravity file, None if there is no such file.

    Raises:
        InvalidFrame: it holds no direction.
    """
    if not path.is_file():
        return None
    gravity = read_numbers(path, (3,))
    length = float(np.linalg.norm(gravity))
    if not (np.isfinite(length) and length > 1e-6):
        raise InvalidFrame(f"{path}: {gravity} is no direction; give the gravity vector")
    return gravity / length
