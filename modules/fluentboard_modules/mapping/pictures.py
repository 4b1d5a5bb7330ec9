"""Pictures of what mapping believes: a plan of the room, and an overlay on a frame."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path as Outline
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon

from fluentboard.model.geometry import BoundingBox, FloatArray, Transform
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.mapping.furniture_item import FurnitureItem
from fluentboard_modules.mapping.planar_region import PlanarRegion

_INK = "#22303c"
_PAPER = "#fbfaf7"
_UNKNOWN = "#cfd3d8"
# In the order in which a plane with several labels is coloured.
_LABEL_COLOURS = {
    "FloorPlane": "#e9e4d8",
    "TablePlane": "#2a9d8f",
    "DeskPlane": "#2a9d8f",
    "CoffeeTablePlane": "#74c0a5",
    "CounterPlane": "#3a6ea5",
    "ChairSeatPlane": "#d1495b",
    "WallPlane": "#b4bcc6",
    "CabinetFrontPlane": "#9bb8d3",
    "CabinetTopPlane": "#5f8fbf",
    "ChairBackrestPlane": "#f0a35e",
    "ShelfPlane": "#a98bc9",
    "CeilingPlane": "#e3e3e3",
}
_BACKGROUND = ("FloorPlane", "WallPlane", "CeilingPlane")
_CLASS_COLOURS = {
    "Table": "#14746f",
    "Desk": "#14746f",
    "CoffeeTable": "#3f8f74",
    "Counter": "#274c77",
    "Cabinet": "#41699a",
    "Chair": "#b02a3d",
    "Shelf": "#6f4fa0",
}
_SPARE_COLOURS = ("#8a5a44", "#5b8e7d", "#bc4b51", "#7a6c5d", "#4f6d7a")
_NEAR_M = 0.2  # what is nearer to the camera cannot be projected sensibly
_BOX_EDGES = ((0, 1), (0, 2), (0, 4), (1, 3), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 6))
_BOX_EDGES = (*_BOX_EDGES, (5, 7), (6, 7))


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
        facecolor=_PAPER,
        layout="constrained",
    )
    axes = figure.add_subplot()
    axes.set_facecolor(_PAPER)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    explaining = _explaining(furniture)
    used: dict[str, str] = {}
    for index in sorted(range(len(planes)), key=lambda k: planes[k].height_m):
        label = _main_label(labels[index])
        strength = _strength(label, planes[index], explaining)
        if label is not None and strength > 0.5:
            used[label] = _LABEL_COLOURS[label]
        _draw_plane_from_above(axes, planes[index], label, strength)
    if path_map is not None and len(path_map):
        axes.plot(path_map[:, 0], path_map[:, 1], color=_INK, linewidth=1.0, alpha=0.55, zorder=8)
        axes.plot(*path_map[-1, :2], marker="o", color=_INK, markersize=4, zorder=8)
    for item in furniture:
        _draw_item_from_above(axes, item)
    _finish_plan(axes, title)
    _draw_legend(axes, used, path_map is not None)
    return figure


def draw_overlay(
    frame: SensorFrame,
    planes: Sequence[PlanarRegion],
    labels: Sequence[frozenset[str]],
    furniture: Sequence[FurnitureItem],
    *,
    title: str = "",
) -> Figure:
    """A frame with the labelled planes and the furniture boxes drawn over it.

    Args:
        frame: the picture below is its colour image, or its depth in shades if it has none.
        planes: of the map, or of this frame alone (then without furniture).
        labels: the classes of each plane; planes without a label of their own are not drawn.
        furniture: pieces to draw as boxes; only the planes that explain them are drawn then.
        title: above the picture.
    """
    picture, camera, T_picture_map = _picture_below(frame)
    height, width = picture.shape[:2]
    figure = Figure(figsize=(width / 100.0, height / 100.0 + 0.3), dpi=150, facecolor=_PAPER)
    top = height / (height + 30.0)
    axes = figure.add_axes((0.0, 0.0, 1.0, top))
    axes.imshow(picture, interpolation="bilinear")
    explaining = _explaining(furniture)
    for plane, names in zip(planes, labels, strict=True):
        label = _main_label(names)
        if label is None or label in _BACKGROUND:
            continue
        if furniture and plane.index not in explaining:
            continue
        outline = _projected_outline(plane, T_picture_map, camera)
        if outline is not None:
            colour = _LABEL_COLOURS[label]
            axes.add_patch(
                PathPatch(outline, facecolor=to_rgba(colour, 0.4), edgecolor=colour, linewidth=1.3)
            )
    for item in furniture:
        _draw_item_in_picture(axes, item, T_picture_map, camera)
    axes.set_xlim(-0.5, width - 0.5)
    axes.set_ylim(height - 0.5, -0.5)
    axes.axis("off")
    figure.text(0.01, 0.5 * (1.0 + top), title, color=_INK, fontsize=9, va="center")
    return figure


def save_picture(figure: Figure, path: Path) -> None:
    """Writes a figure as PNG, creating the folder if need be."""
    path.parent.mkdir(parents=True, exist_ok=True)
    FigureCanvasAgg(figure).print_png(str(path))


def _main_label(names: frozenset[str]) -> str | None:
    return next((label for label in _LABEL_COLOURS if label in names), None)


def _words(label: str) -> str:
    """`ChairSeatPlane` as "chair seat"."""
    spaced = "".join(f" {c.lower()}" if c.isupper() else c for c in label.removesuffix("Plane"))
    return spaced.strip()


def _explaining(furniture: Sequence[FurnitureItem]) -> set[int] | None:
    """Numbers of the planes that explain some piece; None if there is nothing to explain."""
    if not furniture:
        return None
    return {plane.identifier for item in furniture for plane in item.planes}


def _strength(label: str | None, plane: PlanarRegion, explaining: set[int] | None) -> float:
    """How strongly to draw a plane, from 0 to 1."""
    if label is None:
        return 0.3
    if label in _BACKGROUND or explaining is None or plane.index in explaining:
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
    for label, colour in _LABEL_COLOURS.items():
        if label in used and colour not in drawn:
            drawn.add(colour)
            handles.append(Patch(facecolor=colour, edgecolor="none", label=_words(label)))
    if with_camera:
        handles.append(Line2D([], [], color=_INK, alpha=0.55, label="camera"))
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
        text.set_color(_INK)


def _class_colour(class_name: str) -> str:
    spare = _SPARE_COLOURS[sum(map(ord, class_name)) % len(_SPARE_COLOURS)]
    return _CLASS_COLOURS.get(class_name, spare)


def _draw_plane_from_above(
    axes: Axes, plane: PlanarRegion, label: str | None, strength: float
) -> None:
    colour = _UNKNOWN if label is None else _LABEL_COLOURS[label]
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
                edgecolor=_PAPER,
                linewidth=0.6,
                zorder=1.0 if height < 0.1 else 2.0 + height + (strength > 0.5),
            )
        )


def _draw_item_from_above(axes: Axes, item: FurnitureItem) -> None:
    colour = _class_colour(item.class_name)
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
    axes.grid(color=_INK, alpha=0.08, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.set_xlabel("x in the map, m", color=_INK)
    axes.set_ylabel("y in the map, m", color=_INK)
    axes.tick_params(colors=_INK, length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.set_title(title, color=_INK, loc="left", fontsize=12, fontweight="bold")


def _outline_path(shape: MultiPolygon) -> Outline | None:
    """A shapely area as a path with holes."""
    parts: list[Outline] = []
    for polygon in shape.geoms:
        for ring in (polygon.exterior, *polygon.interiors):
            corners = np.asarray(ring.coords)[:, :2]
            if len(corners) >= 4:
                parts.append(Outline(corners, closed=True))
    return Outline.make_compound_path(*parts) if parts else None


def _picture_below(frame: SensorFrame) -> tuple[NDArray[np.uint8], Camera, Transform]:
    """The picture to draw on, its camera, and map to camera coordinates."""
    T_depth_map = frame.T_map_sensor.inverse()
    if frame.colour is not None:
        camera = frame.colour_camera or frame.camera
        T_colour_depth = frame.T_colour_depth or Transform.identity()
        # Towards white, so that the drawing stands out.
        pale = (0.75 * frame.colour + 0.25 * 255.0).astype(np.uint8)
        return pale, camera, T_colour_depth @ T_depth_map
    depth = np.where(frame.valid, frame.depth_m, np.nan)
    near, far = np.nanpercentile(depth, (2, 98)) if frame.valid.any() else (0.0, 1.0)
    shade = np.clip((depth - near) / max(far - near, 1e-6), 0.0, 1.0)
    grey = np.where(frame.valid, 235.0 - 150.0 * np.nan_to_num(shade), 250.0).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2), frame.camera, T_depth_map


def _projected_outline(
    plane: PlanarRegion, T_picture_map: Transform, camera: Camera
) -> Outline | None:
    parts: list[Outline] = []
    for ring in plane.rings_map():
        clipped = _clip_in_front(T_picture_map.apply(ring))
        if len(clipped) >= 3:
            pixels = camera.project(clipped)
            parts.append(Outline(np.concatenate([pixels, pixels[:1]]), closed=True))
    return Outline.make_compound_path(*parts) if parts else None


def _clip_in_front(ring: FloatArray) -> FloatArray:
    """The part of a closed ring in front of the camera (Sutherland-Hodgman, one plane)."""
    kept: list[FloatArray] = []
    for a, b in pairwise(ring):
        if a[2] >= _NEAR_M:
            kept.append(a)
        if (a[2] >= _NEAR_M) != (b[2] >= _NEAR_M):
            kept.append(a + (b - a) * (_NEAR_M - a[2]) / (b[2] - a[2]))
    return np.array(kept).reshape(-1, 3)


def _draw_item_in_picture(
    axes: Axes, item: FurnitureItem, T_picture_map: Transform, camera: Camera
) -> None:
    colour = _class_colour(item.class_name)
    corners = T_picture_map.apply(item.box.corners())
    if (corners[:, 2] < _NEAR_M).all():
        return
    for i, j in _BOX_EDGES:
        a, b = corners[i], corners[j]
        if a[2] < _NEAR_M and b[2] < _NEAR_M:
            continue
        if a[2] < _NEAR_M:
            a = a + (b - a) * (_NEAR_M - a[2]) / (b[2] - a[2])
        elif b[2] < _NEAR_M:
            b = b + (a - b) * (_NEAR_M - b[2]) / (a[2] - b[2])
        ends = camera.project(np.stack([a, b]))
        # Odd corners are the upper ones; what leads down is mostly hidden by something.
        is_upper = i % 2 and j % 2
        axes.plot(
            ends[:, 0],
            ends[:, 1],
            color=colour,
            linewidth=1.6 if is_upper else 0.8,
            alpha=0.95 if is_upper else 0.4,
        )
    top = T_picture_map.apply(_top_centre(item.box))
    if top[2] < _NEAR_M:
        return
    u, v = camera.project(top[None])[0]
    if -20 <= u < camera.width + 20 and 0 <= v < camera.height:
        axes.text(
            u,
            v,
            item.identifier,
            color=colour,
            fontsize=9,
            fontweight="bold",
            ha="center",
            va="center",
            clip_on=True,
            path_effects=[patheffects.withStroke(linewidth=2.5, foreground="white")],
        )


def _top_centre(box: BoundingBox) -> FloatArray:
    return box.pose.to_transform().apply(np.array([0.0, 0.0, 0.5 * box.z_size]))
