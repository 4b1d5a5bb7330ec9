"""The part of SWRL and OWL that the furniture ontology is written in, as plain data.

Nothing here knows RDF or geometry: `rule_reader` makes these from an ontology file and
`rule_evaluation` applies them to planes. Names are local names of the ontology (`ChairSeatPlane`,
`hasPosY`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable of a rule, `?p`."""

    name: str


Term = Variable | float


@dataclass(frozen=True, slots=True)
class ClassAtom:
    """`ClassName(?p)`."""

    class_name: str
    argument: Variable


@dataclass(frozen=True, slots=True)
class RelationAtom:
    """`isBelow(?p, ?q)`."""

    relation: str
    subject: Variable
    object: Variable


@dataclass(frozen=True, slots=True)
class FeatureAtom:
    """`hasSize(?p, ?s)`, or with a number in the second place."""

    feature: str
    subject: Variable
    value: Term


@dataclass(frozen=True, slots=True)
class ComparisonAtom:
    """`swrlb:greaterThan(?s, 0.01)`; the arguments are in the order of SWRL."""

    comparison: str
    left: Term
    right: Term


Atom = ClassAtom | RelationAtom | FeatureAtom | ComparisonAtom


@dataclass(frozen=True, slots=True)
class Rule:
    """A SWRL rule: if all atoms of the body hold, the head holds.

    Attributes:
        name: local name of the rule in the ontology.
        head: what follows.
        body: what must hold.
    """

    name: str
    head: ClassAtom | RelationAtom
    body: tuple[Atom, ...]


@dataclass(frozen=True, slots=True)
class Named:
    """The class expression that is a class name."""

    class_name: str


@dataclass(frozen=True, slots=True)
class And:
    """`A and B`."""

    parts: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class Or:
    """`A or B`."""

    parts: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class Some:
    """`relation some Filler`: at least one thing the relation leads to is a Filler."""

    relation: str
    filler: Expression


Expression = Named | And | Or | Some


@dataclass(frozen=True, slots=True)
class FurnitureClass:
    """What the ontology says about a class of furniture.

    Attributes:
        name: local name of the class.
        main_planes: labels of the plane whose centroid is the first estimate of the position.
        back_planes: labels of the plane at its back; empty if the orientation comes from the PCA.
        symmetry_order: how many turns about the vertical look alike.
        priority: of two hypotheses for the same plane, the higher is preferred.
        typical_depth_m: from back to front, for what is hidden; 0 if the ontology does not say.
        front_planes: labels of a plane that is its front, facing whoever uses it, or part of it.
        has_room_below: whether chairs may stand below it.
        side_planes: labels of a plane that is its left or its right side.
        hanging_height_m: extent of what hangs on a wall, downwards from its main plane; 0 for
            what stands on the floor.
    """

    name: str
    main_planes: tuple[str, ...]
    back_planes: tuple[str, ...]
    symmetry_order: int
    priority: float
    typical_depth_m: float = 0.0
    front_planes: tuple[str, ...] = ()
    has_room_below: bool = False
    side_planes: tuple[str, ...] = ()
    hanging_height_m: float = 0.0

    @property
    def part_planes(self) -> tuple[str, ...]:
        """Labels of which one plane alone is a reason to try a CAD model; the best reason first."""
        return tuple(dict.fromkeys((*self.main_planes, *self.back_planes, *self.front_planes)))


@dataclass(frozen=True, slots=True)
class RelationProperties:
    """How a relation between planes is measured, and what follows from it.

    Attributes:
        name: local name of the relation.
        tolerances: the annotations of the ontology, such as `{"maximumGap": 0.25}`; empty for a
            relation that is not measured but follows by rule.
        sub_relations: relations that imply this one.
        inverses: relations that hold of (q, p) iff this one holds of (p, q).
        is_symmetric: whether it holds of (q, p) whenever it holds of (p, q).
    """

    name: str
    tolerances: Mapping[str, float]
    sub_relations: tuple[str, ...] = ()
    inverses: tuple[str, ...] = ()
    is_symmetric: bool = False


@dataclass(frozen=True, slots=True)
class RuleSet:
    """A furniture ontology as far as the classifier uses it.

    Attributes:
        rules: the SWRL rules.
        definitions: per class the expressions it is equivalent to or a superclass of.
        subclasses: per class its named direct subclasses.
        furniture: the classes below Furniture that have a definition, by name.
        relations: the object properties, by name.
        features: names of the datatype properties.
        labels: human-readable names of classes, properties and rules.
    """

    rules: tuple[Rule, ...]
    definitions: Mapping[str, tuple[Expression, ...]]
    subclasses: Mapping[str, tuple[str, ...]]
    furniture: Mapping[str, FurnitureClass]
    relations: Mapping[str, RelationProperties]
    features: frozenset[str]
    labels: Mapping[str, str]
