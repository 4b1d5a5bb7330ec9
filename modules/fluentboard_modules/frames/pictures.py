"""Pictures of a source: a sheet of its frames, and the way of the camera from above."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps, patheffects
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.frames.report import SourceReport
from fluentboard_modules.frames.sensor_frame import SensorFrame

_INK, _PAPER, _PATH = "#22303c", "#fbfaf7", "#d1495b"
_SHEET_FRAMES = 8
_POINTS_PER_FRAME = 4000
_ARROW_M = 0.25


def draw_source(report: SourceReport, folder: Path) -> list[Path]:
    """Draws both pictures; returns their files.

    Args:
        report: of `examine`, with at least one frame.
        folder: created if missing.
    """
    folder.mkdir(parents=True, exist_ok=True)
    figures = {"frames.png": draw_sheet(report), "path.png": draw_path(report)}
    for name, figure in figures.items():
        FigureCanvasAgg(figure).print_png(str(folder / name))
    return [folder / name for name in figures]


def draw_sheet(report: SourceReport) -> Figure:
    """Depth and colour of some frames, with one scale of depth for all."""
    frames = _spread(report.frames, _SHEET_FRAMES)
    columns = min(4, len(frames))
    rows = math.ceil(len(frames) / columns)
    has_colour = any(frame.colour is not None for frame in frames)
    per_frame = 2 if has_colour else 1
    aspect = frames[0].camera.height / frames[0].camera.width
    width = 3.2 * columns
    figure = Figure(
        figsize=(width + 1.0, rows * per_frame * (3.2 * aspect + 0.22) + 0.7),
        facecolor=_PAPER,
        layout="constrained",
    )
    figure.suptitle(_title(report), color=_INK, fontsize=11)
    axes: Any = figure.subplots(rows * per_frame, columns, squeeze=False)
    depths = np.concatenate([frame.depth_m[frame.valid] for frame in frames])
    low, high = np.percentile(depths, [1.0, 99.0]) if depths.size else (0.0, 1.0)
    scale = Normalize(low, max(high, low + 1e-3))
    palette = colormaps["viridis_r"].with_extremes(bad="#1d2228")
    for row in axes.flat:
        row.set_axis_off()
    for place, frame in enumerate(frames):
        upper = axes[per_frame * (place // columns), place % columns]
        upper.imshow(np.where(frame.valid, frame.depth_m, np.nan), norm=scale, cmap=palette)
        upper.set_title(
            f"{frame.index}: {frame.stamp_s:.2f} s, {100 * frame.valid.mean():.0f} % depth",
            fontsize=8,
            color=_INK,
            pad=3,
        )
        if has_colour and frame.colour is not None:
            axes[per_frame * (place // columns) + 1, place % columns].imshow(frame.colour)
    bar = figure.colorbar(
        ScalarMappable(scale, palette), ax=axes[:, -1].tolist(), shrink=0.6, aspect=30
    )
    bar.set_label("depth in m", color=_INK, fontsize=8)
    bar.ax.tick_params(labelsize=7, colors=_INK)
    return figure


def draw_path(report: SourceReport) -> Figure:
    """The camera's way and what it saw, from above; colour is height."""
    figure = Figure(figsize=(8.0, 7.4), facecolor=_PAPER, layout="constrained")
    axes: Axes = figure.subplots()
    axes.set_facecolor(_PAPER)
    points = _points(report.frames)
    places = np.array([frame.T_map_sensor.translation for frame in report.frames])
    if len(points):
        low, high = np.percentile(points[:, 2], [1.0, 95.0])
        shown = points[np.argsort(points[:, 2])]  # what is high lies on top
        dots = axes.scatter(
            shown[:, 0],
            shown[:, 1],
            c=shown[:, 2],
            s=1.2,
            linewidths=0,
            cmap="viridis",
            vmin=low,
            vmax=high,
            rasterized=True,
        )
        bar = figure.colorbar(dots, ax=axes, shrink=0.7, aspect=30)
        bar.set_label("height in m (upright, origin of the recording)", color=_INK, fontsize=8)
        bar.ax.tick_params(labelsize=7, colors=_INK)
        edge = np.percentile(points[:, :2], [1.0, 99.0], axis=0)
        edge = np.array(
            [np.minimum(edge[0], places[:, :2].min(0)), np.maximum(edge[1], places[:, :2].max(0))]
        )
        axes.set_xlim(edge[0, 0] - 0.3, edge[1, 0] + 0.3)
        axes.set_ylim(edge[0, 1] - 0.3, edge[1, 1] + 0.3)
    axes.plot(places[:, 0], places[:, 1], color=_PATH, linewidth=1.6, zorder=3)
    forward = np.array([f.T_map_sensor.rotate(np.array([0.0, 0.0, 1.0])) for f in report.frames])
    axes.quiver(
        places[:, 0],
        places[:, 1],
        _ARROW_M * forward[:, 0],
        _ARROW_M * forward[:, 1],
        angles="xy",
        scale_units="xy",
        scale=1.0,
        width=0.003,
        color=_PATH,
        zorder=4,
    )
    axes.plot(*places[0, :2], marker="o", color=_PATH, markeredgecolor=_PAPER, zorder=5)
    label = axes.annotate(
        "first", places[0, :2], xytext=(6, 6), textcoords="offset points", color=_INK
    )
    label.set_path_effects([patheffects.withStroke(linewidth=3, foreground=_PAPER)])
    axes.set_aspect("equal")
    axes.set_xlabel("x in m", color=_INK)
    axes.set_ylabel("y in m", color=_INK)
    axes.tick_params(colors=_INK, labelsize=8)
    for spine in axes.spines.values():
        spine.set_color("#c9ced4")
    axes.set_title(_title(report), color=_INK, fontsize=11)
    return figure


def _title(report: SourceReport) -> str:
    count = "live" if report.count is None else f"{report.count} frames"
    return f"{Path(report.name).name or report.name}: {count}"


def _spread(frames: Sequence[SensorFrame], count: int) -> list[SensorFrame]:
    places = np.unique(np.linspace(0, len(frames) - 1, min(count, len(frames))).round())
    return [frames[int(place)] for place in places]


def _points(frames: Sequence[SensorFrame]) -> FloatArray:
    """`(n, 3)`; some points of every frame."""
    found: list[FloatArray] = [np.zeros((0, 3))]
    for frame in frames:
        points = (
            frame.points_map()[frame.valid]
            if frame.cloud_sensor is None
            else frame.T_map_sensor.apply(frame.cloud_sensor)
        )
        found.append(points[:: max(1, len(points) // _POINTS_PER_FRAME)])
    return np.concatenate(found)
