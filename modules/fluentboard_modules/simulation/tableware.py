"""Parametric tableware: turned vessels and bent bars with the sizes of real ones.

Every model stands on z = 0 with its origin at the centre of its footprint and z up. The front, +x,
is the handle of a mug or jug, the tip of a fork, knife or spoon, a face of a table sign. Sizes are
metres.
"""

from __future__ import annotations

import math

import numpy as np

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.simulation.mesh import (
    Mesh,
    as_one_solid,
    bar,
    box,
    lathe,
    merge,
    tube,
)
from fluentboard_modules.simulation.scene import Colour, Model

PORCELAIN: Colour = (238, 236, 228)
STEEL: Colour = (176, 182, 190)


def _arc(x: float, z: float, x_radius: float, z_radius: float, points: int = 11) -> FloatArray:
    """Half an ellipse from the top to the bottom, bulging towards +x."""
    angle = np.linspace(0.5 * math.pi, -0.5 * math.pi, points)
    return np.stack(
        [x + x_radius * np.cos(angle), np.zeros(points), z + z_radius * np.sin(angle)], axis=1
    )


def plate(diameter: float = 0.26, height: float = 0.024, colour: Colour = PORCELAIN) -> Model:
    """A dinner plate with a raised rim."""
    r, t = 0.5 * diameter, 0.005
    profile = [
        (0.0, 0.0),
        (0.58 * r, 0.0),
        (0.66 * r, 0.35 * height),
        (r, height - 0.5 * t),
        (r, height),
        (0.68 * r, 0.35 * height + t),
        (0.6 * r, t),
        (0.0, t),
    ]
    return Model(f"plate_{round(diameter * 1000)}", "Plate", lathe(profile, 48), colour)


def bowl(diameter: float = 0.16, height: float = 0.06, colour: Colour = PORCELAIN) -> Model:
    """A bowl."""
    r, t = 0.5 * diameter, 0.005
    outside = [(0.4 * r, 0.0), (0.7 * r, 0.25 * height), (0.92 * r, 0.65 * height), (r, height)]
    inside = [(radius - t, z + t) for radius, z in reversed(outside[:-1])]
    profile = [(0.0, 0.0), *outside, (r - t, height), *inside, (0.0, t)]
    return Model(f"bowl_{round(diameter * 1000)}", "Bowl", lathe(profile, 44), colour)


def mug(diameter: float = 0.082, height: float = 0.095, colour: Colour = (52, 92, 158)) -> Model:
    """A mug with its handle at +x."""
    r, t = 0.5 * diameter, 0.004
    profile = [
        (0.0, 0.0),
        (0.9 * r, 0.0),
        (r, 0.008),
        (r, height),
        (r - t, height),
        (r - t, 0.008),
        (0.0, 0.008),
    ]
    handle = tube(_arc(r - 0.002, 0.52 * height, 0.028, 0.3 * height), 0.005)
    mesh = merge([lathe(profile), handle])
    return Model(f"mug_{round(diameter * 1000)}_{round(height * 1000)}", "Mug", mesh, colour)


def jug(height: float = 0.21, colour: Colour = (92, 96, 104)) -> Model:
    """A coffee jug with its handle at +x and its spout at -x."""
    profile = [
        (0.0, 0.0),
        (0.055, 0.0),
        (0.064, 0.12 * height),
        (0.066, 0.45 * height),
        (0.048, 0.8 * height),
        (0.046, 0.93 * height),
        (0.04, 0.94 * height),
        (0.012, 0.96 * height),
        (0.012, height),
        (0.0, height),
    ]
    handle = tube(_arc(0.05, 0.55 * height, 0.055, 0.28 * height), 0.008, 12)
    spout = tube(
        [(-0.055, 0.0, 0.55 * height), (-0.075, 0.0, 0.75 * height), (-0.098, 0.0, 0.92 * height)],
        0.01,
        10,
    )
    return Model(
        f"jug_{round(height * 1000)}", "Jug", merge([lathe(profile), handle, spout]), colour
    )


def sugar_pot(height: float = 0.095, colour: Colour = (206, 146, 128)) -> Model:
    """A sugar pot: a round body under a lid with a knob."""
    profile = [
        (0.0, 0.0),
        (0.03, 0.0),
        (0.047, 0.3 * height),
        (0.045, 0.6 * height),
        (0.04, 0.68 * height),
        (0.043, 0.7 * height),
        (0.03, 0.8 * height),
        (0.008, 0.86 * height),
        (0.011, 0.95 * height),
        (0.0, height),
    ]
    return Model(f"sugar_pot_{round(height * 1000)}", "SugarPot", lathe(profile), colour)


def milk_pot(height: float = 0.11, colour: Colour = (232, 222, 190)) -> Model:
    """A small open milk pot with its handle at +x and its lip at -x."""
    t = 0.004
    outside = [(0.026, 0.0), (0.037, 0.28 * height), (0.03, 0.72 * height), (0.034, height)]
    inside = [(radius - t, z + 2.0 * t) for radius, z in reversed(outside[:-1])]
    profile = [(0.0, 0.0), *outside, (0.034 - t, height), *inside, (0.0, 2.0 * t)]
    handle = tube(_arc(0.03, 0.56 * height, 0.026, 0.27 * height), 0.0045)
    lip = box(0.022, 0.018, 0.012, (-0.04, 0.0, height - 0.013))
    mesh = merge([lathe(profile), handle, lip])
    return Model(f"milk_pot_{round(height * 1000)}", "MilkPot", mesh, colour)


def pepper_mill(height: float = 0.22, colour: Colour = (96, 58, 38)) -> Model:
    """A turned wooden pepper mill."""
    shape = [
        (0.028, 0.0),
        (0.03, 0.03),
        (0.026, 0.1),
        (0.018, 0.4),
        (0.025, 0.64),
        (0.019, 0.68),
        (0.027, 0.73),
        (0.028, 0.82),
        (0.016, 0.91),
        (0.009, 0.925),
        (0.011, 0.96),
        (0.0, 1.0),
    ]
    profile = [(0.0, 0.0), *((radius, share * height) for radius, share in shape)]
    return Model(f"pepper_mill_{round(height * 1000)}", "PepperMill", lathe(profile), colour)


def table_sign(
    width: float = 0.12, height: float = 0.13, colour: Colour = (244, 232, 120)
) -> Model:
    """A tent card: two leaning leaves that show their faces to +x and -x."""
    lean, t = 0.3, 0.003
    leaf = box(t, width, height / math.cos(lean))
    reach = height * math.tan(lean)
    leaves = [
        leaf.tilted(-lean).shifted(x=reach),
        leaf.tilted(lean).shifted(x=-reach),
    ]
    mesh = merge(leaves)
    # Tilting lowers one bottom edge by a hair; the card must stand on z = 0.
    mesh = as_one_solid(mesh.shifted(z=-float(mesh.bounds[0, 2])))
    return Model(f"table_sign_{round(width * 1000)}", "TableSign", mesh, colour)


def fork(length: float = 0.19, colour: Colour = STEEL) -> Model:
    """A dinner fork lying on its back, four tines towards +x."""
    half, t = 0.5 * length, 0.003
    head = half - 0.062
    parts: list[Mesh] = [
        bar(
            [
                (-half, 0.001, 0.018, t),
                (-0.35 * half, 0.006, 0.013, t),
                (head - 0.022, 0.015, 0.007, t),
                (head, 0.007, 0.022, t),
                (head + 0.018, 0.001, 0.025, t),
            ]
        ),
    ]
    tips = [
        (head + 0.018, 0.001, 0.004, t),
        (half - 0.015, 0.006, 0.0036, t),
        (half, 0.014, 0.002, t),
    ]
    parts += [bar(tips, y) for y in (-0.0105, -0.0035, 0.0035, 0.0105)]
    return _lying("fork", "Fork", parts, length, colour)


def spoon(length: float = 0.19, colour: Colour = STEEL) -> Model:
    """A table spoon lying on its back, its bowl towards +x."""
    half, t = 0.5 * length, 0.003
    bowl_length = 0.062
    start = half - bowl_length
    stations = [(-half, 0.002, 0.019, t), (-0.35 * half, 0.008, 0.013, t), (start, 0.018, 0.008, t)]
    for share in (0.12, 0.28, 0.45, 0.62, 0.78, 0.9, 0.98, 1.0):
        width = 0.042 * math.sqrt(max(1.0 - (2.0 * share - 1.0) ** 2, 0.02))
        depth = 0.018 * (2.0 * share - 1.0) ** 2
        stations.append((start + share * bowl_length, 0.8 * depth, max(width, 0.008), t))
    return _lying("spoon", "Spoon", [bar(stations)], length, colour)


def knife(length: float = 0.21, colour: Colour = STEEL) -> Model:
    """A dinner knife lying flat, its blade towards +x."""
    half = 0.5 * length
    stations = [
        (-half, 0.0, 0.016, 0.009),
        (-0.05 * length, 0.0, 0.014, 0.009),
        (0.0, 0.001, 0.012, 0.005),
        (0.02 * length, 0.002, 0.019, 0.003),
        (0.42 * length, 0.002, 0.021, 0.002),
        (half, 0.002, 0.006, 0.002),
    ]
    return _lying("knife", "Knife", [bar(stations)], length, colour)


def _lying(name: str, cls: str, parts: list[Mesh], length: float, colour: Colour) -> Model:
    mesh = merge(parts)
    low, high = mesh.bounds
    centred = mesh.shifted(-0.5 * (low[0] + high[0]), -0.5 * (low[1] + high[1]), -low[2])
    return Model(f"{name}_{round(length * 1000)}", cls, as_one_solid(centred), colour)
