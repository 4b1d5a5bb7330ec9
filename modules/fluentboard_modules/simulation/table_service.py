"""Table services: which plate, cutlery, mug and pots a table is laid with."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fluentboard.errors import InvalidInput
from fluentboard_modules.simulation import cutlery, tableware
from fluentboard_modules.simulation.scene import Colour, Model

MUG_COLOURS: tuple[Colour, ...] = ((52, 92, 158), (178, 58, 50), (70, 128, 84), (222, 178, 60))

TABLEWARE_CLASSES = (
    "Plate",
    "Fork",
    "Knife",
    "Spoon",
    "Mug",
    "Jug",
    "SugarPot",
    "MilkPot",
    "TableSign",
)
"""The nine categories of Section 4.3.1; the thesis calls a `Plate` dish and a `Jug` coffee jug."""


@dataclass(frozen=True)
class TableService:
    """The models that a table is laid with.

    Attributes:
        models: by class name.
        mug_colours: a guest's mug gets one of them.
    """

    models: dict[str, Model] = field(default_factory=dict)
    mug_colours: tuple[Colour, ...] = MUG_COLOURS

    def model(self, cls: str) -> Model:
        """The model of a class; plain tableware where the service has none of its own.

        Raises:
            InvalidInput: there is none of that class.
        """
        if cls in self.models:
            return self.models[cls]
        if cls not in _PLAIN:
            raise InvalidInput(f"no model for {cls!r}; tableware is {', '.join(_PLAIN)}")
        return _PLAIN[cls]()


_PLAIN = {
    "Plate": tableware.plate,
    "Fork": tableware.fork,
    "Knife": tableware.knife,
    "Spoon": tableware.spoon,
    "Mug": tableware.mug,
    "TableSign": tableware.table_sign,
    "Jug": tableware.jug,
    "SugarPot": tableware.sugar_pot,
    "MilkPot": tableware.milk_pot,
    "PepperMill": tableware.pepper_mill,
    "Bowl": tableware.bowl,
}


def random_service(rng: np.random.Generator) -> TableService:
    """A service of sizes that vary as those of real tableware do, and of cutlery with handles.

    Pots, mugs and jugs overlap in size, and the three kinds of cutlery are of nearly one length, so
    that size alone does not tell the classes apart.

    Args:
        rng: decides sizes and colours.
    """

    def between(low: float, high: float) -> float:
        return round(float(rng.uniform(low, high)), 3)

    handle = cutlery.HANDLE_COLOURS[int(rng.integers(len(cutlery.HANDLE_COLOURS)))]
    models = (
        tableware.plate(between(0.20, 0.28), between(0.02, 0.03)),
        cutlery.handled_fork(between(0.188, 0.206), handle),
        cutlery.handled_knife(between(0.192, 0.212), handle),
        cutlery.handled_spoon(between(0.186, 0.204), handle),
        tableware.mug(between(0.074, 0.094), between(0.085, 0.115)),
        tableware.jug(between(0.17, 0.24)),
        tableware.sugar_pot(between(0.08, 0.11)),
        tableware.milk_pot(between(0.09, 0.13)),
        tableware.table_sign(between(0.09, 0.13), between(0.1, 0.15)),
    )
    return TableService({model.cls: model for model in models})
