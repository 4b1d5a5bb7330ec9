"""Fluents on a time line: what certainly held, what possibly held, what still holds.

A bar is solid while its fluent certainly holds and fades where its start or finish is uncertain.
An arrow on the left says that it held since before the record began, one on the right that it holds
until further notice.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fluentboard.model.fluent import Fluent

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Colour = str

_INK, _FAINT, _PAPER = "#20262e", "#d5dae0", "#ffffff"
_OTHER_COLOUR = "#7a8594"
_GRADIENT_STEPS = 256
_OBJECT_HEIGHT, _POSE_HEIGHT, _ROW_HEIGHT = 0.44, 0.16, 1.0
_ROW_INCHES = 0.42
_POSE_OPACITIES = (0.62, 0.34)

CLASS_COLOURS: Mapping[str, Colour] = {
    "Table": "#1f8a83",
    "Desk": "#1f8a83",
    "CoffeeTable": "#3f8f74",
    "Counter": "#2f5f9e",
    "Cabinet": "#41699a",
    "Shelf": "#7a56b0",
    "Chair": "#c2394d",
    "Stool": "#c2394d",
    "On": "#b7791f",
    "Holding": "#3b6ea8",
}
"""Colour of a class in all pictures of the demo; classes that are not listed are grey."""


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the picture: a thing and, below it, the poses it had one after the other.

    Attributes:
        thing: the fluent of the thing itself.
        poses: fluents of its poses, oldest first.
    """

    thing: Fluent
    poses: tuple[Fluent, ...] = ()


def rows_of(fluents: Iterable[Fluent], classes: Sequence[str]) -> list[Row]:
    """The rows for all things of some classes, by class in that order and then by number.

    Args:
        fluents: everything on the board, or at least the things and their poses.
        classes: which classes get a row.
    """
    by_name = {fluent.name: fluent for fluent in fluents}
    things = [fluent for fluent in by_name.values() if fluent.class_name in classes]
    things.sort(key=lambda thing: (classes.index(thing.class_name), _natural(thing.name)))
    rows: list[Row] = []
    for thing in things:
        named = [str(value) for value in thing.values("hasPose")]
        poses = [by_name[name] for name in named if name in by_name]
        rows.append(Row(thing, tuple(sorted(poses, key=lambda pose: pose.start_bounds))))
    return rows


def time_span(rows: Sequence[Row], *also_s: float) -> tuple[float, float]:
    """Earliest and latest time that any of the rows names; (0, 1) if none names any.

    Args:
        rows: of the picture.
        also_s: further times to include, such as those of the first and the last frame.
    """
    fluents = [fluent for row in rows for fluent in (row.thing, *row.poses)]
    times = [
        time_s
        for fluent in fluents
        for interval in (fluent.start, fluent.finish)
        for time_s in (interval.earliest, interval.latest)
        if time_s is not None
    ]
    times += also_s
    if not times:
        return 0.0, 1.0
    first, last = min(times), max(times)
    return (first, last) if last > first else (first - 0.5, last + 0.5)


def draw_timeline(
    axes: Axes, rows: Sequence[Row], span_s: tuple[float, float], *, title: str = ""
) -> None:
    """Draws the rows into the axes, the first at the top.

    Args:
        axes: where to.
        rows: what to draw.
        span_s: the part of the time axis that the record covers; arrows lie outside of it.
        title: above the picture.
    """
    first, last = span_s
    margin = 0.045 * (last - first)
    axes.set_xlim(first - margin, last + margin)
    axes.set_ylim(len(rows) * _ROW_HEIGHT - 0.35, -0.75)
    for edge in (first, last):
        axes.axvline(edge, color=_FAINT, linewidth=0.8, zorder=0)
    for number, row in enumerate(rows):
        colour = CLASS_COLOURS.get(row.thing.class_name, _OTHER_COLOUR)
        centre = number * _ROW_HEIGHT
        if number % 2 == 0:
            axes.axhspan(centre - 0.5, centre + 0.5, color="#f5f7f9", zorder=-2, linewidth=0)
        shift = 0.13 if row.poses else 0.0
        _draw_bar(axes, row.thing, centre - shift, _OBJECT_HEIGHT, colour, span_s, margin)
        for index, pose in enumerate(row.poses):
            full = _POSE_OPACITIES[index % 2]  # neighbours must differ
            _draw_bar(axes, pose, centre + 0.27, _POSE_HEIGHT, colour, span_s, margin, full)
    axes.set_yticks(
        [number * _ROW_HEIGHT for number in range(len(rows))],
        [row.thing.name for row in rows],
        fontsize=9.5,
        color=_INK,
    )
    axes.tick_params(axis="y", length=0, pad=6)
    axes.tick_params(axis="x", colors="#5c6773", labelsize=8.5, length=3)
    axes.set_xlabel("time (s)", fontsize=9, color="#5c6773", labelpad=2)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    axes.spines["bottom"].set_color(_FAINT)
    if title:
        axes.set_title(title, loc="left", fontsize=11.5, color=_INK, pad=22, fontweight="bold")
    _draw_legend(axes, with_poses=any(row.poses for row in rows))


def save_timeline(
    rows: Sequence[Row], span_s: tuple[float, float], path: Path, *, title: str = ""
) -> Path:
    """Draws the rows into a picture of their own and returns its path."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 1.5 + _ROW_INCHES * max(len(rows), 1)), dpi=160)
    FigureCanvasAgg(figure)
    figure.set_facecolor(_PAPER)
    draw_timeline(figure.subplots(), rows, span_s, title=title)
    figure.savefig(path, bbox_inches="tight", pad_inches=0.15)
    return path


def _draw_bar(
    axes: Axes,
    fluent: Fluent,
    centre: float,
    height: float,
    colour: Colour,
    span_s: tuple[float, float],
    margin_s: float,
    full: float = 1.0,
) -> None:
    """One fluent: its opacity over time is how far it is certain to hold."""
    first, last = span_s
    s1, s2 = fluent.start_bounds
    f1, f2 = fluent.finish_bounds
    reach = 0.55 * margin_s
    left = max(s1, first - reach)
    right = min(f2, last + reach)
    if right <= left:
        return
    times = left + (np.arange(_GRADIENT_STEPS) + 0.5) / _GRADIENT_STEPS * (right - left)
    held = _rise(times, first if math.isinf(s1) and not math.isinf(s2) else s1, s2)
    over = _rise(times, f1, last if math.isinf(f2) and not math.isinf(f1) else f2)
    strength = np.minimum(held, 1.0 - over)
    least = 0.10 * full
    opacity = np.where(strength >= 1.0, full, least + (0.75 * full - least) * strength)
    _draw_gradient(axes, (left, right), centre, height, colour, opacity)
    certain_from, certain_to = max(s2, left), min(f1, right)
    for begins, ends in ((left, min(s2, right)), (max(f1, left), right)):
        if ends - begins > 1e-9:
            axes.add_patch(_hatching(begins, ends, centre, height, colour))
    if certain_to > certain_from and full == 1.0:
        axes.add_patch(_frame(certain_from, certain_to, centre, height, colour))
    arrow = {"color": colour, "alpha": full, "linewidth": 0, "clip_on": False, "zorder": 4}
    if math.isinf(f2):
        _draw_arrow(axes, right, centre, height, 0.4 * margin_s, arrow)
    if math.isinf(s1) and math.isinf(s2):
        _draw_arrow(axes, left, centre, height, -0.4 * margin_s, arrow)
    elif math.isinf(s1):
        _draw_arrow(axes, left, centre, height, -0.4 * margin_s, arrow | {"alpha": 0.22 * full})


def _rise(times: Any, begins: float, ends: float) -> Any:
    """0 before an uncertain point in time, 1 after it, and a ramp within its interval."""
    if math.isinf(begins) and math.isinf(ends):
        return np.full(times.shape, 1.0 if ends < 0.0 else 0.0)
    if ends <= begins:
        return np.where(times >= begins, 1.0, 0.0)
    if math.isinf(ends):  # may happen at any time from `begins` on
        return np.where(times >= begins, 0.5, 0.0)
    return np.clip((times - begins) / (ends - begins), 0.0, 1.0)


def _draw_gradient(
    axes: Axes,
    span_s: tuple[float, float],
    centre: float,
    height: float,
    colour: Colour,
    opacity: Any,
) -> None:
    from matplotlib.colors import to_rgb

    image = np.zeros((1, opacity.size, 4))
    image[..., :3] = to_rgb(colour)
    image[0, :, 3] = opacity
    axes.imshow(
        image,
        extent=(span_s[0], span_s[1], centre + height / 2, centre - height / 2),
        aspect="auto",
        interpolation="bilinear",
        zorder=2,
    )


def _hatching(begins: float, ends: float, centre: float, height: float, colour: Colour) -> Any:
    """Hatching where a fluent possibly holds."""
    style = {"hatch": "/////", "linewidth": 0.0, "alpha": 0.55}
    return _rectangle(begins, ends, centre, height, colour, **style)


def _frame(begins: float, ends: float, centre: float, height: float, colour: Colour) -> Any:
    return _rectangle(begins, ends, centre, height, colour, linewidth=0.8)


def _rectangle(
    begins: float, ends: float, centre: float, height: float, colour: Colour, **style: Any
) -> Any:
    from matplotlib.patches import Rectangle

    corner = (begins, centre - height / 2)
    return Rectangle(
        corner, ends - begins, height, facecolor="none", edgecolor=colour, zorder=3, **style
    )


def _draw_arrow(
    axes: Axes, tip_s: float, centre: float, height: float, length_s: float, style: dict[str, Any]
) -> None:
    half = 0.5 * height
    axes.fill([tip_s, tip_s, tip_s + length_s], [centre - half, centre + half, centre], **style)


def _draw_legend(axes: Axes, *, with_poses: bool) -> None:
    """Samples above the picture."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    ink = "#5c6773"
    open_end = {"marker": ">", "markersize": 7, "linestyle": "none", "markeredgewidth": 0}
    samples = [
        Patch(facecolor=ink, label="certainly holds"),
        Patch(
            facecolor=ink + "40",
            edgecolor=ink,
            hatch="/////",
            linewidth=0.0,
            label="possibly holds: began or ended some time in there",
        ),
        Line2D([], [], color=ink, label="holds until further notice", **open_end),
    ]
    if with_poses:
        samples.append(Patch(facecolor=ink + "9e", label="thin: its poses"))
    axes.legend(
        handles=samples,
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=4,
        frameon=False,
        fontsize=8,
        handlelength=1.6,
        handleheight=0.9,
        borderaxespad=0.3,
        borderpad=0.0,
        columnspacing=1.4,
        labelcolor="#5c6773",
    )


def _natural(name: str) -> list[int | str]:
    """Sort key under which `chair10` comes after `chair9`."""
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)]
