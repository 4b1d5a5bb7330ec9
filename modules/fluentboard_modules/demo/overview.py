"""One picture of everything: the room with what was found in it, and the fluents below."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fluentboard.model.geometry import BoundingBox, FloatArray
from fluentboard_modules.demo.findings import Finding
from fluentboard_modules.demo.timeline import CLASS_COLOURS, Row, draw_timeline

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fluentboard_modules.simulation.scene import Scene

_WIDTH_PX, _HEIGHT_PX = 1600, 800
_FOV_RAD = 0.62
_ROW_INCHES = 0.34
_LETTER_PX, _LABEL_HEIGHT_PX, _LABEL_RISE_PX = 14.0, 38.0, 40.0
_OTHER_COLOUR = "#7a8594"
# Corner numbers of the edges of a box, as `BoundingBox.corners` orders them.
_EDGES = (
    *((0, 1), (2, 3), (4, 5), (6, 7)),
    *((0, 2), (1, 3), (4, 6), (5, 7)),
    *((0, 4), (1, 5), (2, 6), (3, 7)),
)


def save_overview(
    scene: Scene,
    findings: Sequence[Finding],
    rows: Sequence[Row],
    span_s: tuple[float, float],
    path: Path,
    *,
    title: str,
) -> Path:
    """Draws a simulated room with the boxes that the board knows, and a time line below it.

    Args:
        scene: the room.
        findings: the furniture that the board knows at present.
        rows: of the time line.
        span_s: the part of the time axis that the record covers.
        path: of the picture.
        title: above the picture.

    Returns:
        The path.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure_inches, left, right = 10.0, 0.075, 0.985
    room_inches = figure_inches * (right - left) * _HEIGHT_PX / _WIDTH_PX
    line_inches = _ROW_INCHES * max(len(rows), 1)
    above, between, below = 0.35, 0.45, 0.5
    height = above + room_inches + between + line_inches + below
    figure = Figure(figsize=(figure_inches, height), dpi=150)
    FigureCanvasAgg(figure)
    figure.set_facecolor("white")
    line = figure.add_axes((left, below / height, right - left, line_inches / height))
    bottom = (below + line_inches + between) / height
    room = figure.add_axes((left, bottom, right - left, room_inches / height))
    _draw_room(room, scene, findings)
    draw_timeline(line, rows, span_s)
    room.set_title(title, loc="left", fontsize=12, color="#20262e", pad=7, fontweight="bold")
    figure.savefig(path)
    return path


def _draw_room(axes: Axes, scene: Scene, findings: Sequence[Finding]) -> None:
    from fluentboard_modules.simulation.picture import perspective
    from fluentboard_modules.simulation.viewpoint import look_at, pinhole

    eye, aim = _viewpoint(scene)
    image = perspective(scene, eye, aim, _WIDTH_PX, _HEIGHT_PX, _FOV_RAD)
    camera = pinhole(_WIDTH_PX, _HEIGHT_PX, _FOV_RAD)
    T_camera_map = look_at(eye, aim).inverse()
    axes.imshow(image, interpolation="lanczos")
    anchors: list[FloatArray] = []
    for finding in findings:
        colour = CLASS_COLOURS.get(finding.class_name, _OTHER_COLOUR)
        pixels = camera.project(T_camera_map.apply(finding.box.corners()))
        for a, b in _EDGES:
            axes.plot(*pixels[[a, b]].T, color=colour, linewidth=1.5, solid_capstyle="round")
        anchors.append(camera.project(T_camera_map.apply(_top(finding.box)[None]))[0])
    for finding, anchor, place in zip(
        findings, anchors, _label_places(findings, anchors), strict=True
    ):
        colour = CLASS_COLOURS.get(finding.class_name, _OTHER_COLOUR)
        axes.plot([anchor[0], place[0]], [anchor[1], place[1]], color=colour, linewidth=1.0)
        axes.plot(*anchor, marker="o", markersize=3.0, color=colour)
        _write_label(axes, finding.name, place, colour)
    axes.set_xlim(0, _WIDTH_PX - 1)
    axes.set_ylim(_HEIGHT_PX - 1, 0)
    axes.set_axis_off()


def _label_places(
    findings: Sequence[Finding], anchors: Sequence[FloatArray]
) -> list[tuple[float, float]]:
    """A place above each anchor, pushed up until no label covers another; pixels."""
    places: dict[int, tuple[float, float]] = {}
    for index in sorted(range(len(anchors)), key=lambda i: -float(anchors[i][1])):
        x, y = float(anchors[index][0]), float(anchors[index][1]) - _LABEL_RISE_PX
        width = _LETTER_PX * (len(findings[index].name) + 1)
        for other, (other_x, other_y) in sorted(places.items(), key=lambda place: -place[1][1]):
            reach = 0.5 * (width + _LETTER_PX * (len(findings[other].name) + 1))
            if abs(other_x - x) < reach and abs(other_y - y) < _LABEL_HEIGHT_PX:
                y = other_y - _LABEL_HEIGHT_PX
        places[index] = (x, max(y, 0.6 * _LABEL_HEIGHT_PX))
    return [places[index] for index in range(len(anchors))]


def _viewpoint(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Eye and aim of a view from the south-west into the whole room."""
    low, high = scene.bounds
    middle = 0.5 * (low + high)
    aim = np.array([middle[0], middle[1], 0.35])
    reach = 1.12 * float(np.hypot(*(high - low)[:2])) / np.tan(0.5 * _FOV_RAD) / 2.0
    direction = np.array([-0.30, -0.66, 0.69])
    return aim + reach * direction / np.linalg.norm(direction), aim


def _top(box: BoundingBox) -> FloatArray:
    """The middle of the top."""
    return np.array([box.pose.x, box.pose.y, box.pose.z + 0.5 * box.z_size])


def _write_label(axes: Axes, text: str, place: tuple[float, float], colour: str) -> None:
    axes.text(
        place[0],
        place[1],
        text,
        fontsize=8,
        color="white",
        ha="center",
        va="center",
        fontweight="bold",
        bbox={"boxstyle": "round,pad=0.25", "facecolor": colour, "linewidth": 0, "alpha": 0.92},
    )
