"""A plan of the room from above: what mapping believes is where."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path as Outline
from shapely.geometry import MultiPolygon

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.mapping.furniture_item import FurnitureItem
from fluentboard_modules.mapping.picture_style import (
    BACKGROUND,
    INK,
    LABEL_COLOURS,
    PAPER,
    UNKNOWN,
    class_colour,
    explaining_planes,
    main_label,
    words,
)
from fluentboard_modules.mapping.planar_region import PlanarRegion


def draw_plan(
    planes: Sequence[PlanarRegion],
    labels: Sequence[frozenset[str]],
    furniture: Sequence[FurnitureItem],
    *,
    path_map: FloatArray | None = None,
    title: str = "",
) -> Figure:
    """The room from above: planes coloured by label, furniture as named boxes.

    Planes that explain a piece of furniture are drawn in full colour, other labelled planes pale.

    Args:
        planes: of the map, from `FurnitureMap.classified_planes`.
        labels: the classes of each plane.
        furniture: pieces to outline and name; if there are none, all planes are in full colour.
        path_map: `(n, 3)`; where the camera was, in order.
        title: above the picture.
    """
    low, high = _extent(planes, furniture, path_map)
    width, height = high - low
    figure = Figure(
        figsize=(9.0, float(np.clip(7.0 * height / width + 1.0, 3.5, 9.0))),
        dpi=130,
        facecolor=PAPER,
        layout="constrained",
    )
    axes = figure.add_subplot()
    axes.set_facecolor(PAPER)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    explaining = explaining_planes(furniture)
    used: dict[str, str] = {}
    for index in sorted(range(len(planes)), key=lambda k: planes[k].height_m):
        label = main_label(labels[index])
        strength = _strength(label, planes[index], explaining)
        if label is not None and strength > 0.5:
            used[label] = LABEL_COLOURS[label]
        _draw_plane_from_above(axes, planes[index], label, strength)
    if path_map is not None and len(path_map):
        axes.plot(path_map[:, 0], path_map[:, 1], color=INK, linewidth=1.0, alpha=0.55, zorder=8)
        axes.plot(*path_map[-1, :2], marker="o", color=INK, markersize=4, zorder=8)
    for item in furniture:
        _draw_item_from_above(axes, item)
    _finish_plan(axes, title)
    _draw_legend(axes, used, path_map is not None)
    return figure


def _strength(label: str | None, plane: PlanarRegion, explaining: set[int] | None) -> float:
    """How strongly to draw a plane, from 0 to 1."""
    if label is None:
        return 0.3
    if label in BACKGROUND or explaining is None or plane.index in explaining:
        return 0.9
    return 0.35


def _extent(
    planes: Sequence[PlanarRegion],
    furniture: Sequence[FurnitureItem],
    path_map: FloatArray | None,
) -> tuple[FloatArray, FloatArray]:
    """Lower left and upper right corner `(2,)` of what is worth showing, in the map."""
    points = [plane.outline_map()[:, :2] for plane in planes if plane.area_m2 > 0.1]
    points += [item.box.corners()[:, :2] for item in furniture]
    if path_map is not None and len(path_map):
        points.append(path_map[:, :2])
    if not points:
        return np.array([-1.0, -1.0]), np.array([1.0, 1.0])
    everything = np.concatenate(points)
    return everything.min(axis=0) - 0.3, everything.max(axis=0) + 0.3


def _draw_legend(axes: Axes, used: dict[str, str], with_camera: bool) -> None:
    handles: list[Patch | Line2D] = []
    drawn: set[str] = set()
    for label, colour in LABEL_COLOURS.items():
        if label in used and colour not in drawn:
            drawn.add(colour)
            handles.append(Patch(facecolor=colour, edgecolor="none", label=words(label)))
    if with_camera:
        handles.append(Line2D([], [], color=INK, alpha=0.55, label="camera"))
    if not handles:
        return
    legend = axes.legend(
        handles=handles,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.1),
        frameon=False,
        ncols=min(len(handles), 6),
        handlelength=1.2,
        columnspacing=1.4,
    )
    for text in legend.get_texts():
        text.set_color(INK)


def _draw_plane_from_above(
    axes: Axes, plane: PlanarRegion, label: str | None, strength: float
) -> None:
    colour = UNKNOWN if label is None else LABEL_COLOURS[label]
    low, high = plane.bounds_map()
    if label is None and (high - low)[:2].max() < 0.25:
        return  # clutter
    if abs(plane.normal[2]) < 0.5:
        # From above an upright plane is a line along its own x axis.
        x_min, _, x_max, _ = plane.contour.bounds
        ends = plane.T_map_region.apply(np.array([[x_min, 0.0, 0.0], [x_max, 0.0, 0.0]]))
        axes.plot(
            ends[:, 0],
            ends[:, 1],
            color=colour,
            linewidth=4.0 if strength > 0.5 else 1.2,
            alpha=max(strength, 0.5),
            solid_capstyle="butt",
            zorder=6 if strength > 0.5 else 3,
        )
        return
    outline = _outline_path(plane.footprint())
    if outline is not None:
        height = float(np.clip(plane.height_m, 0.0, 3.0))
        axes.add_patch(
            PathPatch(
                outline,
                facecolor=to_rgba(colour, strength),
                edgecolor=PAPER,
                linewidth=0.6,
                zorder=1.0 if height < 0.1 else 2.0 + height + (strength > 0.5),
            )
        )


def _draw_item_from_above(axes: Axes, item: FurnitureItem) -> None:
    colour = class_colour(item.class_name)
    corners = item.box.corners()[[0, 2, 6, 4, 0], :2]
    axes.plot(corners[:, 0], corners[:, 1], color=colour, linewidth=1.8, zorder=9)
    centre = corners[:4].mean(axis=0)
    if item.placing_area is None:  # it has a front
        front = item.pose.to_transform().rotation[:2, 0]
        reach = 0.5 * item.box.x_size
        axes.annotate(
            "",
            xy=tuple(centre + front * (reach + 0.14)),
            xytext=tuple(centre + front * (reach - 0.02)),
            arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": 1.6},
            zorder=9,
        )
    axes.text(
        *centre,
        f"{item.identifier}\n{100.0 * item.score:.0f} %",
        color=colour,
        fontsize=8,
        fontweight="bold",
        ha="center",
        va="center",
        linespacing=1.05,
        path_effects=[patheffects.withStroke(linewidth=2.5, foreground="white")],
        zorder=11,
    )


def _finish_plan(axes: Axes, title: str) -> None:
    axes.set_aspect("equal")
    axes.grid(color=INK, alpha=0.08, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.set_xlabel("x in the map, m", color=INK)
    axes.set_ylabel("y in the map, m", color=INK)
    axes.tick_params(colors=INK, length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.set_title(title, color=INK, loc="left", fontsize=12, fontweight="bold")


def _outline_path(shape: MultiPolygon) -> Outline | None:
    """A shapely area as a path with holes."""
    parts: list[Outline] = []
    for polygon in shape.geoms:
        for ring in (polygon.exterior, *polygon.interiors):
            corners = np.asarray(ring.coords)[:, :2]
            if len(corners) >= 4:
                parts.append(Outline(corners, closed=True))
    return Outline.make_compound_path(*parts) if parts else None
