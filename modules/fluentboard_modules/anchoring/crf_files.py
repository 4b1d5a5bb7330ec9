"""Trained CRFs on disk: an `.npz` that says what it was trained on, and is read without pickle."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fluentboard.errors import InvalidConfiguration, InvalidModel
from fluentboard_modules.anchoring.crf import Crf, Scaling
from fluentboard_modules.anchoring.scene_graph import SceneGraphConfig

_FORMAT = "fluentboard-crf-1"
_FORMS = ("logarithm", "product", "none")


def save_crf(path: Path, model: Crf, config: SceneGraphConfig) -> None:
    """Writes a model and how its scene graphs are built.

    Args:
        path: of the file, `.npz`; its folder is made if it is missing.
        model: the trained CRF.
        config: context range and features of the training graphs.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        np.savez_compressed(
            file,
            format=np.array(_FORMAT),
            classes=np.array(model.classes, dtype=np.str_),
            node_names=np.array(model.node_names, dtype=np.str_),
            edge_names=np.array(model.edge_names, dtype=np.str_),
            node_weights=model.node_weights,
            edge_weights=model.edge_weights,
            node_mean=model.node_scaling.mean,
            node_deviation=model.node_scaling.deviation,
            edge_mean=model.edge_scaling.mean,
            edge_deviation=model.edge_scaling.deviation,
            clip=np.float64(model.node_scaling.clip),
            local_form=np.array(model.local_form),
            local_weight=np.float64(model.local_weight),
            confidence_floor=np.float64(model.confidence_floor),
            trained_on=np.array(model.trained_on),
            context_range_m=np.float64(config.context_range_m),
            neighbours_max=np.int64(config.neighbours_max),
        )


def load_crf(path: Path, classes: Sequence[str] | None = None) -> tuple[Crf, SceneGraphConfig]:
    """A model that `save_crf` wrote.

    Args:
        path: of the file.
        classes: those of the recogniser whose confidences it shall work with; None: any.

    Raises:
        InvalidModel: the file is missing, is no such model, or was trained for other classes.
    """
    try:
        with np.load(path, allow_pickle=False) as kept:
            arrays = {name: kept[name] for name in kept.files}
        if str(arrays["format"]) != _FORMAT:
            raise InvalidModel(
                f"{path} has format {arrays['format']}, this version reads {_FORMAT}; train it "
                "again with: fluentboard train crf"
            )
        names = [tuple(str(n) for n in arrays[k]) for k in ("classes", "node_names", "edge_names")]
        local_form = str(arrays["local_form"])
        if local_form not in _FORMS:
            raise ValueError(f"local form {local_form!r}")
        clip = float(arrays["clip"])
        model = Crf(
            *names,
            arrays["node_weights"],
            arrays["edge_weights"],
            Scaling(arrays["node_mean"], arrays["node_deviation"], clip),
            Scaling(arrays["edge_mean"], arrays["edge_deviation"], clip),
            local_form,  # type: ignore[arg-type]
            float(arrays["local_weight"]),
            float(arrays["confidence_floor"]),
            str(arrays["trained_on"]),
        )
        config = SceneGraphConfig(
            float(arrays["context_range_m"]),
            int(arrays["neighbours_max"]),
            model.node_names,
            model.edge_names,
        )
        _check_shapes(model)
    except (OSError, KeyError, ValueError, EOFError, InvalidConfiguration) as problem:
        raise InvalidModel(
            f"{path} holds no trained CRF ({problem}); train one with: fluentboard train crf"
        ) from problem
    if classes is not None:
        require_classes(model, classes)
    return model, config


def require_classes(model: Crf, classes: Sequence[str]) -> None:
    """Refuses a model whose classes, or their order, are not the given ones.

    Raises:
        InvalidModel: they differ; the message says in which.
    """
    if tuple(classes) == model.classes:
        return
    lacking = [name for name in classes if name not in model.classes]
    more = [name for name in model.classes if name not in classes]
    differ = []
    if lacking:
        differ.append(f"does not know {', '.join(lacking)}")
    if more:
        differ.append(f"knows {', '.join(more)} besides")
    raise InvalidModel(
        f"the CRF trained on data {model.trained_on or 'unknown'} "
        f"{' and '.join(differ) or 'has its classes in another order'}; train it with the same "
        "recogniser: fluentboard train crf"
    )


def _check_shapes(model: Crf) -> None:
    labels = len(model.classes)
    nodes, edges = len(model.node_names), len(model.edge_names)
    if model.node_weights.shape != (nodes, labels):
        raise ValueError(f"unary weights have shape {model.node_weights.shape}")
    if model.edge_weights.shape != (edges, labels, labels):
        raise ValueError(f"pairwise weights have shape {model.edge_weights.shape}")
    weights = (model.node_weights, model.edge_weights)
    if not all(np.isfinite(array).all() for array in weights):
        raise ValueError("a weight is not finite")
