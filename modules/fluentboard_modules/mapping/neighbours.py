"""Pieces side by side: where one stands, another of its kind often stands next to it.

Section 3.3.1 names aggregates as a failure: shelf segments or tables without a gap melt into one
plane. `verify` explains a plane by several models if it is longer than one. Here the others are
found of which so little is in the image that the plane does not say so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from fluentboard_modules.mapping.alignment import Standing
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.candidates import Candidate, with_verdicts
from fluentboard_modules.mapping.furniture_item import box_overlap
from fluentboard_modules.mapping.verify import Verdict

_TOUCHING = 0.15  # of the footprint: poses are off by as much
_SURE = 0.6  # no plane has hinted at it, so the images must say more than for a hypothesis
_PIECES_MAX = 40  # a row ends somewhere, whatever the images say

Look = Callable[[CadModel, Standing, Candidate], Verdict | None]


def with_neighbours(
    found: Sequence[Candidate],
    models: Callable[[str], CadModel | None],
    look: Look,
    on_found: Callable[[Candidate], None] = lambda _: None,
) -> list[Candidate]:
    """The pieces found, and those that touch one of them.

    Args:
        found: pieces with the CAD models that explain them.
        models: the CAD model of a name, None for made-up ones.
        look: judges a model at a place that a found piece suggests.
        on_found: is told of each further piece.
    """
    pieces = list(found)
    position = 0
    while position < len(pieces) and len(pieces) < _PIECES_MAX:
        piece = pieces[position]
        model = None if piece.fit is None else models(piece.fit.model)
        if model is not None and stands_in_rows(model, piece):
            for standing in places_beside(model, piece):
                verdict = look(model, standing, piece)
                if verdict is None or not verdict.is_accepted or verdict.score < _SURE:
                    continue
                (beside,) = with_verdicts(piece, (verdict,))
                if any(
                    box_overlap(beside.geometry.box, other.geometry.box) > _TOUCHING
                    for other in pieces
                    if other.furniture.name == piece.furniture.name
                ):
                    continue
                pieces.append(replace(beside, is_in_row=True))
                on_found(pieces[-1])
                pieces[position] = piece = replace(piece, is_in_row=True)
        position += 1
    return pieces


def stands_in_rows(model: CadModel, piece: Candidate) -> bool:
    """Whether pieces of this model come side by side: shelves and rectangular tops, not chairs."""
    if piece.fit is None or piece.furniture.back_planes:
        return False
    return bool(piece.furniture.front_planes) or model.fills_its_footprint


def places_beside(model: CadModel, piece: Candidate) -> list[Standing]:
    """Where the same model touches a piece: on both sides, and before and behind if it may."""
    if piece.fit is None:
        return []
    pose = piece.fit.pose
    own = Standing(pose.x, pose.y, pose.yaw_rad)
    low, high = model.mesh.bounds
    depth, width = (high - low)[:2].tolist()
    places = [own.moved(0.0, side * width, 0.0) for side in (-1.0, 1.0)]
    if not piece.furniture.front_planes:  # what has a front needs room before it
        places += [own.moved(side * depth, 0.0, 0.0) for side in (-1.0, 1.0)]
    return places
