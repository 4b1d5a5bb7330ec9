"""Joint recognition of all objects of a scene with a trained CRF (Section 4.2.3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fluentboard.errors import InvalidModel
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.anchoring.crf import Crf
from fluentboard_modules.anchoring.map_inference import MapMethod, most_probable
from fluentboard_modules.anchoring.marginals import MarginalMethod, class_marginals
from fluentboard_modules.anchoring.observation import ContextBelief, SceneObject
from fluentboard_modules.anchoring.scene_graph import SceneGraphConfig, build_scene_graph


@dataclass(frozen=True, slots=True)
class Variant:
    """Which sources the classes come from: the columns of Table 4.7.

    Attributes:
        with_context: relations and features, by the CRF; False: local recognition alone.
        with_anchors: objects out of view that are anchored take part.
        with_local: confidences of local recognition take part.
    """

    with_context: bool = True
    with_anchors: bool = True
    with_local: bool = True

    def __str__(self) -> str:
        if not self.with_context:
            return "Loc"
        return "CRF" + "+A" * self.with_anchors + "+Loc" * self.with_local


VARIANTS: Mapping[str, Variant] = {
    str(variant): variant
    for variant in (
        Variant(with_context=False),
        Variant(with_local=False),
        Variant(with_anchors=False),
        Variant(),
    )
}
"""Loc, CRF+A, CRF+Loc and CRF+A+Loc, as named in Table 4.7."""


@dataclass(frozen=True, slots=True)
class CrfContextModel:
    """A context model that asks a CRF; see `observation.ContextModel`.

    Attributes:
        model: the trained CRF.
        config: how scene graphs are built; the features must be those of the training.
        variant: which sources take part.
        map_method: how the most probable joint assignment is found.
        marginal_method: how the probabilities of classes are found.

    Raises:
        InvalidModel: the model was trained on other features.
    """

    model: Crf
    config: SceneGraphConfig = field(default_factory=SceneGraphConfig)
    variant: Variant = field(default_factory=Variant)
    map_method: MapMethod = "exact"
    marginal_method: MarginalMethod = "auto"

    def __post_init__(self) -> None:
        given = (self.config.node_features, self.config.edge_features)
        if given != (self.model.node_names, self.model.edge_names):
            raise InvalidModel(
                f"the CRF was trained on the features {', '.join(self.model.node_names)} and "
                f"{', '.join(self.model.edge_names)}; build the scene graphs with the same ones"
            )

    @property
    def classes(self) -> tuple[str, ...]:
        """The classes, in the order of confidences and marginals."""
        return self.model.classes

    def infer(self, objects: Sequence[SceneObject]) -> Mapping[str, ContextBelief]:
        """Beliefs by the names of the objects that belong to the scene graph.

        Raises:
            InvalidModel: the confidences are of another number of classes.
        """
        wanted = [o for o in objects if o.is_tracked or self.variant.with_anchors]
        if not self.variant.with_context:
            return self._local(wanted)
        graph = build_scene_graph(wanted, self.config)
        members = [wanted[i] for i in graph.members]
        confidence = self._confidences(members) if self.variant.with_local else None
        potentials = self.model.potentials(graph.x, confidence, graph.edges, graph.e)
        best = most_probable(potentials, self.map_method).labels
        marginals = class_marginals(potentials, self.marginal_method)
        neighbours: list[list[str]] = [[] for _ in members]
        for a, b in graph.edges:
            neighbours[a].append(members[b].name)
            neighbours[b].append(members[a].name)
        return {
            member.name: ContextBelief(
                self.classes[best[i]], marginals[i], tuple(sorted(neighbours[i]))
            )
            for i, member in enumerate(members)
        }

    def _confidences(self, objects: Sequence[SceneObject]) -> FloatArray:
        for one in objects:
            if one.confidence.shape != (len(self.classes),):
                raise InvalidModel(
                    f"{one.name} comes with {one.confidence.size} confidences, the CRF knows "
                    f"{len(self.classes)} classes ({', '.join(self.classes)}); train it with the "
                    "same recogniser: fluentboard train crf"
                )
        return np.array([o.confidence for o in objects]).reshape(-1, len(self.classes))

    def _local(self, objects: Sequence[SceneObject]) -> Mapping[str, ContextBelief]:
        confidence = self._confidences(objects)
        total = confidence.sum(axis=1, keepdims=True)
        shares = np.where(
            total > 0.0, confidence / np.where(total > 0.0, total, 1.0), 1.0 / len(self.classes)
        )
        return {
            o.name: ContextBelief(self.classes[int(np.argmax(share))], share)
            for o, share in zip(objects, shares, strict=True)
        }
