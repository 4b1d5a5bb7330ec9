"""Furniture of offices and seminar rooms, as the rooms of Section 3.3 held: parametric models.

As in `furniture`, every model stands on z = 0 with its footprint centred on the origin and faces
+x; sizes are metres, `width` runs along y and `depth` along x.
"""

from __future__ import annotations

import math

import numpy as np

from fluentboard_modules.simulation.furniture import BEECH, WHITE_LACQUER
from fluentboard_modules.simulation.mesh import Mesh, bar, box, cylinder, merge
from fluentboard_modules.simulation.scene import Colour, Model, Support

CHARCOAL: Colour = (62, 64, 70)
BLUE_FABRIC: Colour = (52, 78, 128)


def l_desk(
    width: float = 1.8,
    depth: float = 0.8,
    wing: float = 1.7,
    wing_depth: float = 0.6,
    height: float = 0.73,
    colour: Colour = WHITE_LACQUER,
) -> Model:
    """An L-shaped desk; the user sits in its angle and looks at the long board's back, to -x.

    Args:
        width: of the long board, along y.
        depth: of the long board, along x.
        wing: how far the wing on the user's left reaches to the front, from the back edge.
        wing_depth: of the wing, along y.
        height: of the top.
        colour: of all of it.
    """
    top, panel = 0.025, 0.03
    under = height - top
    back, side = -0.5 * wing, 0.5 * width
    x_board, x_wing = back + 0.5 * depth, back + depth + 0.5 * (wing - depth)
    # A user who looks to -x has +y at the right, -y at the left.
    y_wing = -side + 0.5 * wing_depth
    parts = [
        box(depth, width, top, (x_board, 0.0, under)),
        box(wing - depth, wing_depth, top, (x_wing, y_wing, under)),
        box(depth - 0.04, panel, under, (x_board, side - 0.5 * panel, 0.0)),
        box(panel, wing_depth - 0.04, under, (0.5 * wing - 0.5 * panel, y_wing, 0.0)),
        box(0.02, width - 2.0 * panel, 0.4, (back + 0.05, 0.0, under - 0.4)),
        box(0.05, 0.05, under, (back + 0.06, -side + 0.06, 0.0)),
        box(0.55, 0.42, 0.58, (0.5 * wing - panel - 0.3, y_wing, 0.03)),
    ]
    return Model(
        f"l_desk_{round(width * 1000)}_{round(wing * 1000)}_{round(height * 1000)}",
        "Desk",
        merge(parts),
        colour,
        (
            Support("top", x_board, 0.0, height, depth, width),
            Support("wing", x_wing, y_wing, height, wing - depth, wing_depth),
        ),
    )


def office_chair(seat_height: float = 0.47, colour: Colour = CHARCOAL) -> Model:
    """A swivel chair: a star of five feet on castors, a column, a seat, a back and two arms."""
    parts: list[Mesh] = []
    for k in range(5):
        angle = 2.0 * math.pi * k / 5.0
        foot = bar([(0.03, 0.07, 0.05, 0.04), (0.3, 0.055, 0.035, 0.03)]).turned(angle)
        castor = cylinder(0.025, 0.055, 12)
        x, y = 0.29 * math.cos(angle), 0.29 * math.sin(angle)
        parts += [foot, castor.shifted(x, y)]
    parts.append(cylinder(0.03, seat_height - 0.15, 16).shifted(z=0.08))
    parts.append(box(0.46, 0.48, 0.07, (0.0, 0.0, seat_height - 0.07)))
    parts.append(box(0.03, 0.08, 0.3, (-0.24, 0.0, seat_height - 0.05)))
    parts.append(
        box(0.05, 0.44, 0.48, (0.0, 0.0, 0.0)).tilted(-0.1).shifted(x=-0.22, z=seat_height + 0.12)
    )
    for side in (-1, 1):
        parts.append(box(0.05, 0.03, 0.27, (0.0, side * 0.265, seat_height - 0.07)))
        parts.append(box(0.26, 0.06, 0.03, (0.0, side * 0.265, seat_height + 0.19)))
    mesh = merge(parts)
    low, high = mesh.bounds
    centred = mesh.shifted(-0.5 * (low[0] + high[0]), -0.5 * (low[1] + high[1]), -low[2])
    return Model(f"office_chair_{round(seat_height * 1000)}", "Chair", centred, colour)


def conference_chair(seat_height: float = 0.45, colour: Colour = BLUE_FABRIC) -> Model:
    """A stackable chair of steel tube: two sled frames, a seat, and a panel for the back."""
    width, depth, tube = 0.46, 0.44, 0.025
    side, front = 0.5 * width - 0.5 * tube, 0.5 * depth - 0.03
    parts = [box(depth, width - 2.0 * tube, 0.04, (0.0, 0.0, seat_height - 0.04))]
    for y in (-side, side):
        parts.append(box(depth, tube, tube, (0.0, y, 0.0)))
        parts.append(box(tube, tube, seat_height - tube, (front, y, tube)))
        parts.append(box(tube, tube, seat_height - tube, (-front, y, tube)))
        post = box(tube, tube, 0.42).tilted(-0.14).shifted(x=-front, y=y, z=seat_height)
        parts.append(post)
    back = box(0.02, width - 2.0 * tube, 0.3, (0.0, 0.0, 0.11))
    parts.append(back.tilted(-0.14).shifted(x=-front, z=seat_height))
    return Model(
        f"conference_chair_{round(seat_height * 1000)}",
        "Chair",
        merge(parts),
        colour,
        (Support("seat", 0.02, 0.0, seat_height, depth - 0.1, width - 0.1, 0.5),),
    )


def plain_table(
    name: str, width: float, depth: float, height: float, colour: Colour = BEECH
) -> Model:
    """A table without aprons on four legs at its very corners, so that it can stand in rows.

    Args:
        name: what it is for, such as `seminar_table`.
        width: along y.
        depth: along x.
        height: of the top.
        colour: of all of it.
    """
    top, leg = 0.025, 0.045
    x, y = 0.5 * (depth - leg), 0.5 * (width - leg)
    parts = [box(depth, width, top, (0.0, 0.0, height - top))]
    parts += [
        box(leg, leg, height - top, (sx * x, sy * y, 0.0)) for sx in (-1, 1) for sy in (-1, 1)
    ]
    sizes = "_".join(str(round(size * 1000)) for size in (width, depth, height))
    support = Support("top", 0.0, 0.0, height, depth, width)
    return Model(f"{name}_{sizes}", "Table", merge(parts), colour, (support,))


def paper_stack(rng: np.random.Generator) -> Model:
    """A stack of paper or an open folder, flat on a table."""
    x_size, y_size = (round(float(rng.uniform(*r)), 2) for r in ((0.2, 0.24), (0.28, 0.33)))
    height = round(float(rng.uniform(0.008, 0.06)), 3)
    return Model(
        f"papers_{round(height * 1000)}", "Magazine", box(x_size, y_size, height), (236, 234, 226)
    )
