"""Style of the pictures of mapping: colours of labels and classes, and how a figure is kept."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fluentboard_modules.mapping.furniture_item import FurnitureItem

INK = "#22303c"
PAPER = "#fbfaf7"
UNKNOWN = "#cfd3d8"
# In the order in which a plane with several labels is coloured.
LABEL_COLOURS = {
    "FloorPlane": "#e9e4d8",
    "TablePlane": "#2a9d8f",
    "DeskPlane": "#2a9d8f",
    "CoffeeTablePlane": "#74c0a5",
    "CounterPlane": "#3a6ea5",
    "CounterFrontPlane": "#7fa6d1",
    "WallBoardPlane": "#8fb8a8",
    "ChairSeatPlane": "#d1495b",
    "WallPlane": "#b4bcc6",
    "CabinetFrontPlane": "#9bb8d3",
    "CabinetTopPlane": "#5f8fbf",
    "ChairBackrestPlane": "#f0a35e",
    "ShelfPlane": "#a98bc9",
    "CeilingPlane": "#e3e3e3",
}
BACKGROUND = ("FloorPlane", "WallPlane", "CeilingPlane")
_CLASS_COLOURS = {
    "Table": "#14746f",
    "Desk": "#14746f",
    "CoffeeTable": "#3f8f74",
    "Counter": "#274c77",
    "Cabinet": "#41699a",
    "Chair": "#b02a3d",
    "Shelf": "#6f4fa0",
    "WallShelf": "#4d8a76",
}
_SPARE_COLOURS = ("#8a5a44", "#5b8e7d", "#bc4b51", "#7a6c5d", "#4f6d7a")


def save_picture(figure: Figure, path: Path) -> None:
    """Writes a figure as PNG, creating the folder if need be."""
    path.parent.mkdir(parents=True, exist_ok=True)
    FigureCanvasAgg(figure).print_png(str(path))


def main_label(names: frozenset[str]) -> str | None:
    """The label that a plane is coloured by; None if it has none of its own."""
    return next((label for label in LABEL_COLOURS if label in names), None)


def words(label: str) -> str:
    """`ChairSeatPlane` as "chair seat"."""
    spaced = "".join(f" {c.lower()}" if c.isupper() else c for c in label.removesuffix("Plane"))
    return spaced.strip()


def explaining_planes(furniture: Sequence[FurnitureItem]) -> set[int] | None:
    """Numbers of the planes that explain some piece; None if there is nothing to explain."""
    if not furniture:
        return None
    return {plane.identifier for item in furniture for plane in item.planes}


def class_colour(class_name: str) -> str:
    """Of a class of furniture; the same for a name each time."""
    spare = _SPARE_COLOURS[sum(map(ord, class_name)) % len(_SPARE_COLOURS)]
    return _CLASS_COLOURS.get(class_name, spare)
