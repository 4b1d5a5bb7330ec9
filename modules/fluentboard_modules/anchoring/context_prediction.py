"""Where an unseen object of a class would fit: imagined nodes of the CRF at candidate places."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import BoundingBox, FloatArray, Pose
from fluentboard_modules.anchoring.context_model import CrfContextModel
from fluentboard_modules.anchoring.observation import ContextBelief, SceneObject, SupportPlane
from fluentboard_modules.anchoring.scene_graph import SIZE_DEPENDENT, object_features, pair_features
from fluentboard_modules.anchoring.table_geometry import inside

USUAL_PROBABILITY = 0.2
"""P_i of Section 5.3: what a volume holds the target with if nothing is known."""


@dataclass(frozen=True, slots=True, eq=False)
class CandidateVolume:
    """A box in which the target may be, with what it lies over.

    Attributes:
        name: of the search volume.
        box: where it is.
        support: the top below it; None if unknown: then the box's own outline counts as the top.
    """

    name: str
    box: BoundingBox
    support: SupportPlane | None = None


def class_probability_at(
    places_map: FloatArray,
    support: SupportPlane | None,
    objects: Sequence[SceneObject],
    beliefs: Mapping[str, ContextBelief],
    context: CrfContextModel,
) -> FloatArray:
    """`(n, k)`; probability of each class for an object that stands at each place.

    A node is added to the scene graph at every place in turn. Its size is unknown, so only its
    place on the table and its relations to the anchored objects around it count. What the objects
    are is taken from their beliefs, which the added node does not change: nothing has been seen
    there yet.

    Args:
        places_map: `(n, 3)`; candidate centres in the map frame.
        support: what they lie on; None if unknown.
        objects: that are anchored, on the same top or not.
        beliefs: of a context model about the objects, by name; an object without one is ignored.
        context: the trained model and its scene graphs.
    """
    classes = context.classes
    known = [o for o in objects if o.name in beliefs]
    places = np.asarray(places_map, dtype=np.float64).reshape(-1, 3)
    if not len(places):
        return np.zeros((0, len(classes)))
    imagined = [_imagined(place, support) for place in places]
    config, model = context.config, context.model
    x = object_features(imagined, config.node_features)
    x[:, [name in SIZE_DEPENDENT for name in config.node_features]] = np.nan
    score = model.node_scaling.apply(x) @ model.node_weights
    if known:
        centres = np.array([[o.box.pose.x, o.box.pose.y, o.box.pose.z] for o in known])
        apart = np.linalg.norm(places[:, None] - centres, axis=2)
        marginals = np.stack([beliefs[o.name].marginals for o in known])
        for n in range(len(places)):
            near = np.argsort(apart[n], kind="stable")[: config.neighbours_max]
            near = near[apart[n, near] < config.context_range_m]
            if not len(near):
                continue
            edges = np.array([[0, 1 + k] for k in range(len(near))])
            e = pair_features([imagined[n], *(known[k] for k in near)], edges, config.edge_features)
            e[:, [name in SIZE_DEPENDENT for name in config.edge_features]] = np.nan
            pairwise = np.tensordot(model.edge_scaling.apply(e), model.edge_weights, axes=(1, 0))
            # What each neighbour says about the node, averaged over what the neighbour may be.
            weight = np.log(np.maximum(marginals[near], 1e-12))[:, None, :]
            score[n] += logsumexp(pairwise + weight, axis=2).sum(axis=0)
    return np.exp(score - logsumexp(score, axis=1, keepdims=True))


def volume_probabilities(
    target: str,
    volumes: Sequence[CandidateVolume],
    objects: Sequence[SceneObject],
    context: CrfContextModel,
    spacing_m: float = 0.1,
    usual: float = USUAL_PROBABILITY,
) -> dict[str, float]:
    """Probability that at least one unseen object of a class is in each volume, by name.

    Places on a grid over each volume are rated by `class_probability_at`; a volume is as much more
    likely than usual as its places favour the class over what the class has at all places of all
    volumes. Places where something is known to stand do not count. Odds, not probabilities, are
    scaled, so that the result stays below 1.

    Args:
        target: class that is looked for.
        volumes: where it may be.
        objects: that are anchored.
        context: the trained model.
        spacing_m: of the candidate places.
        usual: probability of a volume that is as good as the average.

    Raises:
        InvalidInput: the model does not know the class.
    """
    if target not in context.classes:
        raise InvalidInput(
            f"the context model does not know {target}; it knows {', '.join(context.classes)}"
        )
    everything = [SceneObject(o.name, o.box, o.confidence, o.support) for o in objects]
    beliefs = context.infer(everything)
    column = context.classes.index(target)
    ratings: dict[str, float] = {}
    for volume in volumes:
        places = candidate_places(volume, everything, spacing_m)
        rating = class_probability_at(places, volume.support, everything, beliefs, context)
        ratings[volume.name] = float(rating[:, column].mean()) if len(rating) else 0.0
    average = float(np.mean(list(ratings.values()))) if ratings else 0.0
    if average <= 0.0:
        return dict.fromkeys(ratings, usual)
    odds = usual / (1.0 - usual)
    return {
        name: (odds * rating / average) / (1.0 + odds * rating / average)
        for name, rating in ratings.items()
    }


def candidate_places(
    volume: CandidateVolume, objects: Sequence[SceneObject], spacing_m: float
) -> FloatArray:
    """`(n, 3)`; places on a grid over the bottom of a volume where nothing is known to stand."""
    box = volume.box
    half = 0.5 * box.sizes

    def steps(extent: float) -> FloatArray:
        count = max(1, round(2.0 * extent / spacing_m))
        return (np.arange(count) + 0.5) / count * 2.0 * extent - extent

    x, y = np.meshgrid(steps(half[0]), steps(half[1]), indexing="ij")
    local = np.stack([x.ravel(), y.ravel(), np.full(x.size, -half[2])], axis=1)
    places = box.pose.to_transform().apply(local)
    if volume.support is not None:
        places = places[inside(volume.support.boundary_map, places[:, :2])]
    free = np.ones(len(places), dtype=bool)
    for one in objects:
        away = places[:, :2] - (one.box.pose.x, one.box.pose.y)
        reach = 0.5 * max(one.box.x_size, one.box.y_size)
        near = np.abs(places[:, 2] - (one.box.pose.z - 0.5 * one.box.z_size)) < 0.15
        free &= ~(near & (np.linalg.norm(away, axis=1) < reach))
    return places[free]


def _imagined(place: FloatArray, support: SupportPlane | None) -> SceneObject:
    pose = Pose(float(place[0]), float(place[1]), float(place[2]))
    return SceneObject("", BoundingBox(pose, 0.1, 0.1, 0.1), np.zeros(0), support)
