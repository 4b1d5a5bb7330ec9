"""Simulated frames: how many a second one core makes, and how long a recorded drive takes."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from bench.measuring import Report, compare
from fluentboard_modules.frames.simulated_sources import drive_of
from fluentboard_modules.simulation.noise import NoiseConfig
from fluentboard_modules.simulation.raycasting import SceneCaster
from fluentboard_modules.simulation.search_scenes import hidden_pepper_mill
from fluentboard_modules.simulation.simulate import simulate

_FRAMES = 20
_RECORDED = 200


def run() -> list[Report]:
    """Single frames, and a recording."""
    drive = drive_of("restaurant", {"seed": "1"})
    exact = replace(drive, noise=NoiseConfig.none())
    poses = drive.poses[:_FRAMES]
    caster = SceneCaster(drive.scene)
    directions = drive.camera.rays().astype(np.float32)
    robot = hidden_pepper_mill(0).robot()

    def frames_of(source: Callable[[], object]) -> Callable[[], float]:
        source()  # builds and compiles

        def measured() -> float:
            begin = time.process_time()  # one thread, on a machine with others at work
            source()
            return time.process_time() - begin

        return measured

    def cast() -> None:
        for pose in poses:
            caster.cast_camera(directions, pose)

    def sense() -> None:
        for _ in poses:
            robot.sense()

    def record() -> None:
        with tempfile.TemporaryDirectory() as folder:
            simulate(drive_of("restaurant", {"frames": str(_RECORDED)}), Path(folder) / "drive")

    return [
        compare(
            "A simulated frame of 640x480 pixels",
            {
                "fluentboard: depth, colour, labels": frames_of(
                    lambda: list(replace(exact, poses=poses))
                ),
                "the same with the noise of a Kinect": frames_of(
                    lambda: list(replace(drive, poses=poses))
                ),
                "`sense()` of a PR2 (640x421, with noise)": frames_of(sense),
                "Open3D's rays alone": frames_of(cast),
            },
            rounds=7,
            operations=_FRAMES,
            target="15 frames a second of one core without noise, 67 ms",
            notes=["Seconds of CPU on one core; the ratios compare with an exact frame."],
        ),
        compare(
            f"A recorded drive of {_RECORDED} frames with labels and truth",
            {"fluentboard simulate": record},
            rounds=1,
            unit="s",
            target="under 2 minutes on 2 cores",
            notes=["Wall clock, the planning of the drive included."],
        ),
    ]
