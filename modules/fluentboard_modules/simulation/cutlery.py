"""Cutlery with stout handles and polished heads: what a depth camera cannot tell apart.

Section 4.3.4: forks, knives and spoons "are almost the same size and contain reflective parts, so
only the handle is actually visible". Here all three have the same matt handle, thick enough to rise
above the table in a Kinect's image, and a steel head that gives a Kinect no depth.

Every piece lies on z = 0 with its origin at the middle of its footprint, its head towards +x.
Sizes are metres.
"""

from __future__ import annotations

import math

from fluentboard_modules.simulation.mesh import Mesh, as_one_solid, bar, merge
from fluentboard_modules.simulation.scene import Colour, Model

HANDLE_M = 0.108
"""Length of the handle of a piece of cutlery of 0.20 m."""

HANDLE_COLOURS: tuple[Colour, ...] = ((58, 54, 52), (150, 84, 56), (52, 84, 132), (196, 188, 168))

_USUAL_M = 0.2


def handled_fork(length: float = 0.196, colour: Colour = HANDLE_COLOURS[0]) -> Model:
    """A fork with a matt handle and four polished tines towards +x."""
    half, share, t = 0.5 * length, length / _USUAL_M, 0.003
    root, shoulder = half - 0.062 * share, half - 0.044 * share
    neck = bar(
        [
            (-half + 0.9 * HANDLE_M * share, 0.008, 0.008, t),
            (root - 0.01, 0.013, 0.007, t),
            (root, 0.007, 0.022, t),
            (shoulder, 0.001, 0.025, t),
        ]
    )
    tips = [(shoulder, 0.001, 0.004, t), (half - 0.015, 0.006, 0.0036, t), (half, 0.013, 0.002, t)]
    tines = [bar(tips, y) for y in (-0.0105, -0.0035, 0.0035, 0.0105)]
    return _handled("fork", "Fork", length, colour, [neck, *tines])


def handled_spoon(length: float = 0.196, colour: Colour = HANDLE_COLOURS[0]) -> Model:
    """A spoon with a matt handle and a polished bowl towards +x."""
    half, share, t = 0.5 * length, length / _USUAL_M, 0.003
    bowl_length = 0.06 * share
    start = half - bowl_length
    stations = [
        (-half + 0.9 * HANDLE_M * share, 0.008, 0.008, t),
        (start - 0.004, 0.015, 0.007, t),
    ]
    for part in (0.12, 0.3, 0.5, 0.7, 0.88, 1.0):
        width = 0.04 * share * math.sqrt(max(1.0 - (2.0 * part - 1.0) ** 2, 0.03))
        depth = 0.014 * (2.0 * part - 1.0) ** 2
        stations.append((start + part * bowl_length, depth, max(width, 0.008), t))
    return _handled("spoon", "Spoon", length, colour, [bar(stations)])


def handled_knife(length: float = 0.205, colour: Colour = HANDLE_COLOURS[0]) -> Model:
    """A knife with a matt handle and a polished blade towards +x."""
    half, share = 0.5 * length, length / _USUAL_M
    blade = bar(
        [
            (-half + 0.9 * HANDLE_M * share, 0.004, 0.014, 0.003),
            (-half + 1.1 * HANDLE_M * share, 0.002, 0.019, 0.003),
            (half - 0.02, 0.002, 0.02, 0.002),
            (half, 0.002, 0.006, 0.002),
        ]
    )
    return _handled("knife", "Knife", length, colour, [blade])


def _handled(name: str, cls: str, length: float, colour: Colour, head: list[Mesh]) -> Model:
    """A handle and a head; the triangles of the head come first and are polished."""
    half, share = 0.5 * length, length / _USUAL_M
    handle = bar(
        [
            (-half, 0.001, 0.014, 0.012),
            (-half + 0.012 * share, 0.0, 0.02, 0.017),
            (-half + 0.06 * share, 0.0, 0.021, 0.018),
            (-half + HANDLE_M * share, 0.001, 0.015, 0.014),
        ]
    )
    polished = sum(len(part.triangles) for part in head)
    mesh = merge([*head, handle])
    low, high = mesh.bounds
    centred = mesh.shifted(-0.5 * (low[0] + high[0]), -0.5 * (low[1] + high[1]), -low[2])
    return Model(
        f"handled_{name}_{round(length * 1000)}",
        cls,
        as_one_solid(centred),
        colour,
        polished=((0, polished),),
    )
