"""Write frames as a recording: the folder layout of the 7-Scenes data set, with the truth.

Per frame `frame-NNNNNN.depth.png` (16 bit, mm, 0 = unknown), `.color.jpg` or `.color.png`
(registered to depth), `.pose.txt` (4x4, camera to map, metres) and `.labels.png` (16 bit, 0 =
background). Per recording `camera-intrinsics.txt`, `gravity-direction.txt`, `stamps.txt` (seconds,
one per frame), `recording.json` (what it is) and `truth.json` (class, pose, box, label of
everything), which is a scene that `load_scene` reads, its models in `meshes/` as STL in metres.
"""

from __future__ import annotations

import json
import logging
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidInput
from fluentboard_modules.frames.sensor_frame import FrameSource, SensorFrame
from fluentboard_modules.simulation.cad_writing import MESH_FOLDER, write_meshes
from fluentboard_modules.simulation.scene import Scene
from fluentboard_modules.simulation.scene_json import scene_to_json

logger = logging.getLogger(__name__)

TRUTH_FILE = "truth.json"
DEPTH_UNITS_PER_M = 1000.0
_FRAMES_WAITING = 3
_MOST = 65534  # 65535 means "no measurement", as 0 does

Progress = Callable[[int, int], None]
"""Called with the number of frames written and the number of all frames."""


def record(
    source: FrameSource,
    folder: str | Path,
    scene: Scene | None = None,
    progress: Progress | None = None,
    colour: Literal["jpg", "png"] = "jpg",
) -> int:
    """Write all frames of a source, and the truth if the scene is given; returns how many.

    Args:
        source: a `SimulatedDrive` or any other source with poses in a map frame with z up.
        folder: created if missing; must not hold a recording.
        scene: what the frames show.
        progress: called after every frame.
        colour: JPEG is small, PNG is exact.

    Raises:
        InvalidInput: the folder holds frames already, or a frame's camera differs from the first's.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    if next(folder.glob("frame-*"), None) is not None:
        raise InvalidInput(f"{folder} holds a recording already; choose an empty folder")
    stamps: list[str] = []
    camera = None
    # The next frame is rendered while the last ones are compressed; both leave the interpreter.
    with ThreadPoolExecutor(max_workers=1) as writer:
        waiting: deque[Future[None]] = deque()

        def finish_one() -> None:
            waiting.popleft().result()
            if progress is not None:
                progress(len(stamps) - len(waiting), len(source))

        for number, frame in enumerate(source):
            if camera is None:
                camera = frame.camera
                _write_calibration(folder, frame)
            elif frame.camera != camera:
                raise InvalidInput(
                    f"frame {frame.index} of {source.name} has another camera than the first; "
                    "the layout has one camera per recording"
                )
            stem = folder / f"frame-{number:06d}"
            waiting.append(writer.submit(_write_frame, stem, frame, colour))
            stamps.append(f"{frame.stamp_s:.6f}")
            if len(waiting) > _FRAMES_WAITING:
                finish_one()
        while waiting:
            finish_one()
    (folder / "stamps.txt").write_text("\n".join([*stamps, ""]), encoding="utf-8")
    about = {
        "name": source.name,
        "frames": len(stamps),
        "colour": "registered",
        "labels": True,
        "map_frame": "z up, floor at z = 0",
    }
    _write_json(folder / "recording.json", about)
    if scene is not None:
        _write_json(folder / TRUTH_FILE, scene_to_json(scene, meshes=False))
        write_meshes(scene, folder / MESH_FOLDER)
    logger.info("%s: %d frames written to %s", source.name, len(stamps), folder)
    return len(stamps)


def _write_calibration(folder: Path, frame: SensorFrame) -> None:
    camera = frame.camera
    matrix = np.array([[camera.fx, 0.0, camera.cx], [0.0, camera.fy, camera.cy], [0.0, 0.0, 1.0]])
    np.savetxt(folder / "camera-intrinsics.txt", matrix, fmt="%.8f")
    np.savetxt(folder / "gravity-direction.txt", np.array([[0.0, 0.0, -1.0]]), fmt="%.8f")


def _write_frame(stem: Path, frame: SensorFrame, colour: str) -> None:
    millimetres = np.rint(np.nan_to_num(frame.depth_m) * DEPTH_UNITS_PER_M)
    _write_image(stem.with_suffix(".depth.png"), np.clip(millimetres, 0, _MOST).astype(np.uint16))
    np.savetxt(stem.with_suffix(".pose.txt"), frame.T_map_sensor.matrix, fmt="%.9f")
    if frame.colour is not None:
        _write_image(stem.with_suffix(f".color.{colour}"), frame.colour[..., ::-1])
    if frame.labels is not None:
        _write_image(stem.with_suffix(".labels.png"), frame.labels.astype(np.uint16))


def _write_image(path: Path, image: NDArray[Any]) -> None:
    import cv2

    # Level 1 is half the time of the default for a few percent more bytes.
    options = [cv2.IMWRITE_PNG_COMPRESSION, 1] if path.suffix == ".png" else []
    if not cv2.imwrite(str(path), image, options):
        raise InvalidInput(f"cannot write {path}; is the disk full or the folder read-only?")


def _write_json(path: Path, document: dict[str, Any]) -> None:
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
