"""Segmentation against clouds with a label per point: counts and overlaps of objects."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fluentboard.errors import InvalidInput
from fluentboard_modules.anchoring.config import AnchoringConfig
from fluentboard_modules.anchoring.evaluation_run import ResultTable
from fluentboard_modules.anchoring.organised import organise
from fluentboard_modules.anchoring.segmentation import segment
from fluentboard_modules.anchoring.supports import find_tops
from fluentboard_modules.frames.clouds import open_cloud
from fluentboard_modules.frames.gravity import align_with_gravity
from fluentboard_modules.frames.sensor_frame import SensorFrame

_FIRST_OBJECT = 20
"""Labels from here on are objects, ten for each; 1 to 9 are the table."""

_POINTS_MIN = 50


@dataclass(frozen=True, slots=True)
class SegmentationScore:
    """How well one cloud was segmented.

    Attributes:
        objects: how many there are.
        clusters: how many were found.
        overlaps: intersection over union of each object with its best cluster.
    """

    objects: int
    clusters: int
    overlaps: tuple[float, ...]


def segmentation_score(
    frame: SensorFrame, config: AnchoringConfig | None = None
) -> SegmentationScore:
    """Segments a frame with labels of objects.

    Args:
        frame: upright, with a label image as in the data set.
        config: of anchoring.

    Raises:
        InvalidInput: the frame has no labels.
    """
    if frame.labels is None:
        raise InvalidInput(f"{frame.sensor}: no labels; give clouds with a field `label`")
    config = config if config is not None else AnchoringConfig()
    points = organise(frame, config.segmentation.noise, config.supports.range_max_m)
    tops = find_tops(points, config.supports, np.random.default_rng(0))
    found = segment(frame, points, tops, config.segmentation)
    truth = np.where(frame.labels >= _FIRST_OBJECT, frame.labels // 10, 0)
    overlaps = []
    for number in np.unique(truth[truth > 0]):
        own = (truth == number) & frame.valid
        if own.sum() < _POINTS_MIN:
            continue
        shared = np.bincount(found.labels[own], minlength=len(found.clusters) + 1)[1:]
        sizes = np.bincount(found.labels.ravel(), minlength=len(found.clusters) + 1)[1:]
        union = own.sum() + sizes - shared
        overlaps.append(float((shared / union).max()) if len(union) else 0.0)
    return SegmentationScore(len(overlaps), len(found.clusters), tuple(overlaps))


def cloud_results(folder: Path) -> ResultTable:
    """Counts and overlaps of all clouds in a folder.

    Raises:
        InvalidInput: there are none.
    """
    files = sorted(folder.glob("*.pcd"))
    if not files:
        raise InvalidInput(f"{folder} holds no .pcd files; give a folder of labelled clouds")
    table = ResultTable(
        "Segmentation of labelled clouds", ("cloud", "objects", "clusters", "mean IoU", "least IoU")
    )
    for path in files:
        recording = open_cloud(path)
        if recording.gravity_world is not None:
            recording = recording.in_map(align_with_gravity(recording.gravity_world))
        score = segmentation_score(next(iter(recording)))
        overlaps = score.overlaps or (0.0,)
        table.rows.append(
            (
                path.stem,
                str(score.objects),
                str(score.clusters),
                f"{np.mean(overlaps):.3f}",
                f"{min(overlaps):.3f}",
            )
        )
    return table
