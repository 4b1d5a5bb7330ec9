"""Anchors in a real kitchen against what a person sees in its images.

The objects on the dining table of the 7-Scenes kitchen were outlined by hand in colour images. The
depth readings within an outline give the place that the images show, without any of our
segmentation, filter or association; the last place of the object's anchor is compared with it.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from bench.measuring import Report
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.anchors import Anchor
from fluentboard_modules.anchoring.geometric import GeometricRecogniser
from fluentboard_modules.anchoring.pipeline import AnchoringPipeline
from fluentboard_modules.anchoring.similarity import load_mismatch
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.frames.sources import open_source
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.map_frame import place

Outline = Sequence[tuple[int, int]]
"""Corners in pixels of the colour image."""


def _rectangle(left: int, top: int, right: int, bottom: int) -> Outline:
    return [(left, top), (right, top), (right, bottom), (left, bottom)]


@dataclass(frozen=True, slots=True)
class Seen:
    """An object as a person outlined it.

    Attributes:
        outlines: by number of the frame.
        is_flat: whether readings near the top belong to it.
    """

    outlines: Mapping[int, Outline]
    is_flat: bool = False


SEEN = {
    "white mug": Seen(
        {
            100: _rectangle(126, 251, 160, 296),
            125: _rectangle(455, 306, 507, 372),
            199: _rectangle(143, 221, 171, 263),
        }
    ),
    "flowered mug": Seen(
        {
            70: _rectangle(308, 232, 346, 279),
            80: _rectangle(85, 156, 121, 203),
            100: _rectangle(470, 400, 512, 452),
            170: _rectangle(450, 309, 482, 357),
        }
    ),
    "plastic box": Seen(
        {
            76: [(250, 200), (330, 152), (405, 178), (330, 256), (260, 235)],
            80: [(145, 205), (240, 157), (318, 185), (225, 268), (165, 252)],
            170: [(472, 262), (500, 247), (560, 258), (603, 318), (545, 335), (485, 285)],
        }
    ),
    "game controller": Seen(
        {76: _rectangle(380, 237, 482, 308), 80: _rectangle(270, 252, 365, 328)}
    ),
    "magazine and papers": Seen(
        {
            100: [(73, 368), (120, 302), (178, 278), (270, 305), (235, 340), (165, 378)],
            199: [
                (147, 318),
                (150, 270),
                (182, 240),
                (280, 233),
                (283, 262),
                (240, 320),
                (185, 328),
            ],
        },
        is_flat=True,
    ),
    "purple magazine": Seen(
        {
            70: [(30, 316), (90, 256), (162, 252), (118, 323)],
            199: [(308, 287), (378, 280), (397, 350), (315, 354)],
        },
        is_flat=True,
    ),
}
"""Everything that stands on the dining table."""

_TABLE_XY = ((-1.1, 1.1), (1.15, 2.0))
"""Where the dining table is in the map: x, then y, in metres."""


def run() -> list[Report]:
    """Anchors all 200 frames and compares; nothing without the recording."""
    folder = Path(os.environ.get("FLUENTBOARD_SHARED_DATA", "")) / "redkitchen"
    if not folder.is_dir():
        print("set FLUENTBOARD_SHARED_DATA to the folder of the recordings; skipped")
        return []
    source, _ = place(open_source(str(folder)), MappingConfig())
    pipeline = AnchoringPipeline(GeometricRecogniser(), load_mismatch())
    frames = {k for seen in SEEN.values() for k in seen.outlines}
    kept: dict[int, SensorFrame] = {}
    last: dict[int, Anchor] = {}
    tracked: dict[int, int] = {}
    for k, frame in enumerate(source):
        pipeline.update(frame)
        for anchor in pipeline.world.anchors:
            last[anchor.identifier] = anchor
            tracked[anchor.identifier] = tracked.get(anchor.identifier, 0) + anchor.is_tracked
        if k in frames:
            kept[k] = frame
    return [_report(kept, last, tracked, len(pipeline.world.anchors))]


def _report(
    frames: Mapping[int, SensorFrame],
    last: Mapping[int, Anchor],
    tracked: Mapping[int, int],
    left: int,
) -> Report:
    table = [
        "| object | anchors | frames tracked | off the outlines, cm |",
        "| --- | --- | --- | --- |",
    ]
    worst = 0.0
    explained: set[int] = set()
    medians: dict[str, float] = {}
    for name, seen in SEEN.items():
        places = [_shown(frames[k], outline, seen) for k, outline in seen.outlines.items()]
        middle = np.mean(places, axis=0)
        own = [
            key
            for key, anchor in last.items()
            if np.linalg.norm(anchor.centroid_map[:2] - middle) < _reach_m(anchor)
        ]
        explained |= set(own)
        off = [
            100.0 * min(float(np.linalg.norm(last[key].centroid_map[:2] - p)) for key in own)
            for p in places
            if own
        ]
        worst = max([worst, *off])
        medians[name] = float(np.median(off)) if off else float("nan")
        count = sum(tracked[key] for key in own)
        table.append(f"| {name} | {len(own)} | {count} | {', '.join(f'{v:.1f}' for v in off)} |")
    (low_x, high_x), (low_y, high_y) = _TABLE_XY
    on_table = {
        key
        for key, anchor in last.items()
        if low_x < anchor.centroid_map[0] < high_x and low_y < anchor.centroid_map[1] < high_y
    }
    return Report(
        "Anchors in a real kitchen against outlines drawn by hand",
        "cm",
        medians,
        {},
        "one anchor for every object on the table, within 5 cm of where the images show it",
        [
            f"Over 200 frames {len(last)} anchors were made and {left} are left; "
            f"{len(on_table - explained)} on the table stand for nothing, the others are things on "
            f"the counter. The largest error is {worst:.1f} cm; poses and depth of the recording "
            "agree to 2 to 4 cm only. The black magazine under the purple one has no anchor of its "
            "own: objects on objects are one."
        ],
        table,
    )


def _reach_m(anchor: Anchor) -> float:
    return max(0.08, 0.4 * max(anchor.box.x_size, anchor.box.y_size))


def _shown(frame: SensorFrame, outline: Outline, seen: Seen) -> FloatArray:
    """`(2,)`; middle of the depth readings within an outline, in the map."""
    camera, colour = frame.camera, frame.colour_camera
    assert colour is not None
    assert frame.T_colour_depth is not None
    rows, columns = np.nonzero(frame.depth_m > 0.0)
    depth = frame.depth_m[rows, columns].astype(np.float64)
    rays = np.stack([(columns - camera.cx) / camera.fx, (rows - camera.cy) / camera.fy], axis=-1)
    cloud = np.concatenate([rays * depth[:, None], depth[:, None]], axis=1)
    pixels = np.rint(colour.project(frame.T_colour_depth.apply(cloud))).astype(np.int64)
    seen_there = np.all((pixels >= 0) & (pixels < (colour.width, colour.height)), axis=1)
    cloud, pixels = cloud[seen_there], pixels[seen_there]
    mask = np.zeros((colour.height, colour.width), dtype=np.uint8)
    cv2.fillPoly(mask, [np.array(outline, dtype=np.int32)], 1)
    around = cv2.dilate(mask, np.ones((41, 41), np.uint8)) > mask
    inside = frame.T_map_sensor.apply(cloud[mask[pixels[:, 1], pixels[:, 0]] > 0])
    beside = frame.T_map_sensor.apply(cloud[around[pixels[:, 1], pixels[:, 0]]])
    middle = np.median(inside[:, :2], axis=0)
    beside = beside[np.linalg.norm(beside[:, :2] - middle, axis=1) < 0.3]
    counts, edges = np.histogram(beside[:, 2], bins=np.arange(0.5, 1.0, 0.005))
    top_m = edges[int(np.argmax(counts))]
    rise = inside[:, 2] - top_m
    own = (rise > (-0.01 if seen.is_flat else 0.022)) & (rise < 0.2)
    own &= np.linalg.norm(inside[:, :2] - middle, axis=1) < 0.3
    return np.percentile(inside[own][:, :2], [2.0, 98.0], axis=0).mean(axis=0)
