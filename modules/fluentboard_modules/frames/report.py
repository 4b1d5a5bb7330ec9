"""What is in a source: size, camera, time, depth, way of the camera, and what is wrong with it."""

from __future__ import annotations

import itertools
import logging
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.frames.gravity import align_with_gravity
from fluentboard_modules.frames.recordings import LiveSource, Recording
from fluentboard_modules.frames.sensor_frame import FrameSource, SensorFrame
from fluentboard_modules.frames.upright import guess_gravity, is_z_up, mean_camera_up

_LOOKED_AT = 30
_LIVE_LOOKED_AT, _LIVE_PATIENCE_S = 3, 10.0
_LEAST_VALID = 0.3
_PLAUSIBLE_DEPTH_M = (0.15, 30.0)
_LONGEST_JUMP_M, _FASTEST_M_PER_S = 0.5, 3.0
_GRAVITY_TOLERANCE_RAD = np.deg2rad(15.0)
_GUESS_FRAMES = 5


@dataclass(frozen=True, eq=False)
class SourceReport:
    """What a look at a source shows.

    Attributes:
        name: of the source.
        count: its frames; None for a live source.
        frames: those looked at, placed upright (z up) as well as the source or a guess allows.
        gravity_world: `(3,)`; as the source says, None for z up.
        problems: what a user should know, one sentence each.
    """

    name: str
    count: int | None
    frames: Sequence[SensorFrame]
    gravity_world: FloatArray | None
    problems: Sequence[str]


def examine(source: FrameSource, at_most: int = _LOOKED_AT) -> SourceReport:
    """Looks at frames spread over a source.

    Args:
        source: any.
        at_most: how many frames to read.
    """
    with _warnings() as said:
        count, sample, gravity = _sample(source, at_most)
        frames = list(sample)
    problems = [*dict.fromkeys(said), *_problems(frames, gravity)]
    return SourceReport(source.name, count, frames, gravity, problems)


def describe(report: SourceReport) -> str:
    """The report as lines of text."""
    frames = report.frames
    lines = [report.name]
    _put(lines, "frames", "live" if report.count is None else f"{report.count:,}")
    if frames:
        _put(lines, "sensor", ", ".join(dict.fromkeys(frame.sensor for frame in frames)))
        _put(lines, "depth", _camera_text(frames[0]))
        _put(lines, "colour", _colour_text(frames))
        if any(frame.labels is not None for frame in frames):
            labels = {int(n) for f in frames if f.labels is not None for n in np.unique(f.labels)}
            _put(lines, "labels", f"{len(labels - {0})} instances in the frames looked at")
        if frames[0].cloud_sensor is not None:
            _put(lines, "cloud", f"{len(frames[0].cloud_sensor):,} points, not organised")
        _put(lines, "time", _time_text(report))
        _put(lines, "valid depth", _valid_text(frames))
        _put(lines, "camera path", _path_text(frames))
        _put(lines, "up", _up_text(report))
    for problem in report.problems or ["none found"]:
        _put(
            lines, "problems" if problem is (report.problems or ["none found"])[0] else "", problem
        )
    return "\n".join(lines)


def _sample(
    source: FrameSource, at_most: int
) -> tuple[int | None, Iterator[SensorFrame], FloatArray | None]:
    try:
        count = len(source)
    except TypeError:  # a live source has no length
        return None, _awaited(source, min(at_most, _LIVE_LOOKED_AT)), None
    step = max(1, -(-count // at_most))
    if isinstance(source, Recording):
        gravity = source.gravity_world
        upright = source.in_map(align_with_gravity(gravity))
        return count, iter(upright.every(step)), gravity
    read = getattr(source, "read", None)
    if read is not None:
        return count, (read(position) for position in range(0, count, step)), None
    return count, itertools.islice(source, 0, None, step), None


def _awaited(source: FrameSource, count: int) -> Iterator[SensorFrame]:
    """The next frames of a live source, fewer if it is silent for long."""
    if not isinstance(source, LiveSource):
        yield from itertools.islice(source, count)
        return
    patience = threading.Timer(_LIVE_PATIENCE_S, source.stop)
    patience.daemon = True
    patience.start()
    try:
        yield from itertools.islice(source, count)
    finally:
        patience.cancel()


@contextmanager
def _warnings() -> Iterator[list[str]]:
    """Collects what the readers warn of while the block runs."""
    said: list[str] = []

    class Listener(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            said.append(record.getMessage())

    listener = Listener(logging.WARNING)
    logger = logging.getLogger("fluentboard_modules")
    logger.addHandler(listener)
    propagated, logger.propagate = logger.propagate, False
    try:
        yield said
    finally:
        logger.removeHandler(listener)
        logger.propagate = propagated


def _problems(frames: Sequence[SensorFrame], gravity: FloatArray | None) -> Iterator[str]:
    if not frames:
        yield "not one frame could be read"
        return
    valid = float(np.mean([frame.valid.mean() for frame in frames]))
    if valid < _LEAST_VALID:
        yield f"only {100 * valid:.0f} % of the pixels have depth"
    depths = np.concatenate([frame.depth_m[frame.valid] for frame in frames])
    if depths.size:
        middle = float(np.median(depths))
        low, high = _PLAUSIBLE_DEPTH_M
        if not low <= middle <= high:
            yield f"the median depth is {middle:.3g} m; is the unit of depth right?"
    poses = [frame.T_map_sensor for frame in frames]
    if len(frames) > 1 and all(pose == poses[0] for pose in poses):
        yield "all frames have the same pose"
    for before, after in itertools.pairwise(frames):
        if after.stamp_s <= before.stamp_s:
            yield f"the stamps do not ascend after frame {before.index}"
            break
    jumps = [
        after.index
        for before, after in itertools.pairwise(frames)
        if after.index - before.index == 1 and _jumps(before, after)
    ]
    if jumps:
        yield f"the camera jumps before frame {jumps[0]}, faster than 3 m/s"
    with_colour = sum(frame.colour is not None for frame in frames)
    if 0 < with_colour < len(frames):
        yield f"{len(frames) - with_colour} of {len(frames)} frames have no colour"
    if not is_z_up(poses):
        yield "the camera would be held sideways if z were up; give --gravity"
    elif depths.size:
        # The planes in view should lie level in a frame that is upright.
        guess = guess_gravity(
            frames[:: max(1, len(frames) // _GUESS_FRAMES)], np.random.default_rng(0)
        )
        angle = float(np.arccos(np.clip(-guess[2], -1.0, 1.0)))
        if angle > _GRAVITY_TOLERANCE_RAD:
            source = "z" if gravity is None else "gravity"
            yield (
                f"the largest planes in view are {np.rad2deg(angle):.0f} degrees off level; is "
                f"{source} right, or is it a wall?"
            )


def _put(lines: list[str], name: str, text: str) -> None:
    lines.append(f"  {name:<12} {text}")


def _camera_text(frame: SensorFrame) -> str:
    camera = frame.camera
    return (
        f"{camera.width} x {camera.height} px, f = {camera.fx:.1f}, {camera.fy:.1f} px, "
        f"c = {camera.cx:.1f}, {camera.cy:.1f} px"
    )


def _colour_text(frames: Sequence[SensorFrame]) -> str:
    frame = next((frame for frame in frames if frame.colour is not None), None)
    if frame is None or frame.colour is None:
        return "none"
    height, width = frame.colour.shape[:2]
    if frame.colour_camera is None:
        return f"{width} x {height} px, registered to depth"
    if frame.T_colour_depth is None:
        return f"{width} x {height} px, another camera at the same place"
    distance = float(np.linalg.norm(frame.T_colour_depth.translation))
    return f"{width} x {height} px, another camera {1000 * distance:.0f} mm from the depth camera"


def _time_text(report: SourceReport) -> str:
    first, last = report.frames[0], report.frames[-1]
    text = f"from {first.stamp_s:.3f} s"
    if len(report.frames) < 2 or report.count is None or last.stamp_s <= first.stamp_s:
        return text
    # The frames looked at are evenly spread, so the time between them tells the whole duration.
    step_s = (last.stamp_s - first.stamp_s) / (len(report.frames) - 1)
    step = max(1, -(-report.count // _LOOKED_AT))
    rate_hz = step / step_s
    return f"{text}, {report.count / rate_hz:.1f} s long, {rate_hz:.1f} frames/s"


def _valid_text(frames: Sequence[SensorFrame]) -> str:
    valid = float(np.mean([frame.valid.mean() for frame in frames]))
    depths = np.concatenate([frame.depth_m[frame.valid] for frame in frames])
    if not depths.size:
        return "none"
    low, middle, high = np.percentile(depths, [0.1, 50.0, 99.9])
    return f"{100 * valid:.0f} % of the pixels, {low:.2f} to {high:.2f} m, median {middle:.2f} m"


def _path_text(frames: Sequence[SensorFrame]) -> str:
    places = np.array([frame.T_map_sensor.translation for frame in frames])
    extent = np.ptp(places, axis=0)
    length = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
    return f"{length:.1f} m long, within {extent[0]:.2f} x {extent[1]:.2f} x {extent[2]:.2f} m"


def _up_text(report: SourceReport) -> str:
    tilt = mean_camera_up(frame.T_map_sensor for frame in report.frames)
    pitch = float(np.rad2deg(np.arccos(np.clip(tilt[2], -1.0, 1.0))))
    if report.gravity_world is None:
        text = "z of the world frame"
    else:
        x, y, z = -report.gravity_world
        text = f"({x:.3f}, {y:.3f}, {z:.3f}) in the world frame"
    return f"{text}; the camera is {pitch:.0f} degrees off it on average"


def _jumps(before: SensorFrame, after: SensorFrame) -> bool:
    way = after.T_map_sensor.translation - before.T_map_sensor.translation
    distance_m = float(np.linalg.norm(way))
    fastest_m = _FASTEST_M_PER_S * (after.stamp_s - before.stamp_s)
    return distance_m > max(_LONGEST_JUMP_M, fastest_m)
