"""Parametric furniture: boxes and turned legs with the sizes of real furniture.

Every model stands on z = 0 with its footprint centred on the origin, and faces +x: the open side of
a shelf, the user's side of a desk, the way a sitter looks. Sizes are metres; `width` runs along y,
`depth` along x. The default sizes lie in the usual ranges: dining table 0.71 to 0.76 m high, desk
the same, counter 0.86 to 0.99 m, chair seat 0.38 to 0.48 m, bookshelf 0.30 to 0.35 m per board.
"""

from __future__ import annotations

import math

from fluentboard.errors import InvalidGeometry
from fluentboard_modules.simulation.mesh import Mesh, box, cylinder, merge
from fluentboard_modules.simulation.scene import Colour, Model, Support

BEECH: Colour = (201, 164, 116)
WALNUT: Colour = (128, 90, 62)
WHITE_LACQUER: Colour = (226, 224, 216)
RED_CHAIR: Colour = (170, 62, 52)


def _model_name(kind: str, *sizes_m: float) -> str:
    return kind + "".join(f"_{round(size * 1000)}" for size in sizes_m)


def table(
    width: float = 1.4,
    depth: float = 0.8,
    height: float = 0.74,
    top: float = 0.03,
    leg: float = 0.06,
    apron: float = 0.08,
    colour: Colour = BEECH,
) -> Model:
    """A dining table: a board on four legs, with an apron under its edge."""
    if min(width, depth) < 4.0 * leg or height < top + apron + 0.1:
        raise InvalidGeometry(
            f"a table of {width} x {depth} x {height} m is too small for legs of {leg} m and an "
            f"apron of {apron} m"
        )
    under = height - top
    inset = 0.5 * leg + 0.02
    x_leg, y_leg = 0.5 * depth - inset, 0.5 * width - inset
    parts = [box(depth, width, top, (0.0, 0.0, under))]
    parts += [
        box(leg, leg, under, (sx * x_leg, sy * y_leg, 0.0)) for sx in (-1, 1) for sy in (-1, 1)
    ]
    if apron > 0.0:
        z = under - apron
        parts += [box(0.02, 2.0 * y_leg - leg, apron, (s * x_leg, 0.0, z)) for s in (-1, 1)]
        parts += [box(2.0 * x_leg - leg, 0.02, apron, (0.0, s * y_leg, z)) for s in (-1, 1)]
    return Model(
        _model_name("table", width, depth, height),
        "Table",
        merge(parts),
        colour,
        (Support("top", 0.0, 0.0, height, depth, width),),
    )


def round_table(diameter: float = 0.9, height: float = 0.74, colour: Colour = BEECH) -> Model:
    """A café table: a round board on a column with a foot."""
    top, foot = 0.03, 0.03
    parts = [
        cylinder(0.5 * diameter, top, 48).shifted(z=height - top),
        cylinder(0.035, height - top - foot, 20).shifted(z=foot),
        cylinder(0.28 * diameter, foot, 40),
    ]
    side = 0.78 * diameter  # a little more than the inscribed square; its corners stay unused
    return Model(
        _model_name("round_table", diameter, height),
        "Table",
        merge(parts),
        colour,
        (Support("top", 0.0, 0.0, height, side, side),),
    )


def desk(
    width: float = 1.6,
    depth: float = 0.8,
    height: float = 0.73,
    colour: Colour = WHITE_LACQUER,
) -> Model:
    """A desk: a board on two side panels, a back panel, and a pedestal of drawers on the left."""
    top, panel = 0.025, 0.03
    under = height - top
    pedestal = 0.42
    y_panel = 0.5 * (width - panel)
    parts = [
        box(depth, width, top, (0.0, 0.0, under)),
        box(depth - 0.04, panel, under, (0.0, -y_panel, 0.0)),
        box(depth - 0.04, panel, under, (0.0, y_panel, 0.0)),
        box(0.02, width - 2.0 * panel, 0.4, (0.05 - 0.5 * depth, 0.0, under - 0.4)),
        # The body starts in front of the back panel and ends behind the drawer fronts.
        box(depth - 0.16, pedestal, under - 0.06, (0.0, y_panel - 0.5 * (panel + pedestal), 0.05)),
    ]
    y_front = y_panel - 0.5 * (panel + pedestal)
    x_front = 0.5 * (depth - 0.16) + 0.01
    drawer = (under - 0.08) / 3.0
    parts += [
        box(0.018, pedestal - 0.02, drawer - 0.012, (x_front, y_front, 0.055 + k * drawer))
        for k in range(3)
    ]
    return Model(
        _model_name("desk", width, depth, height),
        "Desk",
        merge(parts),
        colour,
        (Support("top", 0.0, 0.0, height, depth, width),),
    )


def counter(
    width: float = 1.8,
    depth: float = 0.65,
    height: float = 0.92,
    colour: Colour = WALNUT,
) -> Model:
    """A counter: a closed body on a plinth under an overhanging board."""
    top, plinth = 0.04, 0.1
    body = height - top - plinth
    doors = max(1, round(width / 0.6))
    step = (width - 0.04) / doors
    parts = [
        box(depth - 0.14, width - 0.08, plinth, (-0.02, 0.0, 0.0)),
        box(depth - 0.08, width - 0.04, body, (0.0, 0.0, plinth)),
        box(depth, width, top, (0.0, 0.0, height - top)),
    ]
    parts += [
        box(
            0.018,
            step - 0.012,
            body - 0.02,
            (0.5 * (depth - 0.08) + 0.009, (k + 0.5) * step - 0.5 * (width - 0.04), plinth + 0.01),
        )
        for k in range(doors)
    ]
    return Model(
        _model_name("counter", width, depth, height),
        "Counter",
        merge(parts),
        colour,
        (Support("top", 0.0, 0.0, height, depth, width),),
    )


def chair(
    seat_height: float = 0.45,
    width: float = 0.42,
    depth: float = 0.42,
    height: float = 0.88,
    recline_rad: float = 0.09,
    slats: int = 0,
    colour: Colour = RED_CHAIR,
) -> Model:
    """A chair without arms: seat, four legs, and a back of one panel or of `slats` slats."""
    seat, leg = 0.035, 0.035
    if height < seat_height + 0.2:
        raise InvalidGeometry(
            f"a chair {height} m high has no room for a back above a seat at {seat_height} m"
        )
    x_leg, y_leg = 0.5 * (depth - leg), 0.5 * (width - leg)
    under = seat_height - seat
    parts = [box(depth, width, seat, (0.0, 0.0, under))]
    parts += [
        box(leg, leg, under, (sx * x_leg, sy * y_leg, 0.0)) for sx in (-1, 1) for sy in (-1, 1)
    ]
    # The back is built upright on the seat's rear edge and then reclined about that edge.
    rise = (height - seat_height) / math.cos(recline_rad)
    post = [box(leg, leg, rise, (0.0, s * y_leg, 0.0)) for s in (-1, 1)]
    inner = width - 2.0 * leg
    if slats > 0:
        gap = rise / (2.0 * slats + 1.0)
        back = [box(0.015, inner, gap, (0.0, 0.0, (2 * k + 1) * gap)) for k in range(slats)]
    else:
        back = [box(0.018, inner, rise - 0.14, (0.0, 0.0, 0.12))]
    parts += [part.tilted(-recline_rad).shifted(x=-x_leg, z=seat_height) for part in (*post, *back)]
    return Model(
        _model_name(f"chair{slats or ''}", seat_height, width, depth, height),
        "Chair",
        merge(parts),
        colour,
        (Support("seat", 0.02, 0.0, seat_height, depth - 0.08, width - 0.04, 0.5),),
    )


def shelf(
    width: float = 0.9,
    depth: float = 0.38,
    height: float = 1.75,
    compartments: int = 5,
    colour: Colour = WALNUT,
) -> Model:
    """A bookshelf, open towards +x: two sides, a back, and boards with equal spacing."""
    board, plinth = 0.02, 0.06
    spacing = (height - plinth - board) / compartments
    if compartments < 1 or spacing < 0.1:
        raise InvalidGeometry(
            f"a shelf {height} m high cannot have {compartments} compartments of {spacing:.2f} m"
        )
    inner = width - 2.0 * board
    y_side = 0.5 * (width - board)
    parts = [
        box(depth, board, height, (0.0, -y_side, 0.0)),
        box(depth, board, height, (0.0, y_side, 0.0)),
        box(0.008, inner, height - plinth, (0.004 - 0.5 * depth, 0.0, plinth)),
        box(0.02, inner, plinth, (0.5 * depth - 0.03, 0.0, 0.0)),
    ]
    supports: list[Support] = []
    for k in range(compartments + 1):
        z = plinth + k * spacing
        # The boards butt against the back instead of running through it.
        parts.append(box(depth - 0.008, inner, board, (0.004, 0.0, z)))
        free = spacing - board if k < compartments else 2.0
        supports.append(Support(f"board{k + 1}", 0.004, 0.0, z + board, depth - 0.008, inner, free))
    return Model(
        _model_name("shelf", width, depth, height, compartments),
        "Shelf",
        merge(parts),
        colour,
        tuple(supports),
    )


def cabinet(
    width: float = 0.8, depth: float = 0.42, height: float = 1.1, colour: Colour = WHITE_LACQUER
) -> Model:
    """A closed cabinet with two doors on a plinth."""
    plinth = 0.07
    parts = [
        box(depth - 0.04, width - 0.02, plinth, (-0.01, 0.0, 0.0)),
        box(depth - 0.02, width, height - plinth, (-0.01, 0.0, plinth)),
    ]
    half = 0.5 * width
    for side in (-1, 1):
        parts.append(
            box(
                0.016,
                half - 0.008,
                height - plinth - 0.016,
                (0.5 * depth - 0.012, side * 0.5 * half, plinth + 0.008),
            )
        )
        parts.append(box(0.02, 0.012, 0.12, (0.5 * depth + 0.006, side * 0.04, 0.55 * height)))
    return Model(
        _model_name("cabinet", width, depth, height),
        "Cabinet",
        merge(parts),
        colour,
        (Support("top", -0.01, 0.0, height, depth - 0.02, width),),
    )


def floor(x_size: float, y_size: float, colour: Colour = (176, 170, 160)) -> Model:
    """A slab whose upper face lies at z = 0."""
    return Model(
        _model_name("floor", x_size, y_size),
        "Floor",
        box(x_size, y_size, 0.05, (0, 0, -0.05)),
        colour,
    )


def wall(
    length: float, height: float = 2.5, thickness: float = 0.1, colour: Colour = (214, 210, 198)
) -> Model:
    """A wall along y, facing +x."""
    mesh: Mesh = box(thickness, length, height)
    return Model(_model_name("wall", length, height, thickness), "Wall", mesh, colour)
