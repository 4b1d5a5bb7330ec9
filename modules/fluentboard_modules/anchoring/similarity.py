"""How unlike two observations are: pair features and the linear SVM over them (Section 4.2.2.1).

The thesis calls the signed distance from the SVM's decision boundary "similarity" although it grows
as two objects differ; here it is the mismatch (E7). Negative means "same object".
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import BoundingBox, FloatArray

FEATURE_SETS: dict[str, tuple[str, ...]] = {
    "a": ("distance", "diff_object_types"),
    "b": ("distance", "diff_object_types_vector"),
    "c": (
        "distance",
        "diff_object_types",
        "diff_v_elong",
        "diff_h_elong",
        "diff_v_area",
        "diff_h_area",
        "volume_ratio",
    ),
    "d": (
        "distance",
        "diff_object_types_vector",
        "diff_v_elong",
        "diff_h_elong",
        "diff_v_area",
        "diff_h_area",
        "volume_ratio",
    ),
}
"""The feature sets of Table 4.4. The thesis, and the default, is (a)."""

_FORMAT = "fluentboard-mismatch-1"
_DEFAULT = "mismatch.json"
_ADRIFT_LOOK = 0.87  # by which the confidences of one object differ, at most
_ADRIFT_WEIGHT = 0.4  # an anchor whose place fits goes before one that may be anywhere


@dataclass(frozen=True, slots=True, eq=False)
class Appearance:
    """What the features of Table 4.1 need of an object or an anchor.

    Attributes:
        box: upright box in the map frame.
        confidence: `(k,)`; of local recognition.
        is_part: whether a part of it may be hidden; then the distance to a larger object is the
            least over all places that the hidden part may have.
        is_adrift: whether nobody knows where it is; then only the look of it counts.
    """

    box: BoundingBox
    confidence: FloatArray
    is_part: bool = False
    is_adrift: bool = False


def pair_features(
    first: Sequence[Appearance], second: Sequence[Appearance], names: Sequence[str]
) -> FloatArray:
    """`(n, m, f)`; features of Table 4.1 of every pair.

    The volume ratio is the logarithm's absolute value, so that it does not depend on the order of
    the two and 0 means equal. Deviates from Table 4.1, which divides one volume by the other.

    Args:
        first: n objects.
        second: m anchors.
        names: which features, as in `FEATURE_SETS`.

    Raises:
        InvalidInput: a feature is unknown.
    """
    a, b = _measures(first), _measures(second)
    columns: list[FloatArray] = []
    for name in names:
        if name == "diff_object_types_vector":
            between = a["confidence"][:, None] - b["confidence"][None]
            columns += list(np.moveaxis(between**2, -1, 0))
        elif name == "diff_object_types":
            between = a["confidence"][:, None] - b["confidence"][None]
            columns.append(np.linalg.norm(between, axis=-1))
        elif name == "distance":
            columns.append(_distances(first, second))
        elif name == "volume_ratio":
            columns.append(np.abs(a["log_volume"][:, None] - b["log_volume"][None]))
        elif name in _SQUARED:
            measure = _SQUARED[name]
            columns.append((a[measure][:, None] - b[measure][None]) ** 2)
        else:
            raise InvalidInput(
                f"no pair feature is called {name!r}; known are "
                f"{', '.join(sorted({n for names in FEATURE_SETS.values() for n in names}))}"
            )
    return np.stack(columns, axis=-1) if columns else np.zeros((len(first), len(second), 0))


def _distances(first: Sequence[Appearance], second: Sequence[Appearance]) -> FloatArray:
    """`(n, m)`; metres between the centres."""
    a, b = (_measures(objects)["centre"] for objects in (first, second))
    away = a[:, None] - b[None]
    for i, thing in enumerate(first):
        if not thing.is_part:
            continue
        for j, whole in enumerate(second):
            turn = whole.box.pose.to_transform().rotation
            room = np.maximum(0.0, 0.5 * (whole.box.sizes - thing.box.sizes))
            local = away[i, j] @ turn
            away[i, j] = np.sign(local) * np.maximum(0.0, np.abs(local) - room)
    return np.linalg.norm(away, axis=-1)


_SQUARED = {
    "diff_h_area": "area_h",
    "diff_v_area": "area_v",
    "diff_h_elong": "elong_h",
    "diff_v_elong": "elong_v",
}


def _measures(objects: Sequence[Appearance]) -> dict[str, FloatArray]:
    if not objects:
        empty = np.zeros(0)
        shapes = {"confidence": np.zeros((0, 1)), "centre": np.zeros((0, 3))}
        names = ("area_h", "area_v", "elong_h", "elong_v", "log_volume")
        return {**dict.fromkeys(names, empty), **shapes}
    size = np.maximum([o.box.sizes for o in objects], 1e-4)
    x, y, z = size.T
    across = np.hypot(x, y)
    return {
        "confidence": np.array([o.confidence for o in objects]),
        "centre": np.array([(o.box.pose.x, o.box.pose.y, o.box.pose.z) for o in objects]),
        "area_h": x * y,
        "area_v": z * across,
        "elong_h": np.maximum(x, y) / np.minimum(x, y),
        "elong_v": z / across,
        "log_volume": np.log(x * y * z),
    }


@dataclass(frozen=True, slots=True, eq=False)
class MismatchModel:
    """A linear SVM's decision boundary in Hesse normal form.

    Attributes:
        features: names of Table 4.1.
        scale: `(f,)`; standard deviations that the features are divided by.
        normal: `(f,)`; unit normal of the boundary in scaled features, towards "different".
        offset: distance of the boundary from the origin.
        classes: of the recogniser whose confidences it was trained on.
        fingerprint: of the training data; empty if unknown.
    """

    features: tuple[str, ...]
    scale: FloatArray
    normal: FloatArray
    offset: float
    classes: tuple[str, ...] = ()
    fingerprint: str = ""

    def mismatch(self, objects: Sequence[Appearance], anchors: Sequence[Appearance]) -> FloatArray:
        """`(n, m)`; signed distance from the boundary; negative means "same object"."""
        features = pair_features(objects, anchors, self.features)
        if not features.size:
            return np.zeros((len(objects), len(anchors)))
        mismatch = features / self.scale @ self.normal - self.offset
        adrift = [anchor.is_adrift for anchor in anchors]
        if any(adrift):
            looks = pair_features(objects, anchors, ("diff_object_types",))[..., 0]
            unlike = _ADRIFT_WEIGHT * self.offset * (looks / _ADRIFT_LOOK - 1.0)
            mismatch[:, adrift] = unlike[:, adrift]
        return mismatch

    def rate(self, features: FloatArray) -> FloatArray:
        """`(n,)`; the mismatch of pairs with features `(n, f)`."""
        return features / self.scale @ self.normal - self.offset

    def check_classes(self, classes: Sequence[str]) -> None:
        """Refuses a recogniser with other classes than the ones trained with.

        Raises:
            InvalidInput: the classes differ.
        """
        is_vector = "diff_object_types_vector" in self.features
        if self.classes and is_vector and tuple(classes) != self.classes:
            raise InvalidInput(
                f"the mismatch was trained for the classes {', '.join(self.classes)}, but the "
                f"recogniser knows {', '.join(classes)}; train it anew: fluentboard train mismatch"
            )

    def save(self, path: Path) -> None:
        """Writes it as JSON.

        Raises:
            InvalidInput: the file cannot be written.
        """
        document = {
            "format": _FORMAT,
            "features": list(self.features),
            "scale": self.scale.tolist(),
            "normal": self.normal.tolist(),
            "offset": self.offset,
            "classes": list(self.classes),
            "training_data": self.fingerprint,
        }
        try:
            path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
        except OSError as problem:
            raise InvalidInput(f"{path}: cannot be written ({problem.strerror})") from problem


def load_mismatch(path: Path | None = None) -> MismatchModel:
    """A mismatch from a file; without a path the built-in one, trained on simulated tables.

    Raises:
        InvalidInput: the file cannot be read or holds something else.
    """
    try:
        if path is None:
            text = files("fluentboard_modules.anchoring").joinpath(_DEFAULT).read_text("utf-8")
        else:
            text = path.read_text(encoding="utf-8")
        document = json.loads(text)
        if document["format"] != _FORMAT:
            raise ValueError(f"format {document['format']!r}")
        model = MismatchModel(
            tuple(document["features"]),
            np.array(document["scale"], dtype=np.float64),
            np.array(document["normal"], dtype=np.float64),
            float(document["offset"]),
            tuple(document["classes"]),
            str(document["training_data"]),
        )
        if model.scale.shape != model.normal.shape or not np.all(model.scale > 0.0):
            raise ValueError("scale and normal do not fit")
        return model
    except (OSError, ValueError, KeyError, TypeError) as problem:
        raise InvalidInput(
            f"{path}: no mismatch model ({problem}); train one: fluentboard train mismatch"
        ) from problem


def train_mismatch(
    features: FloatArray,
    is_same: FloatArray,
    names: Sequence[str],
    *,
    classes: Sequence[str] = (),
    fingerprint: str = "",
    penalty: float = 1.0,
) -> MismatchModel:
    """The linear SVM that tells pairs of one object from pairs of two.

    Args:
        features: `(n, f)`; as `pair_features` gives them.
        is_same: `(n,)` bool; whether both observations are of one object.
        names: of the features.
        classes: of the recogniser.
        fingerprint: of the training data.
        penalty: the SVM's C.

    Raises:
        InvalidInput: there are not both kinds of pairs.
    """
    from sklearn.svm import LinearSVC

    same = np.asarray(is_same, dtype=bool)
    if same.all() or not same.any():
        raise InvalidInput(
            f"{len(same)} pairs, {int(same.sum())} of them of one object; training needs both kinds"
        )
    scale = np.maximum(features.std(axis=0), 1e-9)
    machine = LinearSVC(C=penalty, dual=False, max_iter=20000, random_state=0)
    machine.fit(features / scale, ~same)
    weights = machine.coef_[0]
    length = float(np.linalg.norm(weights))
    return MismatchModel(
        tuple(names),
        scale,
        weights / length,
        -float(machine.intercept_[0]) / length,
        tuple(classes),
        fingerprint,
    )
