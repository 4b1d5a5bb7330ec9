"""One picture of everything: the room with what was found in it, and the fluents below."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import BoundingBox, FloatArray, Transform
from fluentboard_modules.demo.findings import Finding
from fluentboard_modules.demo.timeline import CLASS_COLOURS, Row, draw_timeline
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fluentboard_modules.simulation.scene import Scene

_WIDTH_PX, _HEIGHT_PX = 1600, 800
_FOV_RAD = 0.62
_ROW_INCHES = 0.34
_TALLEST_INCHES = 5.6
_NEAREST_M = 0.2
_LETTER_PX, _LABEL_HEIGHT_PX, _LABEL_RISE_PX = 14.0, 38.0, 40.0
_OTHER_COLOUR = "#7a8594"
# Corner numbers of the edges of a box, as `BoundingBox.corners` orders them.
_EDGES = (
    *((0, 1), (2, 3), (4, 5), (6, 7)),
    *((0, 2), (1, 3), (4, 6), (5, 7)),
    *((0, 4), (1, 5), (2, 6), (3, 7)),
)


@dataclass(frozen=True, slots=True)
class View:
    """A picture of a room, and how points of the map come into it.

    Attributes:
        image: `(h, w, 3)` RGB.
        camera: of the picture.
        T_camera_map: map to camera coordinates.
    """

    image: NDArray[np.uint8]
    camera: Camera
    T_camera_map: Transform

    def shows(self, points_map: FloatArray) -> bool:
        """Whether all points are in front of the camera and one of them is in the picture."""
        points = self.T_camera_map.apply(points_map)
        if points[:, 2].min() < _NEAREST_M:
            return False
        height, width = self.image.shape[:2]
        pixels = self.camera.project(points)
        return bool(((pixels >= 0) & (pixels < (width, height))).all(axis=1).any())

    def pixels(self, points_map: FloatArray) -> FloatArray:
        """Pixel coordinates `(n, 2)` of points `(n, 3)` of the map."""
        return self.camera.project(self.T_camera_map.apply(points_map))


def view_of_scene(scene: Scene) -> View:
    """A simulated room from the south-west, all of it."""
    from fluentboard_modules.simulation.picture import perspective
    from fluentboard_modules.simulation.viewpoint import look_at, pinhole

    eye, aim = _viewpoint(scene)
    return View(
        perspective(scene, eye, aim, _WIDTH_PX, _HEIGHT_PX, _FOV_RAD),
        pinhole(_WIDTH_PX, _HEIGHT_PX, _FOV_RAD),
        look_at(eye, aim).inverse(),
    )


def view_of_frame(frame: SensorFrame) -> View:
    """What a frame shows: its colours, or its depth in shades of grey if it has none."""
    T_camera_map = frame.T_map_sensor.inverse()
    if frame.colour is None:
        far_m = max(float(frame.depth_m.max()), 1e-6)
        grey = (255.0 * (1.0 - 0.8 * frame.depth_m / far_m)).astype(np.uint8)
        return View(np.repeat(grey[..., None], 3, axis=2), frame.camera, T_camera_map)
    T_colour_depth = frame.T_colour_depth or Transform.identity()
    return View(frame.colour, frame.colour_camera or frame.camera, T_colour_depth @ T_camera_map)


def save_overview(
    view: View,
    findings: Sequence[Finding],
    rows: Sequence[Row],
    span_s: tuple[float, float],
    path: Path,
    *,
    title: str,
) -> Path:
    """Draws a room with the boxes that the board knows, and a time line below it.

    Args:
        view: of the room.
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

    height_px, width_px = view.image.shape[:2]
    figure_inches, left, right = 10.0, 0.085, 0.985
    # A tall picture does not get the full width, so that the time line stays on the same screen.
    room_inches = min(figure_inches * (right - left) * height_px / width_px, _TALLEST_INCHES)
    room_width = room_inches * width_px / height_px / figure_inches
    line_inches = _ROW_INCHES * max(len(rows), 1)
    above, between, below = 0.35, 0.45, 0.5
    height = above + room_inches + between + line_inches + below
    figure = Figure(figsize=(figure_inches, height), dpi=150)
    FigureCanvasAgg(figure)
    figure.set_facecolor("white")
    line = figure.add_axes((left, below / height, right - left, line_inches / height))
    bottom = (below + line_inches + between) / height
    room = figure.add_axes((left, bottom, room_width, room_inches / height))
    _draw_room(room, view, findings)
    draw_timeline(line, rows, span_s)
    room.set_title(title, loc="left", fontsize=12, color="#20262e", pad=7, fontweight="bold")
    figure.savefig(path)
    return path


def _draw_room(axes: Axes, view: View, findings: Sequence[Finding]) -> None:
    height, width = view.image.shape[:2]
    axes.imshow(view.image, interpolation="lanczos")
    unit = width / _WIDTH_PX  # labels are laid out for pictures of that width
    shown = [finding for finding in findings if view.shows(finding.box.corners())]
    anchors: list[FloatArray] = []
    for finding in shown:
        colour = CLASS_COLOURS.get(finding.class_name, _OTHER_COLOUR)
        pixels = view.pixels(finding.box.corners())
        for a, b in _EDGES:
            axes.plot(*pixels[[a, b]].T, color=colour, linewidth=1.5, solid_capstyle="round")
        anchors.append(view.pixels(_top(finding.box)[None])[0])
    for finding, anchor, place in zip(
        shown, anchors, _label_places(shown, anchors, unit), strict=True
    ):
        if not (0 <= anchor[0] < width and 0 <= anchor[1] < height):
            continue  # its edges are in the picture, its middle is not
        colour = CLASS_COLOURS.get(finding.class_name, _OTHER_COLOUR)
        axes.plot([anchor[0], place[0]], [anchor[1], place[1]], color=colour, linewidth=1.0)
        axes.plot(*anchor, marker="o", markersize=3.0, color=colour)
        _write_label(axes, finding.name, place, colour)
    axes.set_xlim(0, width - 1)
    axes.set_ylim(height - 1, 0)
    axes.set_axis_off()


def _label_places(
    findings: Sequence[Finding], anchors: Sequence[FloatArray], unit: float
) -> list[tuple[float, float]]:
    """A place above each anchor, pushed up until no label covers another; pixels."""
    letter, label_height = unit * _LETTER_PX, unit * _LABEL_HEIGHT_PX
    places: dict[int, tuple[float, float]] = {}
    for index in sorted(range(len(anchors)), key=lambda i: -float(anchors[i][1])):
        x, y = float(anchors[index][0]), float(anchors[index][1]) - unit * _LABEL_RISE_PX
        width = letter * (len(findings[index].name) + 1)
        for other, (other_x, other_y) in sorted(places.items(), key=lambda place: -place[1][1]):
            reach = 0.5 * (width + letter * (len(findings[other].name) + 1))
            if abs(other_x - x) < reach and abs(other_y - y) < label_height:
                y = other_y - label_height
        places[index] = (x, max(y, 0.6 * label_height))
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
