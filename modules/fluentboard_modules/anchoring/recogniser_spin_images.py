"""Local recognition by spin images and nearest neighbours: cluster to class confidences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.special import logsumexp

from fluentboard.errors import InvalidConfiguration, InvalidInput, InvalidModel
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.observation import Cluster
from fluentboard_modules.anchoring.spin_images import SpinImageConfig, describe

_FORMAT = "fluentboard-recogniser-1"
_NEAREST = 3
"""So many nearest examples of a class count: one alone may be an outlier."""

_SHARPNESSES = np.geomspace(2.0, 400.0, 25)


@dataclass(frozen=True, slots=True, eq=False)
class SpinImageRecogniser:
    """Rates classes by the distance to the nearest labelled examples (Section 4.2.1).

    The distance between two objects is the mean over the keypoints of one of the distance to the
    best fitting keypoint of the other. A class is as near as its nearest examples; confidences are
    a soft minimum whose sharpness was fitted on the training examples, each left out once.

    Attributes:
        classes: names of the classes.
        descriptors: `(t, keypoints, components)`; of the examples.
        labels: `(t,)`; class of each example.
        sharpness: factor on distances before the soft minimum.
        config: of the spin images.
    """

    classes: tuple[str, ...]
    descriptors: FloatArray
    labels: np.ndarray
    sharpness: float = 20.0
    config: SpinImageConfig = field(default_factory=SpinImageConfig)

    def recognise(self, cluster: Cluster) -> FloatArray:
        """`(k,)`; confidence per class; they sum to 1."""
        query = describe(cluster.points_map, cluster.viewpoint_map, self.config)
        return self.rate(query)

    def rate(self, query: FloatArray) -> FloatArray:
        """`(k,)`; confidence per class of an object with spin images `(keypoints, components)`."""
        distance = object_distances(query[None], self.descriptors)[0]
        return _confidence(
            _class_distances(distance, self.labels, len(self.classes)), self.sharpness
        )

    def save(self, path: Path) -> None:
        """Writes the recogniser as an `.npz` file; its folder is made if it is missing."""
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("wb") as file:
            np.savez_compressed(
                file,
                format=np.array(_FORMAT),
                classes=np.array(self.classes, dtype=np.str_),
                descriptors=self.descriptors.astype(np.float16),
                labels=self.labels.astype(np.int16),
                sharpness=np.float64(self.sharpness),
                counts=np.array(
                    [
                        self.config.radial_cells,
                        self.config.height_cells,
                        self.config.keypoints,
                        self.config.points_max,
                    ]
                ),
                sizes_m=np.array([self.config.radius_m, self.config.normal_radius_m]),
            )


def load_recogniser(path: Path) -> SpinImageRecogniser:
    """A recogniser that was saved.

    Raises:
        InvalidModel: the file is missing or is no recogniser.
    """
    try:
        with np.load(path, allow_pickle=False) as kept:
            arrays = {name: kept[name] for name in kept.files}
        if str(arrays["format"]) != _FORMAT:
            raise ValueError(f"format {arrays['format']}, this version reads {_FORMAT}")
        radial, height, keypoints, points_max = (int(v) for v in arrays["counts"])
        radius_m, normal_radius_m = (float(v) for v in arrays["sizes_m"])
        config = SpinImageConfig(radial, height, radius_m, keypoints, normal_radius_m, points_max)
        descriptors = arrays["descriptors"].astype(np.float64)
        labels = arrays["labels"].astype(np.int64)
        classes = tuple(str(name) for name in arrays["classes"])
        if descriptors.shape != (len(labels), keypoints, config.components):
            raise ValueError(f"descriptors of shape {descriptors.shape}")
        if not (len(labels) and 0 <= labels.min() <= labels.max() < len(classes)):
            raise ValueError("labels that are no classes")
        return SpinImageRecogniser(classes, descriptors, labels, float(arrays["sharpness"]), config)
    except (OSError, KeyError, ValueError, EOFError, InvalidConfiguration) as problem:
        raise InvalidModel(
            f"{path} holds no recogniser ({problem}); train one with: fluentboard train recogniser"
        ) from problem


def train_recogniser(
    clusters: Sequence[Cluster],
    labels: Sequence[str],
    classes: Sequence[str] | None = None,
    config: SpinImageConfig | None = None,
) -> SpinImageRecogniser:
    """A recogniser that knows labelled clusters.

    Args:
        clusters: examples.
        labels: class of each.
        classes: all classes in their order; default: those of the labels, sorted.
        config: of the spin images.

    Raises:
        InvalidInput: there are no examples, or a label is no class.
    """
    config = config if config is not None else SpinImageConfig()
    names = tuple(classes) if classes is not None else tuple(sorted(set(labels)))
    strange = sorted(set(labels) - set(names))
    if not clusters or strange:
        raise InvalidInput(
            f"labels {', '.join(strange)} are none of the classes {', '.join(names)}"
            if strange
            else "no examples to train a recogniser on; give labelled clusters or CAD models"
        )
    descriptors = np.stack([describe(c.points_map, c.viewpoint_map, config) for c in clusters])
    # As they are kept on disk: a saved recogniser rates like the one that was trained.
    descriptors = descriptors.astype(np.float16).astype(np.float64)
    numbers = np.array([names.index(label) for label in labels])
    sharpness = _fitted_sharpness(descriptors, numbers, len(names))
    return SpinImageRecogniser(names, descriptors, numbers, sharpness, config)


def object_distances(queries: FloatArray, examples: FloatArray) -> FloatArray:
    """`(q, t)`; distances of objects, given by spin images `(q, k, d)` and `(t, k, d)`."""
    count, keypoints, components = examples.shape
    flat = examples.reshape(-1, components)
    squares = np.sum(flat**2, axis=1)
    result = np.zeros((len(queries), count))
    for i, query in enumerate(queries):
        square = np.sum(query**2, axis=1)[:, None] + squares - 2.0 * query @ flat.T
        pairs = np.sqrt(np.maximum(square, 0.0)).reshape(len(query), count, keypoints)
        # Both ways: a part of an object must not fit everything that contains such a part.
        result[i] = 0.5 * (pairs.min(axis=2).mean(axis=0) + pairs.min(axis=0).mean(axis=1))
    return result


def _class_distances(distance: FloatArray, labels: np.ndarray, classes: int) -> FloatArray:
    """`(classes,)`; mean of the nearest few examples of each class; infinite without any."""
    result = np.full(classes, np.inf)
    for label in range(classes):
        own = distance[labels == label]
        own = own[np.isfinite(own)]
        if len(own):
            result[label] = np.sort(own)[:_NEAREST].mean()
    return result


def _confidence(distance: FloatArray, sharpness: float) -> FloatArray:
    scores = -sharpness * distance
    return np.exp(scores - logsumexp(scores))


def _fitted_sharpness(descriptors: FloatArray, labels: np.ndarray, classes: int) -> float:
    """The sharpness under which left-out examples are most likely."""
    distance = object_distances(descriptors, descriptors)
    np.fill_diagonal(distance, np.inf)
    known = [i for i in range(len(labels)) if np.sum(labels == labels[i]) > 1]
    if not known:
        return 20.0
    rows = np.stack([_class_distances(distance[i], labels, classes) for i in known])
    likelihood = [
        np.mean(
            [-s * row[labels[i]] - logsumexp(-s * row) for i, row in zip(known, rows, strict=True)]
        )
        for s in _SHARPNESSES
    ]
    return float(_SHARPNESSES[int(np.argmax(likelihood))])
