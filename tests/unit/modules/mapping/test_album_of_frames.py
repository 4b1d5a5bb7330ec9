"""The few frames that are kept for pictures."""

from __future__ import annotations

import numpy as np

from fluentboard.model.geometry import Transform
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.mapping.album import Album


def a_frame(index: int) -> SensorFrame:
    position = Transform.from_parts(np.eye(3), np.array([float(index), 0.0, 0.0]))
    depth = np.zeros((2, 2), dtype=np.float32)
    return SensorFrame(depth, Camera(2, 2, 1.0, 1.0, 0.5, 0.5), 1.0, position, index=index)


def test_album_keeps_the_whole_path_but_few_frames() -> None:
    album = Album()
    for index in range(500):
        album.add(a_frame(index))
    assert album.path_map[:, 0].tolist() == list(range(500))
    kept = [frame.index for frame in album.frames]
    assert len(kept) <= 33
    assert kept[0] == 0
    assert np.ptp(np.diff(kept)) <= kept[1]  # spread evenly


def test_empty_album_has_no_best_frame() -> None:
    assert Album().best([]) is None
    assert Album().path_map.shape == (0, 3)
