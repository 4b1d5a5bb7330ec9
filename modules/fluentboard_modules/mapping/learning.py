"""A class of furniture from its CAD model: planes measured, rules and definition written.

Section 3.2.2 reads the numbers of its rules off CAD models by hand and hopes to automate that: this
does. Heights get the thesis's margin of 0.05 m; sizes have generous lower bounds, since planes are
often seen in part only.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.cad_models import ROUND, CadModel

MARGIN_M = 0.05  # Section 3.2.2
_LEVEL_M = 0.02  # faces within this height are one level
_SEEN_SHARE = 0.3  # of a plane, that must be seen at least
_LARGER = 1.3  # outlines are drawn a little too large
_MAIN_SHARE = 0.4  # levels smaller than this share of the largest are no boards
_BACK_RISE_M, _BACK_LEAST_M2 = 0.15, 0.03
_SHELF_BOARDS = 3
_PRIORITY = 60  # above the general classes: a model of one's own says more
_VISIBLE_M = 0.02


@dataclass(frozen=True, slots=True)
class Level:
    """A level face of a model: height above the floor in metres, area in square metres."""

    height_m: float
    area_m2: float


@dataclass(frozen=True, slots=True)
class Shape:
    """What was measured at a model.

    Attributes:
        levels: its level faces that can be seen from above, lowest first.
        back: the upright face that rises behind its largest level, None without one.
        depth_m: from back to front.
        symmetry_order: turns that look alike.
    """

    levels: tuple[Level, ...]
    back: Level | None
    depth_m: float
    symmetry_order: int


def measure_shape(model: CadModel) -> Shape:
    """The planes of a CAD model that tell what it is.

    Raises:
        InvalidInput: it has no level face.
    """
    mesh = model.mesh
    corners = mesh.vertices[mesh.triangles]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(cross, axis=1)
    normal = cross / np.maximum(2.0 * area, 1e-12)[:, None]
    middle = corners.mean(axis=1)
    levels = _levels(model, middle, normal, area)
    if not levels:
        raise InvalidInput(
            f"{model.name}: the model has no level face; give it upright with z up, in metres"
        )
    main = max(levels, key=lambda level: level.area_m2)
    back = None
    if len(levels) < _SHELF_BOARDS:
        back = _back(middle, normal, area, main)
    low, high = mesh.bounds
    order = 2 if model.symmetry_order == ROUND else model.symmetry_order
    return Shape(tuple(levels), back, float(high[0] - low[0]), order)


def learn_furniture(model: CadModel, class_name: str) -> str:
    """The class of a CAD model as Turtle, to be read after the furniture ontology.

    Args:
        model: on the floor, its front along +x.
        class_name: of the new class, such as `BarTable`.

    Raises:
        InvalidInput: the name is none, or the model has no level face.
    """
    if not re.fullmatch(r"[A-Z][A-Za-z0-9]*", class_name):
        raise InvalidInput(f"class name {class_name!r}; give one like BarTable")
    shape = measure_shape(model)
    if shape.back is None and len(shape.levels) >= _SHELF_BOARDS:
        return _HEADER + _shelf(class_name, shape, model.name)
    main = max(shape.levels, key=lambda level: level.area_m2)
    top = f"{class_name}TopPlane"
    text = _label(top, "HorizontalPlane", "The main level face") + _rule(
        top, "HorizontalPlane", main, MARGIN_M, model.name
    )
    if shape.back is None:
        definition = f"    owl:equivalentClass furniture:{top} ;\n"
        extra = "    furniture:hasRoomBelow true ;\n" if main.height_m > 0.5 else ""
    else:
        back = f"{class_name}BackPlane"
        text += _label(back, "VerticalPlane", "The upright face behind the main one")
        # Of a back that is hidden in part, the middle of what is seen is somewhere on it.
        reach = 0.25 * shape.back.area_m2**0.5 + MARGIN_M
        text += _rule(back, "VerticalPlane", shape.back, reach, model.name)
        definition = (
            "    owl:equivalentClass [ a owl:Class ; owl:intersectionOf ( furniture:"
            f"{top} [ a owl:Restriction ; owl:onProperty furniture:hasUpright ; "
            f"owl:someValuesFrom furniture:{back} ] ) ] ;\n"
        )
        extra = f"    furniture:backPlane furniture:{back} ;\n"
    return _HEADER + text + _class(class_name, definition, [top], extra, shape, model.name)


def _levels(
    model: CadModel, middle: FloatArray, normal: FloatArray, area: FloatArray
) -> list[Level]:
    up = np.flatnonzero((normal[:, 2] > 0.95) & (area > 1e-6))
    rays = np.zeros((len(up), 6), dtype=np.float32)
    rays[:, :3] = middle[up] + (0.0, 0.0, 1e-4)
    rays[:, 5] = 1.0
    hits = model.caster.cast(rays)
    # A ray that leaves a body began inside it: that part stands on the face and hides it.
    is_inside = model.caster.triangle_normal[hits.triangle, 2] > 0.0
    up = up[~np.isfinite(hits.distance) | (~is_inside & (hits.distance > _VISIBLE_M))]
    found: dict[int, list[int]] = {}
    for face in up.tolist():
        found.setdefault(round(middle[face, 2] / _LEVEL_M), []).append(face)
    levels = [
        Level(float(np.average(middle[faces, 2], weights=area[faces])), float(area[faces].sum()))
        for _, faces in sorted(found.items())
    ]
    largest = max((level.area_m2 for level in levels), default=0.0)
    return [level for level in levels if level.area_m2 >= _MAIN_SHARE * largest]


def _back(middle: FloatArray, normal: FloatArray, area: FloatArray, main: Level) -> Level | None:
    faces = (np.abs(normal[:, 2]) < 0.45) & (normal[:, 0] > 0.5)
    faces &= middle[:, 2] > main.height_m + 0.02
    total = float(area[faces].sum())
    if total < _BACK_LEAST_M2:
        return None
    height = float(np.average(middle[faces, 2], weights=area[faces]))
    return Level(height, total) if height - main.height_m >= _BACK_RISE_M else None


def _shelf(class_name: str, shape: Shape, source: str) -> str:
    boards = shape.levels
    chosen = {
        f"{class_name}LowPlane": boards[:1],
        f"{class_name}MiddlePlane": boards[1:-1],
        f"{class_name}HighPlane": boards[2:],
    }
    text = ""
    for label, levels in chosen.items():
        text += _label(label, "HorizontalPlane", "A board")
        heights = [level.height_m for level in levels]
        span = Level(0.5 * (min(heights) + max(heights)), max(lv.area_m2 for lv in levels))
        reach = 0.5 * (max(heights) - min(heights)) + MARGIN_M
        text += _rule(label, "HorizontalPlane", span, reach, source, least_share=0.03)
    low, middle, high = chosen
    definition = (
        f"    owl:equivalentClass [ a owl:Class ; owl:intersectionOf ( furniture:{low} "
        "[ a owl:Restriction ; owl:onProperty furniture:isBelow ; owl:someValuesFrom "
        f"[ a owl:Class ; owl:intersectionOf ( furniture:{middle} [ a owl:Restriction ; "
        f"owl:onProperty furniture:isBelow ; owl:someValuesFrom furniture:{high} ] ) ] ] ) ] ;\n"
    )
    return text + _class(class_name, definition, [low], "", shape, source)


def _label(name: str, parent: str, what: str) -> str:
    return (
        f"furniture:{name} a owl:Class ;\n    rdfs:subClassOf furniture:{parent} ;\n"
        f'    rdfs:label "{_words(name)}"@en ;\n    rdfs:comment "{what}."@en .\n\n'
    )


def _rule(
    label: str,
    parent: str,
    level: Level,
    margin_m: float,
    source: str,
    least_share: float = _SEEN_SHARE,
) -> str:
    atoms = [
        f"[ a swrl:ClassAtom ; swrl:classPredicate furniture:{parent} ; swrl:argument1 var:p ]",
        *_between("hasSize", "s", least_share * level.area_m2, _LARGER * level.area_m2),
        *_between("hasPosY", "h", level.height_m - margin_m, level.height_m + margin_m),
    ]
    body = "\n        ".join(atoms)
    head = f"[ a swrl:ClassAtom ; swrl:classPredicate furniture:{label} ; swrl:argument1 var:p ]"
    return (
        f"furniture:{label}Rule a swrl:Imp ;\n"
        f'    rdfs:label "{_words(label)} rule"@en ;\n'
        f'    rdfs:comment "Measured at {source}: {level.area_m2:.3f} square metres at '
        f'{level.height_m:.3f} m, plus and minus {margin_m:.2f} m."@en ;\n'
        f"    swrl:body (\n        {body}\n    ) ;\n    swrl:head ( {head} ) .\n\n"
    )


def _between(feature: str, variable: str, low: float, high: float) -> list[str]:
    return [
        f"[ a swrl:DatavaluedPropertyAtom ; swrl:propertyPredicate furniture:{feature} ; "
        f"swrl:argument1 var:p ; swrl:argument2 var:{variable} ]",
        "[ a swrl:BuiltinAtom ; swrl:builtin swrlb:greaterThan ; "
        f"swrl:arguments ( var:{variable} {low:.3f} ) ]",
        "[ a swrl:BuiltinAtom ; swrl:builtin swrlb:lessThan ; "
        f"swrl:arguments ( var:{variable} {high:.3f} ) ]",
    ]


def _class(
    name: str, definition: str, main: list[str], extra: str, shape: Shape, source: str
) -> str:
    planes = " , ".join(f"furniture:{label}" for label in main)
    return (
        f"furniture:{name} a owl:Class ;\n    rdfs:subClassOf furniture:Furniture ;\n"
        f"{definition}    furniture:mainPlane {planes} ;\n{extra}"
        f"    furniture:typicalDepth {shape.depth_m:.2f} ;\n"
        f"    furniture:symmetryOrder {shape.symmetry_order} ;\n"
        f"    furniture:priority {_PRIORITY} ;\n"
        f'    rdfs:label "{_words(name)}"@en ;\n'
        f'    rdfs:comment "Learned from the CAD model {source}."@en .\n'
    )


def _words(name: str) -> str:
    return re.sub(r"(?<!^)(?=[A-Z])", " ", name).lower()


_HEADER = """\
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix swrl: <http://www.w3.org/2003/11/swrl#> .
@prefix swrlb: <http://www.w3.org/2003/11/swrlb#> .
@prefix var: <urn:swrl:var#> .
@prefix furniture: <https://w3id.org/fluentboard/furniture#> .

var:p a swrl:Variable .
var:s a swrl:Variable .
var:h a swrl:Variable .

"""
