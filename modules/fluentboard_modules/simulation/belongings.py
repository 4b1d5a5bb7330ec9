"""Things that lie about on shelves and desks: books, boxes, bottles, screens, plants.

Frames as in `furniture`: standing on z = 0, centred, +x to the front (the spine of a book, the
picture of a screen). Sizes in metres.
"""

from __future__ import annotations

import numpy as np

from fluentboard_modules.simulation.mesh import box, cylinder, lathe, merge
from fluentboard_modules.simulation.scene import Colour, Model

BOOK_COLOURS: tuple[Colour, ...] = (
    (142, 44, 44),
    (38, 70, 120),
    (44, 104, 74),
    (196, 150, 60),
    (88, 60, 110),
    (60, 64, 72),
    (210, 200, 180),
    (186, 96, 48),
)


def book(height: float, depth: float, thickness: float, colour: Colour) -> Model:
    """A book standing upright, its spine towards +x, its thickness along y."""
    sizes = "_".join(str(round(size * 1000)) for size in (height, depth, thickness))
    return Model(f"book_{sizes}", "Book", box(depth, thickness, height), colour)


def book_catalogue(rng: np.random.Generator, count: int = 14) -> tuple[Model, ...]:
    """Books of plausible formats (17 to 29 cm high, 1 to 5 cm thick) to fill shelves with."""
    models: dict[str, Model] = {}
    while len(models) < count:
        height = float(rng.uniform(0.17, 0.27))
        model = book(
            round(height, 3),
            round(height * float(rng.uniform(0.62, 0.75)), 3),
            round(float(rng.uniform(0.012, 0.05)), 3),
            BOOK_COLOURS[int(rng.integers(len(BOOK_COLOURS)))],
        )
        models.setdefault(model.name, model)
    return tuple(models.values())


def carton(
    x_size: float = 0.2, y_size: float = 0.3, z_size: float = 0.15, colour: Colour = (184, 148, 104)
) -> Model:
    """A closed cardboard box."""
    sizes = "_".join(str(round(size * 1000)) for size in (x_size, y_size, z_size))
    return Model(f"carton_{sizes}", "Box", box(x_size, y_size, z_size), colour)


def bottle(height: float = 0.27, colour: Colour = (52, 96, 60)) -> Model:
    """A bottle."""
    shape = [(0.036, 0.0), (0.038, 0.03), (0.038, 0.6), (0.015, 0.78), (0.014, 1.0)]
    profile = [(0.0, 0.0), *((r, z * height) for r, z in shape), (0.0, height)]
    return Model(f"bottle_{round(height * 1000)}", "Bottle", lathe(profile), colour)


def screen(width: float = 0.54, height: float = 0.46, colour: Colour = (40, 42, 46)) -> Model:
    """A computer screen on its stand, its picture towards +x."""
    panel = 0.62 * width
    parts = [
        box(0.03, width, panel, (0.0, 0.0, height - panel)),
        box(0.03, 0.06, height - panel, (-0.025, 0.0, 0.012)),
        box(0.18, 0.24, 0.012, (-0.02, 0.0, 0.0)),
    ]
    return Model(f"screen_{round(width * 1000)}", "Screen", merge(parts), colour)


def keyboard(width: float = 0.44, colour: Colour = (60, 62, 68)) -> Model:
    """A keyboard, its keys' lower edge towards +x."""
    return Model(f"keyboard_{round(width * 1000)}", "Keyboard", box(0.14, width, 0.022), colour)


def laptop(width: float = 0.33, colour: Colour = (120, 124, 130)) -> Model:
    """An open laptop, its picture towards +x."""
    depth = 0.7 * width
    lid = box(0.008, width, depth).tilted(-0.3).shifted(x=-0.5 * depth, z=0.018)
    mesh = merge([box(depth, width, 0.018), lid])
    return Model(f"laptop_{round(width * 1000)}", "Laptop", mesh, colour)


def plant(height: float = 0.9, colour: Colour = (62, 118, 64)) -> Model:
    """A potted plant for the floor: a pot and a bush of turned crowns."""
    pot = lathe([(0.0, 0.0), (0.11, 0.0), (0.15, 0.28), (0.13, 0.28), (0.12, 0.25), (0.0, 0.25)])
    crown = [
        (0.0, 0.25),
        (0.03, 0.3),
        (0.2, 0.3 + 0.25 * (height - 0.3)),
        (0.24, 0.3 + 0.5 * (height - 0.3)),
        (0.15, 0.3 + 0.85 * (height - 0.3)),
        (0.0, height),
    ]
    mesh = merge([pot, lathe(crown, 14)])
    return Model(f"plant_{round(height * 1000)}", "Plant", mesh, colour)


def waste_bin(height: float = 0.32, colour: Colour = (70, 72, 76)) -> Model:
    """A waste-paper bin."""
    profile = [
        (0.0, 0.0),
        (0.1, 0.0),
        (0.14, height),
        (0.132, height),
        (0.094, 0.01),
        (0.0, 0.01),
    ]
    return Model(f"waste_bin_{round(height * 1000)}", "WasteBin", lathe(profile), colour)


def candle(height: float = 0.09, colour: Colour = (236, 226, 196)) -> Model:
    """A pillar candle."""
    return Model(f"candle_{round(height * 1000)}", "Candle", cylinder(0.03, height, 28), colour)
