"""Small frames to write and read back."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pytest

from fluentboard.model.geometry import Pose, Transform
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame

CAMERA = Camera(16, 12, 20.0, 21.0, 7.5, 5.5)
# The camera looks along x of the world and is held level: its x is -y there, its y is -z.
LEVEL = Transform(np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1.2], [0, 0, 0, 1.0]]))


@dataclass(frozen=True)
class MadeFrames:
    """Five frames a tenth of a second apart, of depths that are whole millimetres, with a hole."""

    name: str = "made"
    frames: list[SensorFrame] = field(default_factory=list[SensorFrame])

    def __post_init__(self) -> None:
        rng = np.random.default_rng(7)
        for index in range(5):
            millimetres = rng.integers(500, 4000, (CAMERA.height, CAMERA.width))
            millimetres[2, 3] = 0
            pose = Pose.from_rpy(0.1 * index, 0.25, 0.0, yaw=0.05 * index)
            self.frames.append(
                SensorFrame(
                    (millimetres / 1000.0).astype(np.float32),
                    CAMERA,
                    1.0 + 0.1 * index,
                    pose.to_transform() @ LEVEL,
                    colour=rng.integers(0, 255, (*millimetres.shape, 3)).astype(np.uint8),
                    index=index,
                )
            )

    def __len__(self) -> int:
        return len(self.frames)

    def __iter__(self) -> Iterator[SensorFrame]:
        return iter(self.frames)

    def agrees_with(self, read: list[SensorFrame], *, colour: bool = True) -> bool:
        """Frames read back say the same to the last millimetre, pixel and microsecond."""
        assert len(read) == len(self.frames)
        for found, made in zip(read, self.frames, strict=True):
            assert found.camera == made.camera
            assert np.array_equal(np.rint(found.depth_m * 1000), np.rint(made.depth_m * 1000))
            assert np.allclose(found.T_map_sensor.matrix, made.T_map_sensor.matrix, atol=1e-7)
            assert abs(found.stamp_s - made.stamp_s) < 2e-6
            assert found.index == made.index
            if colour:
                assert np.array_equal(np.asarray(found.colour), np.asarray(made.colour))
        return True


@pytest.fixture
def made() -> MadeFrames:
    """A source of small frames."""
    return MadeFrames()
