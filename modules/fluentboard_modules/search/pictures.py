"""Pictures of a search: the room from above, the probability over time, an animation.

From above before every look as in Figs. 5.5 and 5.6; the probability of having seen the object as
in Fig. 5.10.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Wedge
from numpy.typing import NDArray
from PIL import Image

from fluentboard.model.geometry import BoundingBox, FloatArray
from fluentboard_modules.search.execution import ObjectSearch
from fluentboard_modules.search.frontiers import frontiers_of
from fluentboard_modules.search.record import SearchRecord, SearchStep
from fluentboard_modules.search.region import SearchVolume
from fluentboard_modules.simulation.navigation import INSCRIBED, LETHAL, Costmap
from fluentboard_modules.simulation.robots import RobotModel, View

_INK, _PAPER, _WAY, _DRIVEN = "#22303c", "#fbfaf7", "#d1495b", "#8a95a1"
_ROI, _FRONTIER, _WALL, _NEAR, _SOUGHT = "#e9a03b", "#1d7f8c", "#5b6670", "#e6e4de", "#2f8f4e"
_GAIN = LinearSegmentedColormap.from_list("gain", ["#c9cfe0", "#6f78c4", "#3b1f8f"])
_LINES = ("#d1495b", "#3b1f8f", "#1d7f8c", "#e9a03b", "#5b6670")
_ARROW_M = 0.22
_LABEL_M = 0.45  # above the room, for the names of volumes at its wall
_LOW_M, _HIGH_M = 0.15, 1.9
_FRAME_MS, _LAST_FRAME_MS = 1300, 3500
_OUTCOMES = {
    "found": "found",
    "below-threshold": "given up: what is left is too unlikely",
    "exhausted": "given up: there is nothing more to see",
    "out-of-time": "out of time",
    "cancelled": "cancelled",
    "": "",
}


@dataclass(frozen=True, eq=False)
class Scenery:
    """What the picture of one step shows besides the step.

    Attributes:
        unknown: `(n, 2)`; region cells that were still unknown, in metres.
        belief: `(n,)`; probability that the object is in each.
        frontiers: `(n, 2)`; frontier cells of the region.
        occupied: `(n, 2)`; columns of the map with something between knee and head.
        remaining: per volume the share of its cells that was unknown.
        cell_m: side of a cell.
    """

    unknown: FloatArray
    belief: FloatArray
    frontiers: FloatArray
    occupied: FloatArray
    remaining: tuple[float, ...]
    cell_m: float


@dataclass(eq=False)
class SearchAlbum:
    """Collects what the pictures of a search need while it goes on, and draws them at its end.

    Attributes:
        costmap: where the robot can drive.
        robot: whose camera looks.
        sought_map: `(2,)` or `(3,)`; where the object truly is or was found, if that may be shown.
    """

    costmap: Costmap
    robot: RobotModel
    sought_map: FloatArray | None = None
    _planned: list[tuple[SearchStep, Scenery]] = field(default_factory=list, init=False)
    _volumes: tuple[SearchVolume, ...] = field(default=(), init=False)

    def look(self, search: ObjectSearch, step: SearchStep) -> None:
        """Keeps a step as it is planned, before the robot moves; see `ObjectSearch.step`."""
        self._volumes = search.region.volumes
        self._planned.append((step, _scenery(search)))

    def draw(self, record: SearchRecord, folder: Path) -> list[Path]:
        """Draws one picture per look, the probability over time, and the animation.

        Args:
            record: of the search.
            folder: created if missing.

        Returns:
            The files; none if the search ended before its first look.
        """
        folder.mkdir(parents=True, exist_ok=True)
        files: list[Path] = []
        shots: list[NDArray[np.uint8]] = []
        for number in range(len(self._planned)):
            figure = self.plan_view(number, record)
            shots.append(_pixels(figure))
            files.append(folder / f"look{number + 1:02d}.png")
            FigureCanvasAgg(figure).print_png(str(files[-1]))
        if shots:
            files.append(folder / "probability.png")
            FigureCanvasAgg(draw_probability({"search": record})).print_png(str(files[-1]))
            files.append(folder / "search.gif")
            write_animation(shots, files[-1])
        return files

    def plan_view(self, number: int, record: SearchRecord) -> Figure:
        """The room from above before a look: what is unknown, the views, the plan and the way.

        Args:
            number: of the look, from 0.
            record: of the search, for the way driven before and how it ended.
        """
        step, scenery = self._planned[number]
        figure, axes = _room(self.costmap)
        _draw_known(axes, scenery)
        for volume, remaining in zip(self._volumes, scenery.remaining, strict=True):
            _draw_volume(axes, volume, remaining)
        _draw_region(axes, scenery)
        _draw_candidates(figure, axes, step)
        reached = [past for past in record.steps[:number] if past.is_reached]
        for past in reached:
            axes.plot(past.path[:, 0], past.path[:, 1], color=_DRIVEN, linewidth=1.6, zorder=4)
        _draw_plan(axes, step, self.robot)
        here = reached[-1].view if reached else record.start
        axes.plot(here.x, here.y, "o", color=_INK, markersize=8, markeredgecolor=_PAPER, zorder=7)
        if self.sought_map is not None:
            axes.plot(
                *self.sought_map[:2], "*", color=_SOUGHT, markersize=15, markeredgecolor=_PAPER,
                zorder=8,
            )  # fmt: skip
        axes.set_title(_caption(number, len(self._planned), step, record), color=_INK, fontsize=11)
        return figure


def draw_probability(records: Mapping[str, SearchRecord], with_planning: bool = True) -> Figure:
    """Probability that the object has been seen, over time, for one search or several.

    Args:
        records: by what the legend calls them.
        with_planning: count the time spent on planning, too.
    """
    figure = Figure(figsize=(7.4, 4.4), facecolor=_PAPER, layout="constrained")
    axes: Axes = figure.subplots()
    axes.set_facecolor(_PAPER)
    for number, (name, record) in enumerate(records.items()):
        times = [m.elapsed_s + (m.planning_s if with_planning else 0.0) for m in record.moments]
        seen = [m.probability for m in record.moments]
        colour = _LINES[number % len(_LINES)]
        axes.step(times, seen, where="post", color=colour, linewidth=2.0, label=name)
        looks = [
            (m.elapsed_s + (m.planning_s if with_planning else 0.0), m.probability)
            for m in (step.moment for step in record.steps)
        ]
        if looks:
            axes.plot(*zip(*looks, strict=True), "o", color=colour, markersize=4)
    axes.set_ylim(0.0, 1.02)
    axes.set_xlim(left=0.0)
    axes.set_xlabel("time in s" + (", planning included" if with_planning else ""), color=_INK)
    axes.set_ylabel("probability that it has been seen", color=_INK)
    axes.grid(color="#e3e1da", linewidth=0.8)
    if len(records) > 1:
        axes.legend(frameon=False, labelcolor=_INK, fontsize=9)
    _plain(axes)
    return figure


def write_animation(shots: Sequence[NDArray[np.uint8]], path: Path) -> None:
    """Writes pictures `(h, w, 3)` of one size as a GIF that goes on for ever.

    Args:
        shots: at least one; the last one stays longer.
        path: of the file.
    """
    images = [Image.fromarray(shot).quantize(128, dither=Image.Dither.NONE) for shot in shots]
    durations = [_FRAME_MS] * (len(images) - 1) + [_LAST_FRAME_MS]
    images[0].save(
        path, save_all=True, append_images=images[1:], duration=durations, loop=0, optimize=False
    )


def _scenery(search: ObjectSearch) -> Scenery:
    region, occupancy = search.region, search.occupancy
    unknown = region.unknown(occupancy)
    cells = occupancy.occupied_cells()
    heights = occupancy.centres(cells)[:, 2]
    columns = np.unique(cells[(heights > _LOW_M) & (heights < _HIGH_M)][:, :2], axis=0)
    return Scenery(
        unknown=occupancy.centres(region.cells[unknown])[:, :2],
        belief=region.probability(occupancy)[unknown],
        frontiers=frontiers_of(region, occupancy).centres[:, :2],
        occupied=(columns + 0.5) * occupancy.resolution_m,
        remaining=tuple(float(unknown[m].mean()) if len(m) else 0.0 for m in region.members),
        cell_m=occupancy.resolution_m,
    )


def _room(costmap: Costmap) -> tuple[Figure, Axes]:
    """The costmap: obstacles dark, what the robot cannot stand on light, the rest paper."""
    rows, columns = costmap.cost.shape
    low = np.array(costmap.origin)
    high = low + costmap.resolution_m * np.array([columns, rows])
    wide, high_m = (high - low) + (0.0, _LABEL_M)
    share = min(7.2 / wide, 7.2 / high_m)  # inches per metre
    size = (share * wide + 1.9, share * high_m + 1.0)
    figure = Figure(figsize=size, dpi=100, facecolor=_PAPER, layout="constrained")
    axes: Axes = figure.subplots()
    kinds = np.where(costmap.cost >= LETHAL, 2, np.where(costmap.cost >= INSCRIBED, 1, 0))
    palette = LinearSegmentedColormap.from_list("room", [_PAPER, _NEAR, _WALL], 3)
    axes.imshow(
        kinds, origin="lower", extent=(low[0], high[0], low[1], high[1]), cmap=palette, vmin=0,
        vmax=2, interpolation="nearest", zorder=0,
    )  # fmt: skip
    axes.set_xlabel("x in m", color=_INK)
    axes.set_ylabel("y in m", color=_INK)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1] + _LABEL_M)
    axes.set_aspect("equal")
    _plain(axes)
    return figure, axes


def _draw_known(axes: Axes, scenery: Scenery) -> None:
    if len(scenery.occupied):
        x, y = scenery.occupied.T
        axes.scatter(x, y, s=3, marker="s", color=_INK, alpha=0.5, linewidths=0, zorder=1)


def place_name(volume_name: str) -> str:
    """A volume's name without what makes it unique on a board.

    `searchVolumePlacingAreaTable1_search1` is Table1, `shelf3_search_Mug_c0808ee8` is shelf3.
    """
    place = volume_name.partition("_search")[0].removeprefix("searchVolume")
    return place.removeprefix("PlacingArea") or volume_name


def _draw_volume(axes: Axes, volume: SearchVolume, remaining: float) -> None:
    outline = footprint(volume.box)
    axes.add_patch(Polygon(outline, facecolor=_ROI, alpha=0.22, edgecolor="none", zorder=2))
    axes.add_patch(Polygon(outline, fill=False, edgecolor=_ROI, linewidth=1.6, zorder=3))
    text = axes.annotate(
        f"{place_name(volume.name)}\n{100 * remaining:.0f} % unseen",
        (float(outline[:, 0].mean()), float(outline[:, 1].max())),
        xytext=(0, 4),
        textcoords="offset points",
        ha="center",
        fontsize=7,
        color=_INK,
        zorder=9,
    )
    text.set_path_effects([patheffects.withStroke(linewidth=2.5, foreground=_PAPER)])


def _draw_region(axes: Axes, scenery: Scenery) -> None:
    """Unknown cells as orange columns, the darker the more may be there; frontiers as dots."""
    if len(scenery.unknown):
        index = np.rint(scenery.unknown / scenery.cell_m * 2.0).astype(np.int64)
        columns, number = np.unique(index, axis=0, return_inverse=True)
        weight = np.bincount(number.reshape(-1), scenery.belief)
        shade = 0.15 + 0.75 * weight / max(float(weight.max()), 1e-12)
        x, y = (columns * 0.5 * scenery.cell_m).T
        axes.scatter(x, y, s=14, marker="s", color=_ROI, alpha=shade, linewidths=0, zorder=3)
    if len(scenery.frontiers):
        x, y = np.unique(np.round(scenery.frontiers, 3), axis=0).T
        axes.scatter(x, y, s=1.0, color=_FRONTIER, linewidths=0, zorder=4)


def _draw_candidates(figure: Figure, axes: Axes, step: SearchStep) -> None:
    if not step.candidates:
        return
    order = np.argsort(step.gains)
    views = [step.candidates[k] for k in order]
    gains = step.gains[order]
    headings = np.array([view.yaw_rad + view.pan_rad for view in views])
    scale = Normalize(0.0, max(float(gains.max()), 1e-9))
    axes.quiver(
        [v.x for v in views], [v.y for v in views],
        _ARROW_M * np.cos(headings), _ARROW_M * np.sin(headings), gains,
        angles="xy", scale_units="xy", scale=1.0, width=0.0028, cmap=_GAIN, norm=scale, zorder=5,
    )  # fmt: skip
    bar = figure.colorbar(ScalarMappable(scale, _GAIN), ax=axes, shrink=0.6, aspect=30)
    bar.set_label("probability that a view shows the object", color=_INK, fontsize=8)
    bar.ax.tick_params(labelsize=7, colors=_INK)


def _draw_plan(axes: Axes, step: SearchStep, robot: RobotModel) -> None:
    axes.plot(step.path[:, 0], step.path[:, 1], color=_WAY, linewidth=2.4, zorder=6)
    stops = np.array([(view.x, view.y) for view in step.plan])
    if len(stops) > 1:
        axes.plot(stops[:, 0], stops[:, 1], color=_WAY, linewidth=1.2, linestyle=(0, (4, 3)),
                  alpha=0.8, zorder=6)  # fmt: skip
    for number, view in enumerate(step.plan, start=1):
        axes.add_patch(_seen_from(view, robot, 0.2 if number == 1 else 0.06))
        axes.plot(view.x, view.y, "o", color=_WAY, markersize=11 if number == 1 else 8,
                  markeredgecolor=_PAPER, zorder=7)  # fmt: skip
        axes.annotate(str(number), (view.x, view.y), ha="center", va="center", fontsize=6.5,
                      color=_PAPER, zorder=8)  # fmt: skip


def _seen_from(view: View, robot: RobotModel, alpha: float) -> Wedge:
    """The camera's horizontal field of view."""
    heading = math.degrees(view.yaw_rad + view.pan_rad)
    half = 0.5 * math.degrees(robot.horizontal_fov_rad)
    near, far = robot.range_m
    wedge = Wedge((view.x, view.y), far, heading - half, heading + half, width=far - near)
    wedge.set(facecolor=_WAY, alpha=alpha, edgecolor="none", zorder=2)
    return wedge


def footprint(box: BoundingBox) -> FloatArray:
    """`(4, 2)`; the outline of an upright box from above, counter-clockwise."""
    half_x, half_y = 0.5 * box.x_size, 0.5 * box.y_size
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (half_x, half_y)
    local = np.column_stack([corners, np.zeros(4)])
    return box.pose.to_transform().apply(local)[:, :2]


def _caption(number: int, count: int, step: SearchStep, record: SearchRecord) -> str:
    spent = step.moment.elapsed_s
    text = (
        f"look {number + 1} of {count} after {spent:.0f} s: {len(step.plan)} views planned, "
        f"E[T] = {step.expected_time_s:.0f} s, p = {step.success_probability:.2f}"
    )
    if number + 1 == count and record.outcome:
        text += f"; {_OUTCOMES.get(record.outcome, record.outcome)}"
    return text


def _pixels(figure: Figure) -> NDArray[np.uint8]:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _plain(axes: Axes) -> None:
    axes.tick_params(colors=_INK, labelsize=8)
    for spine in axes.spines.values():
        spine.set_color("#c9ced4")
