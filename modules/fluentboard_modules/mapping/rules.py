"""The furniture ontology as a classifier of planes: `load_rules(text).classify(regions)`.

Thresholds, class definitions and tolerances all come from the ontology file (section 3.2.2). Every
plane may hold several labels, and one plane may begin several hypotheses; which of them is believed
is decided later, over many frames.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidOntology
from fluentboard.model.geometry import FloatArray, Plane
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.compiled_rules import compile_rules
from fluentboard_modules.mapping.near_misses import NearMiss, find_near_misses
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.plane_features import PlaneRelations, measure_features
from fluentboard_modules.mapping.rule_checks import check_rules
from fluentboard_modules.mapping.rule_evaluation import Evaluation
from fluentboard_modules.mapping.rule_language import (
    And,
    Expression,
    FurnitureClass,
    Named,
    Or,
    RuleSet,
    Some,
)
from fluentboard_modules.mapping.rule_reader import check_turtle, read_rules
from fluentboard_ontology import read

# Chairs' backs recline by 5 degrees and more, and stand off a wall by the depth of a skirting.
_SAME_COSINE, _SAME_PLANE_M = 0.99, 0.08
_WALL_M2 = 0.4  # no backrest is larger
# A level plane may be a part of a model's top from so much of it on.
_PART_SHARE, _PART_M2, _TOP_REACH_M = 0.015, 0.012, 0.05


@dataclass(frozen=True, slots=True)
class PlaneInRole:
    """A plane that satisfied a part of a definition.

    Attributes:
        plane: index of the region.
        label: the class that the definition asked for, such as `ChairBackrestPlane`.
    """

    plane: int
    label: str


@dataclass(frozen=True, slots=True)
class FurnitureHypothesis:
    """Planes that satisfy the definition of a class of furniture.

    Attributes:
        class_name: the class.
        main_plane: index of the region the definition holds for.
        planes: all regions that satisfied a part of it, the main plane first.
        rules: names of the rules that gave these planes their labels.
        priority: the class's priority in the ontology.
        main_label: the label the definition asked of the main plane.
    """

    class_name: str
    main_plane: int
    planes: tuple[PlaneInRole, ...]
    rules: tuple[str, ...]
    priority: float
    main_label: str


@dataclass(frozen=True, slots=True)
class Classification:
    """What the ontology says about a set of planes.

    Attributes:
        labels: per region its classes, the most specific and the general ones.
        rules: per region the names of the rules that fired for it.
        hypotheses: furniture, the preferred class first.
        near_misses: what nearly was furniture, and what is missing.
    """

    labels: tuple[frozenset[str], ...]
    rules: tuple[tuple[str, ...], ...]
    hypotheses: tuple[FurnitureHypothesis, ...]
    near_misses: tuple[NearMiss, ...]


class Reasoner(Protocol):
    """Something that finds the members of the ontology's classes."""

    def entailed(
        self, regions: Sequence[PlanarRegion], features: Mapping[str, FloatArray]
    ) -> Mapping[str, NDArray[np.bool_]]:
        """`(n,)` per class: which planes belong to it."""
        ...


def partial_hypotheses(
    classification: Classification,
    furniture: FurnitureClass,
    regions: Sequence[PlanarRegion],
    models: Sequence[CadModel] = (),
    settled: Collection[int] | None = None,
) -> list[FurnitureHypothesis]:
    """Planes that have a label of a class's main or back plane without the rest of its definition.

    Of a chair in one image often only the seat or only the back is in sight. That is too little for
    the definition, but enough to look there with a CAD model; and so is a small part of a top at
    the height where a model has its top. What lies in the plane of a wall is a piece of the wall
    that shows between other things, and no back.

    Args:
        classification: of the regions.
        furniture: the class.
        regions: that were classified.
        models: CAD models of the class.
        settled: planes that need not be tried by themselves; by default those that a whole
            definition begins with.
    """
    labels_of = classification.labels
    walls = [
        region
        for region, labels in zip(regions, labels_of, strict=True)
        if "VerticalPlane" in labels
        and region.area_m2 >= _WALL_M2
        and not labels.intersection(furniture.back_planes)
    ]
    # A backrest that took part in a definition may still be that of the chair next to it.
    defined = settled
    if defined is None:
        defined = {
            hypothesis.main_plane
            for hypothesis in classification.hypotheses
            if hypothesis.class_name == furniture.name
        }
    found: list[FurnitureHypothesis] = []
    for plane, labels in enumerate(classification.labels):
        wanted = [n for n in furniture.part_planes if n in labels]
        is_plain = not furniture.front_planes and not furniture.back_planes
        if not wanted and is_plain and "HorizontalPlane" in labels:
            # The rule asks for more of a top than is seen of this one.
            wanted = [
                furniture.main_planes[0] for m in models if _is_part_of_top(regions[plane], m)
            ]
        is_back = bool(wanted) and wanted[0] in furniture.back_planes
        if is_back and any(_lies_in(regions[plane], wall) for wall in walls):
            continue
        if wanted and plane not in defined:
            found.append(
                FurnitureHypothesis(
                    class_name=furniture.name,
                    main_plane=plane,
                    planes=(PlaneInRole(plane, wanted[0]),),
                    rules=classification.rules[plane],
                    priority=furniture.priority,
                    main_label=wanted[0],
                )
            )
    return found


def _is_part_of_top(region: PlanarRegion, model: CadModel) -> bool:
    """Whether a level region may be a part of a model's main face."""
    face = model.top_faces(region.height_m, _TOP_REACH_M)
    if face is None:
        return False
    area_m2 = float(np.prod(face[1] - face[0]))
    return region.area_m2 >= max(_PART_SHARE * area_m2, _PART_M2)


def _lies_in(region: PlanarRegion, wall: PlanarRegion) -> bool:
    """Whether a region is a part of the plane of another, larger one."""
    if region is wall:
        return True
    offset = abs(float(wall.normal @ (region.centroid - wall.centroid)))
    return abs(float(region.normal @ wall.normal)) > _SAME_COSINE and offset < _SAME_PLANE_M


class FurnitureRules:
    """A furniture ontology, ready to classify planes.

    Args:
        rules: what `read_rules` found in the ontology file.
        reasoner: finds the members of classes; by default the compiled rules do.

    Raises:
        InvalidOntology: it uses something that cannot be measured or evaluated.
    """

    def __init__(self, rules: RuleSet, reasoner: Reasoner | None = None) -> None:
        check_rules(rules)
        self.rules = rules
        self._compiled = compile_rules(rules)
        self._plane_classes = _plane_classes(rules)
        self._label_of = {rule.name: name for name, rule in self._compiled.class_rules}
        self._reasoner = reasoner

    @property
    def furniture_classes(self) -> tuple[FurnitureClass, ...]:
        """The classes with a definition, by name."""
        return tuple(self.rules.furniture.values())

    def classify(
        self,
        regions: Sequence[PlanarRegion],
        *,
        floor: Plane | None = None,
        explain: bool = True,
    ) -> Classification:
        """Labels of the regions, and the furniture they make up.

        Args:
            regions: planes in the map frame, of one frame or accumulated over many.
            floor: from where heights count; by default from z = 0.
            explain: whether to look for near misses, which takes longer than the rest.
        """
        relations = PlaneRelations(
            regions, {name: p.tolerances for name, p in self.rules.relations.items()}
        )
        features = measure_features(regions, floor)
        entailed = None
        if self._reasoner is not None and regions:
            entailed = self._reasoner.entailed(regions, features)
        evaluation = Evaluation(self._compiled, features, relations, len(regions), entailed)
        labels: list[set[str]] = [set() for _ in regions]
        for class_name in self._plane_classes:
            for plane in evaluation.members(class_name).nonzero()[0]:
                labels[plane].add(class_name)
        fired: list[list[str]] = [[] for _ in regions]
        for _, rule in self._compiled.class_rules:
            for plane in evaluation.fired(rule).nonzero()[0]:
                fired[plane].append(rule.name)
        hypotheses = [
            self._hypothesis(furniture, int(plane), evaluation, fired)
            for furniture in self.rules.furniture.values()
            for plane in self._defined(furniture, evaluation)
        ]
        hypotheses.sort(key=lambda h: (-h.priority, h.class_name, h.main_plane))
        return Classification(
            labels=tuple(frozenset(names) for names in labels),
            rules=tuple(tuple(names) for names in fired),
            hypotheses=tuple(hypotheses),
            near_misses=(
                tuple(find_near_misses(self.rules, features, relations, evaluation))
                if explain
                else ()
            ),
        )

    def _defined(self, furniture: FurnitureClass, evaluation: Evaluation) -> list[int]:
        """The planes that satisfy a class's own definition, not only that of a subclass."""
        satisfied = evaluation.members(furniture.name) & np.logical_or.reduce(
            [evaluation.satisfies(d) for d in self.rules.definitions[furniture.name]]
        )
        return [int(plane) for plane in satisfied.nonzero()[0]]

    def _hypothesis(
        self,
        furniture: FurnitureClass,
        plane: int,
        evaluation: Evaluation,
        fired: list[list[str]],
    ) -> FurnitureHypothesis:
        parts: list[PlaneInRole] = []
        for definition in self.rules.definitions[furniture.name]:
            parts.extend(_witnesses(definition, plane, evaluation))
        unique = tuple(dict.fromkeys(parts))
        main_first = sorted(unique, key=lambda part: part.plane != plane)
        names = [
            name
            for part in main_first
            for name in fired[part.plane]
            if self._label_of[name] == part.label
        ]
        return FurnitureHypothesis(
            class_name=furniture.name,
            main_plane=plane,
            planes=tuple(main_first),
            rules=tuple(dict.fromkeys(names)),
            priority=furniture.priority,
            main_label=main_first[0].label,
        )


def furniture_ontology(more: Sequence[Path] = ()) -> str:
    """Our furniture ontology and whatever classes are added to it, as Turtle.

    Args:
        more: files in Turtle.

    Raises:
        InvalidOntology: a file cannot be read.
    """
    texts = [read("furniture")]
    for path in more:
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise InvalidOntology(f"ontology {path} cannot be read: {error}") from error
        check_turtle(text, str(path))
        texts.append(text)
    return "\n".join(texts)


def load_rules(turtle_text: str) -> FurnitureRules:
    """The classifier of a furniture ontology.

    Args:
        turtle_text: the text of the ontology file (`fluentboard_ontology.read("furniture")`).

    Raises:
        InvalidOntology: the text does not parse, or asks for something that cannot be measured.
    """
    return FurnitureRules(read_rules(turtle_text))


def _plane_classes(rules: RuleSet) -> tuple[str, ...]:
    """All classes below Plane, and what rules conclude."""
    names: list[str] = []
    pending = ["Plane"]
    while pending:
        for child in rules.subclasses.get(pending.pop(), ()):
            if child not in names and child not in rules.furniture:
                names.append(child)
                pending.append(child)
    return tuple(names)


def _witnesses(expression: Expression, plane: int, evaluation: Evaluation) -> list[PlaneInRole]:
    """The planes that make an expression true of a plane; empty if it is not true."""
    if not evaluation.satisfies_one(expression, plane):
        return []
    match expression:
        case Named(class_name):
            return [PlaneInRole(plane, class_name)]
        case And(parts) | Or(parts):
            return [w for part in parts for w in _witnesses(part, plane, evaluation)]
        case Some(relation, filler):
            return [
                witness
                for other in evaluation.partners(relation, filler, plane)
                for witness in _witnesses(filler, other, evaluation)
            ]
