"""Real recordings of objects with classes, boxes and places: desks and rooms, as scene objects."""

from __future__ import annotations

import csv
import json
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.anchoring.crf_data import GraphCollector, LabelledGraphs
from fluentboard_modules.anchoring.observation import SceneObject, SupportPlane
from fluentboard_modules.anchoring.scene_graph import SceneGraphConfig, build_scene_graph


@dataclass(frozen=True, slots=True)
class LabelledScene:
    """Objects of one recording and what they are.

    Attributes:
        name: of the recording.
        place: what is left out together in cross-validation: a desk, a block of images.
        objects: what stands there.
        labels: true class of each object.
    """

    name: str
    place: str
    objects: tuple[SceneObject, ...]
    labels: tuple[str, ...]


def read_kth_desks(path: Path) -> list[LabelledScene]:
    """The office desks of KTH, in time order for every desk.

    The corner of an object, not its centre, is at `xyz`: read so, 5 % of the objects jut out over
    the edge of their desk, read otherwise 34 %.

    Args:
        path: of `scenes.json`, or of its folder.

    Raises:
        InvalidInput: the file is missing or is no such list of scenes.
    """
    file = path / "scenes.json" if path.is_dir() else path
    try:
        scenes = json.loads(file.read_text(encoding="utf-8"))
        read = [_desk(scene) for scene in scenes]
    except (OSError, KeyError, TypeError, ValueError) as problem:
        raise InvalidInput(
            f"{file} holds no desk scenes ({problem!r}); expected a list of scenes with desk, "
            "date, time, table_lw and objects"
        ) from problem
    part_of_day = {"morning": "0", "afternoon": "1", "evening": "2"}
    return sorted(read, key=lambda s: [part_of_day.get(word, word) for word in s.name.split(" ")])


def _desk(scene: dict) -> LabelledScene:
    length, width = (float(v) for v in scene["table_lw"])
    outline = np.array([[0.0, 0.0], [length, 0.0], [length, width], [0.0, width]])
    desk = SupportPlane(0.0, outline, outline.mean(axis=0), str(scene["desk"]))
    objects = []
    for item in scene["objects"]:
        x_size, y_size, z_size = (float(v) for v in item["lwh"])
        x, y, z = (float(v) for v in item["xyz"])
        yaw = float(item["rpy"][2])
        c, s = math.cos(yaw), math.sin(yaw)
        pose = Pose.from_rpy(
            x + 0.5 * (c * x_size - s * y_size),
            y + 0.5 * (s * x_size + c * y_size),
            z + 0.5 * z_size,
            yaw=yaw,
        )
        box = BoundingBox(pose, x_size, y_size, z_size)
        objects.append(SceneObject(str(item["name"]), box, np.zeros(0), desk))
    return LabelledScene(
        f"{scene['desk']} {scene['date']} {scene['time']}",
        str(scene["desk"]),
        tuple(objects),
        tuple(o.name.rstrip("0123456789") for o in objects),
    )


def read_sunrgbd_boxes(path: Path, blocks: int = 5) -> list[LabelledScene]:
    """Furniture boxes of real rooms; the images are dealt to blocks of neighbouring numbers.

    Args:
        path: of `boxes.csv`, or of its folder.
        blocks: how many there are to be: neighbouring images often show the same room, so they
            must be left out together.

    Raises:
        InvalidInput: the file is missing or is no such table.
    """
    file = path / "boxes.csv" if path.is_dir() else path
    per_image: dict[int, list[tuple[str, BoundingBox]]] = {}
    try:
        with file.open(encoding="utf-8", newline="") as lines:
            for row in csv.DictReader(lines):
                corners = np.array(
                    [[float(row[f"x{k}"]), float(row[f"y{k}"])] for k in (1, 2, 3, 4)]
                )
                box = _ground_box(corners, float(row["z_min"]), float(row["z_max"]))
                per_image.setdefault(int(row["image_id"]), []).append((row["class"], box))
    except (OSError, KeyError, TypeError, ValueError) as problem:
        raise InvalidInput(
            f"{file} holds no furniture boxes ({problem!r}); expected a CSV with image_id, class, "
            "x1, y1 to x4, y4, z_min, z_max"
        ) from problem
    images = sorted(per_image)
    scenes = []
    for number, image in enumerate(images):
        boxes = per_image[image]
        scenes.append(
            LabelledScene(
                str(image),
                f"block {number * blocks // len(images)}",
                tuple(
                    SceneObject(f"{image}-{k}", box, np.zeros(0))
                    for k, (_, box) in enumerate(boxes)
                ),
                tuple(cls for cls, _ in boxes),
            )
        )
    return scenes


def _ground_box(corners: np.ndarray, z_min: float, z_max: float) -> BoundingBox:
    centre = corners.mean(axis=0)
    along = 0.5 * (corners[1] - corners[0] + corners[2] - corners[3])
    across = 0.5 * (corners[3] - corners[0] + corners[2] - corners[1])
    pose = Pose.from_rpy(
        float(centre[0]),
        float(centre[1]),
        0.5 * (z_min + z_max),
        yaw=math.atan2(float(along[1]), float(along[0])),
    )
    return BoundingBox(
        pose, float(np.hypot(*along)), float(np.hypot(*across)), max(z_max - z_min, 0.0)
    )


def frequent_classes(scenes: Sequence[LabelledScene], at_least: int) -> tuple[str, ...]:
    """Classes that occur so often, sorted by name."""
    counts = Counter(label for scene in scenes for label in scene.labels)
    return tuple(sorted(label for label, count in counts.items() if count >= at_least))


def labelled_graphs(
    scenes: Sequence[LabelledScene],
    classes: Sequence[str],
    config: SceneGraphConfig | None = None,
) -> LabelledGraphs:
    """Scene graphs of labelled scenes; objects of other classes are left out.

    Args:
        scenes: a fold is made of every place, numbered in the order of their names.
        classes: what can be recognised.
        config: context range and features.
    """
    config = config if config is not None else SceneGraphConfig()
    places = sorted({scene.place for scene in scenes})
    collector = GraphCollector(tuple(classes), config.node_features, config.edge_features)
    number = {name: k for k, name in enumerate(classes)}
    for scene in scenes:
        known = [k for k, label in enumerate(scene.labels) if label in number]
        if not known:
            continue
        graph = build_scene_graph([scene.objects[k] for k in known], config)
        labels = [number[scene.labels[known[i]]] for i in graph.members]
        fold = places.index(scene.place)
        collector.add(graph.x, labels, None, graph.edges, graph.e, fold)
    return collector.graphs()
