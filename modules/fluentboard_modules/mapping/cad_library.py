"""The CAD models that hypotheses are verified with, by class of furniture."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fluentboard.errors import InvalidGeometry
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.simulation.cad import CAD_SUFFIXES, load_mesh
from fluentboard_modules.simulation.mesh import Mesh
from fluentboard_modules.simulation.scene import Model

logger = logging.getLogger(__name__)

_LARGEST_M, _SMALLEST_M = 8.0, 0.2


@dataclass(frozen=True)
class CadLibrary:
    """CAD models by class; a class without any is verified with what its hypothesis says.

    Attributes:
        models: all of them.
    """

    models: tuple[CadModel, ...] = ()
    _by_class: Mapping[str, tuple[CadModel, ...]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        by_class: dict[str, list[CadModel]] = {}
        for model in self.models:
            by_class.setdefault(model.class_name, []).append(model)
        object.__setattr__(self, "_by_class", {name: tuple(ms) for name, ms in by_class.items()})

    def of_class(self, class_name: str) -> tuple[CadModel, ...]:
        """The models of a class."""
        return self._by_class.get(class_name, ())

    def named(self, name: str) -> CadModel | None:
        """The model of that name, None if there is none."""
        return next((model for model in self.models if model.name == name), None)

    def with_models(self, more: Iterable[CadModel]) -> CadLibrary:
        """The library with more models."""
        return CadLibrary((*self.models, *more))


def load_library(folder: Path, classes: Iterable[str]) -> CadLibrary:
    """The models of a folder: `Chair.stl`, `Chair_2.obj`, or `Chair/anything.stl`.

    Each file is read in the unit and with the upward axis that it states, put on the floor and
    centred; its front is +x.

    Args:
        folder: with CAD files (STL, OBJ, PLY, glTF, COLLADA, SDF).
        classes: the furniture classes that files may be named after.

    Raises:
        InvalidGeometry: there is no such folder, it holds no model of any class, or a file is no
            piece of furniture.
    """
    if not folder.is_dir():
        raise InvalidGeometry(f"{folder}: there is no such folder of CAD models")
    known = {name.lower(): name for name in classes}
    found: list[CadModel] = []
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() not in CAD_SUFFIXES or not path.is_file():
            continue
        relative = path.relative_to(folder)
        stems = [part.lower() for part in (*relative.parts[:-1], path.stem)]
        names = [known[key] for stem in stems for key in (stem, stem.split("_")[0]) if key in known]
        if not names:
            logger.warning("%s is named after no furniture class and is left out", path)
            continue
        found.append(CadModel(path.stem, names[0], stood_up(load_mesh(path), str(path))))
    if not found:
        raise InvalidGeometry(
            f"{folder}: no CAD file there is named after a furniture class; name files like "
            f"{', '.join(f'{name}.stl' for name in sorted(known.values())[:3])}"
        )
    return CadLibrary(tuple(found))


def stood_up(mesh: Mesh, source: str) -> Mesh:
    """A mesh moved onto the floor with the centre of its footprint at the origin.

    Args:
        mesh: metres, z up.
        source: what to call it in messages.

    Raises:
        InvalidGeometry: it is no piece of furniture by its size.
    """
    low, high = mesh.bounds
    size = high - low
    if float(size.max()) > _LARGEST_M or float(size.max()) < _SMALLEST_M:
        raise InvalidGeometry(
            f"{source}: the model is {size[0]:.2f} x {size[1]:.2f} x {size[2]:.2f} m; give a "
            "piece of furniture in metres, or state the file's unit in its header (units=mm)"
        )
    middle = np.array([*(0.5 * (low + high))[:2], low[2]])
    return mesh.shifted(*(-float(v) for v in middle))


def library_of(models: Iterable[Model], classes: Mapping[str, str] | None = None) -> CadLibrary:
    """A library of the simulator's models, each once.

    Args:
        models: of the things that stand in a scene.
        classes: the furniture class of each of the simulator's classes, if it differs.
    """
    unique = {model.name: model for model in models}
    return CadLibrary(
        tuple(
            CadModel(name, (classes or {}).get(model.cls, model.cls), model.mesh)
            for name, model in sorted(unique.items())
        )
    )
