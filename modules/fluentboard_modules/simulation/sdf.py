"""Read the shapes of a Gazebo model (.sdf): boxes, cylinders, spheres and meshes, in metres."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol
from xml.etree import ElementTree

import numpy as np

from fluentboard.errors import InvalidGeometry
from fluentboard.model.geometry import Pose, Transform
from fluentboard_modules.simulation.mesh import Mesh, box, cylinder, lathe, merge


class ReadMesh(Protocol):
    """Reads a mesh file into metres with z up."""

    def __call__(self, path: Path, /) -> Mesh:
        """The triangles of the file."""
        ...


def read_sdf(path: Path, read_mesh: ReadMesh) -> Mesh:
    """The visible shapes of every model in the file, or the collision shapes where it shows none.

    Args:
        path: the file.
        read_mesh: how to read the mesh files it refers to.

    Raises:
        InvalidGeometry: the file is not SDF, has no shape, or refers to a file that is not there.
    """
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise InvalidGeometry(f"{path}: not well-formed XML ({error})") from error
    if root.tag != "sdf":
        raise InvalidGeometry(f"{path}: the root element is {root.tag}, expected sdf")
    parts: list[Mesh] = []
    for model in root.iter("model"):
        T_world_model = _pose(model, path)
        for link in model.findall("link"):
            T_world_link = T_world_model @ _pose(link, path)
            for shape in link.findall("visual") or link.findall("collision"):
                mesh = _shape(shape.find("geometry"), path, read_mesh)
                if mesh is not None:
                    parts.append(mesh.moved(T_world_link @ _pose(shape, path)))
    if not parts:
        raise InvalidGeometry(f"{path}: no box, cylinder, sphere or mesh in this model")
    return merge(parts)


def _numbers(element: ElementTree.Element | None, count: int, path: Path) -> list[float]:
    text = "" if element is None or element.text is None else element.text
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != count:
        what = "an element" if element is None else f"<{element.tag}>"
        raise InvalidGeometry(f"{path}: {what} holds {text!r}, expected {count} numbers")
    return values


def _pose(element: ElementTree.Element, path: Path) -> Transform:
    pose = element.find("pose")
    if pose is None or not (pose.text or "").strip():
        return Transform.identity()
    if pose.attrib.get("relative_to"):
        raise InvalidGeometry(
            f"{path}: a pose relative to {pose.attrib['relative_to']!r} is not read; "
            "express it in the frame of its parent"
        )
    return Pose.from_rpy(*_numbers(pose, 6, path)).to_transform()


def _shape(geometry: ElementTree.Element | None, path: Path, read_mesh: ReadMesh) -> Mesh | None:
    if geometry is None:
        return None
    for shape in geometry:
        if shape.tag == "box":
            x, y, z = _numbers(shape.find("size"), 3, path)
            return box(x, y, z, (0.0, 0.0, -0.5 * z))
        if shape.tag == "cylinder":
            (radius,) = _numbers(shape.find("radius"), 1, path)
            (length,) = _numbers(shape.find("length"), 1, path)
            return cylinder(radius, length).shifted(z=-0.5 * length)
        if shape.tag == "sphere":
            (radius,) = _numbers(shape.find("radius"), 1, path)
            angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 17)
            return lathe([(float(radius * np.cos(a)), float(radius * np.sin(a))) for a in angle])
        if shape.tag == "mesh":
            return _mesh(shape, path, read_mesh)
    return None


def _mesh(shape: ElementTree.Element, path: Path, read_mesh: ReadMesh) -> Mesh:
    uri = (shape.findtext("uri") or "").strip()
    scale = shape.find("scale")
    factors = np.array(_numbers(scale, 3, path) if scale is not None else [1.0, 1.0, 1.0])
    mesh = read_mesh(_located(uri, path))
    triangles = mesh.triangles if float(np.prod(factors)) > 0.0 else mesh.triangles[:, ::-1]
    return Mesh(mesh.vertices * factors, triangles, mesh.solids)


def _located(uri: str, path: Path) -> Path:
    """The file that `model://name/file`, `file://file` or a relative path means."""
    relative = uri.removeprefix("model://").removeprefix("file://").lstrip("/")
    inside = Path(*Path(relative).parts[1:]) if uri.startswith("model://") else Path(relative)
    for candidate in (path.parent.parent / relative, path.parent / inside, path.parent / relative):
        if candidate.is_file():
            return candidate
    raise InvalidGeometry(f"{path}: refers to {uri!r}, and there is no such file beside it")
