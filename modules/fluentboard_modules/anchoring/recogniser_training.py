"""Examples for a recogniser: CAD models as a depth camera sees them, or stored clusters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.anchoring.config import AnchoringConfig
from fluentboard_modules.anchoring.observation import Cluster
from fluentboard_modules.anchoring.organised import organise
from fluentboard_modules.anchoring.segmentation import segment
from fluentboard_modules.anchoring.supports import find_tops
from fluentboard_modules.frames.clouds import READERS
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.simulation import belongings, furniture, tableware
from fluentboard_modules.simulation.cad import CAD_SUFFIXES, load_mesh, standing
from fluentboard_modules.simulation.noise import NoiseConfig
from fluentboard_modules.simulation.scene import Instance, Model, Scene
from fluentboard_modules.simulation.sensor import RgbdSensor
from fluentboard_modules.simulation.table_service import TABLEWARE_CLASSES, random_service
from fluentboard_modules.simulation.viewpoint import kinect_camera, look_at

_TABLE = (1.7, 1.0, 0.74)
_PLACES = [(x, y) for x in (-0.25, 0.25) for y in (-0.57, 0.0, 0.57)]


@dataclass(frozen=True, slots=True)
class ViewingConfig:
    """From where the models are looked at.

    Attributes:
        views: frames of every model, each with the models in other places and turned otherwise.
        width_px: of the images.
        distance_m: nearest and farthest horizontal distance of the camera from the table's middle.
        height_m: lowest and highest camera above the floor.
    """

    views: int = 24
    width_px: int = 640
    distance_m: tuple[float, float] = (0.8, 1.5)
    height_m: tuple[float, float] = (1.25, 1.65)


def models_in_folder(folder: Path) -> dict[str, list[Model]]:
    """CAD models by class: `CLASS/anything.stl`, or `CLASS.stl` and `CLASS_2.stl`.

    Raises:
        InvalidInput: there are none.
        InvalidGeometry: a file cannot be read.
    """
    found: dict[str, list[Model]] = {}
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() not in CAD_SUFFIXES:
            continue
        inner = path.parent != folder
        cls = path.parent.name if inner else path.stem.rstrip("0123456789").rstrip("_-")
        model = Model(path.stem, cls, standing(load_mesh(path)))
        found.setdefault(cls, []).append(model)
    if not found:
        raise InvalidInput(
            f"{folder} holds no CAD files; put them into a folder per class, such as Mug/blue.stl "
            f"({', '.join(CAD_SUFFIXES)})"
        )
    return found


def tableware_models(seed: int = 77, services: int = 4) -> dict[str, list[Model]]:
    """Simulated tableware of so many services, by class: what the built-in recogniser knows."""
    made = [random_service(np.random.default_rng([seed, k])) for k in range(services)]
    return {cls: [service.model(cls) for service in made] for cls in sorted(TABLEWARE_CLASSES)}


def household_models(seed: int = 77, services: int = 4) -> dict[str, list[Model]]:
    """Tableware and what else stands about in a house, by class."""
    rng = np.random.default_rng([seed, services])

    def between(low: float, high: float) -> float:
        return round(float(rng.uniform(low, high)), 3)

    more = {
        "PepperMill": [tableware.pepper_mill(between(0.18, 0.26)) for _ in range(services)],
        "Bottle": [belongings.bottle(between(0.24, 0.31)) for _ in range(services)],
        "Box": [
            belongings.carton(between(0.08, 0.16), between(0.10, 0.24), between(0.12, 0.28))
            for _ in range(2 * services)
        ],
        "Book": [
            *belongings.book_catalogue(rng, services),
            *(_lying(book) for book in belongings.book_catalogue(rng, services)),
        ],
        "Bowl": [tableware.bowl(between(0.13, 0.2), between(0.05, 0.08)) for _ in range(services)],
        "Laptop": [belongings.laptop(between(0.28, 0.38)) for _ in range(services)],
        "Candle": [belongings.candle(between(0.07, 0.13)) for _ in range(services)],
    }
    return tableware_models(seed, services) | more


def _lying(book: Model) -> Model:
    depth, thickness, height = book.mesh.size.tolist()
    return belongings.book(thickness, height, depth, book.colour)


def stored_clusters(folder: Path) -> tuple[list[Cluster], list[str]]:
    """Labelled clusters: point clouds in the sensor's frame, in a folder per class.

    Raises:
        InvalidInput: there are none.
        InvalidFrame: a cloud cannot be read.
    """
    clusters: list[Cluster] = []
    labels: list[str] = []
    for path in sorted(folder.rglob("*")):
        reader = READERS.get(path.suffix.lower())
        if reader is None or path.parent == folder:
            continue
        points = reader(path).points
        points = points[np.isfinite(points).all(axis=1)]
        if not len(points):
            continue
        low, high = points.min(axis=0), points.max(axis=0)
        centre = 0.5 * (low + high)
        box = BoundingBox(Pose(*(float(v) for v in centre)), *(float(v) for v in high - low))
        clusters.append(
            Cluster(points, np.zeros((len(points), 2), np.int64), box, 1.0, np.zeros(3))
        )
        labels.append(path.parent.name)
    if not clusters:
        raise InvalidInput(
            f"{folder} holds no labelled clusters; put .pcd or .ply files of single objects into a "
            "folder per class, such as Mug/1.pcd"
        )
    return clusters, labels


def frame_count(models: Mapping[str, Sequence[Model]], config: ViewingConfig) -> int:
    """How many frames `seen_models` will look at."""
    return -(-len(models) * config.views // len(_PLACES))


def seen_models(
    models: Mapping[str, Sequence[Model]],
    config: ViewingConfig | None = None,
    seed: int = 0,
    advance: Callable[[str], None] | None = None,
) -> tuple[list[Cluster], list[str]]:
    """Clusters of CAD models as anchoring would segment them, with their classes.

    The models stand on a table, a simulated Kinect looks at it from all sides, and what the
    segmentation finds is labelled with the class of the model it belongs to.

    Args:
        models: by class name.
        config: how many views, from where.
        seed: of places, views and sensor noise.
        advance: called with a word after every frame.
    """
    config = config if config is not None else ViewingConfig()
    rng = np.random.default_rng(seed)
    settings = AnchoringConfig()
    sensor = RgbdSensor(kinect_camera(config.width_px), NoiseConfig(), name="training")
    table = Instance("table", furniture.table(*_TABLE), Pose.from_rpy(0.0, 0.0, 0.0))
    clusters: list[Cluster] = []
    labels: list[str] = []
    turns = [
        (cls, listed[k % len(listed)])
        for cls, listed in models.items()
        for k in range(config.views)
    ]
    order = rng.permutation(len(turns))
    for start in range(0, len(turns), len(_PLACES)):
        chosen = [turns[k] for k in order[start : start + len(_PLACES)]]
        things = [
            Instance(
                f"thing{k}",
                model,
                Pose.from_rpy(
                    x + float(rng.uniform(-0.08, 0.08)),
                    y + float(rng.uniform(-0.06, 0.06)),
                    _TABLE[2],
                    yaw=float(rng.uniform(-np.pi, np.pi)),
                ),
            )
            for k, ((_, model), (x, y)) in enumerate(zip(chosen, _PLACES, strict=False))
        ]
        scene = Scene((table, *things))
        angle = float(rng.uniform(-np.pi, np.pi))
        away = float(rng.uniform(*config.distance_m))
        eye = (away * np.cos(angle), away * np.sin(angle), float(rng.uniform(*config.height_m)))
        T_map_sensor = look_at(eye, (0.0, 0.0, _TABLE[2]))
        frame = sensor.look(scene, T_map_sensor, 1.0 + start, rng, start)
        classes = {i.label: cls for i, (cls, _) in zip(scene.instances[1:], chosen, strict=True)}
        for cluster, cls in labelled_clusters(frame, classes, settings, rng):
            clusters.append(cluster)
            labels.append(cls)
        if advance is not None:
            advance(f"{len(clusters)} examples")
    return clusters, labels


def labelled_clusters(
    frame: SensorFrame,
    classes: Mapping[int, str],
    config: AnchoringConfig,
    rng: np.random.Generator,
    purity: float = 0.8,
) -> list[tuple[Cluster, str]]:
    """The clusters of a frame with a label image, and the class most of their points have.

    Args:
        frame: with labels.
        classes: class by label; other labels are nothing to learn from.
        config: of the segmentation.
        rng: of the search for tops.
        purity: least share of a cluster's points that must have its label.
    """
    if frame.labels is None:
        raise InvalidInput(f"frame {frame.index} has no labels to learn from")
    points = organise(frame, config.segmentation.noise, config.supports.range_max_m)
    tops = find_tops(points, config.supports, rng)
    found: list[tuple[Cluster, str]] = []
    for cluster in segment(frame, points, tops, config.segmentation).clusters:
        values, counts = np.unique(frame.labels[tuple(cluster.pixels.T)], return_counts=True)
        best = int(np.argmax(counts))
        cls = classes.get(int(values[best]))
        if cls is not None and counts[best] >= purity * counts.sum():
            found.append((cluster, cls))
    return found
