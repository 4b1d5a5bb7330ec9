"""Scenes as JSON: written whole, or read with their meshes in files beside them.

A pose is `[x, y, z, roll, pitch, yaw]` in metres and radians in the map frame. A model is either
described under `models` (mesh, colour, supports) or a CAD file `meshes/<model>.<suffix>`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fluentboard.errors import InvalidInput
from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.simulation.cad import CAD_SUFFIXES, load_mesh
from fluentboard_modules.simulation.mesh import Mesh
from fluentboard_modules.simulation.scene import (
    Colour,
    Instance,
    Model,
    Scene,
    SearchVolume,
    Support,
)
from fluentboard_modules.simulation.supports import horizontal_supports, with_supports_resolved

FRAME_NOTE = "map: z up, floor at z = 0; metres and radians; pose = [x, y, z, roll, pitch, yaw]"

_CLASS_COLOURS: Mapping[str, Colour] = {
    "Building": (214, 210, 198),
    "Table": (201, 164, 116),
    "Counter": (128, 90, 62),
    "Shelf": (128, 90, 62),
    "Chair": (170, 62, 52),
    "Bowl": (238, 236, 228),
    "Mug": (52, 92, 158),
    "Fork": (176, 182, 190),
    "Knife": (176, 182, 190),
    "Spoon": (176, 182, 190),
    "MenuCard": (90, 130, 90),
}
_PLAIN: Colour = (160, 160, 160)


def scene_to_json(scene: Scene, meshes: bool = True) -> dict[str, Any]:
    """The scene as plain data.

    Args:
        scene: what to describe.
        meshes: whether the meshes go along; without them the result is the ground truth of a
            recording (class, pose, box and label of everything), and can only be loaded as a scene
            with the models' CAD files beside it.
    """
    models = {instance.model.name: instance.model for instance in scene.instances}
    document: dict[str, Any] = {
        "frame": FRAME_NOTE,
        "instances": [_instance_to_json(instance) for instance in scene.instances],
        "search_volumes": [
            {
                "name": volume.name,
                "center": _rounded(volume.box.pose.x, volume.box.pose.y, volume.box.pose.z),
                "size": _rounded(*volume.box.sizes),
                "yaw": round(volume.box.pose.yaw_rad, 9),
            }
            for volume in scene.search_volumes
        ],
        "next_label": scene.next_label,
    }
    if meshes:
        document["models"] = {name: _model_to_json(model) for name, model in models.items()}
    return document


def _rounded(*values: float) -> list[float]:
    # A nanometre: what is written, read and written again stays the same text.
    return [round(float(value), 9) + 0.0 for value in values]


def _pose_to_json(pose: Pose) -> list[float]:
    return _rounded(pose.x, pose.y, pose.z, *pose.rpy)


def _instance_to_json(instance: Instance) -> dict[str, Any]:
    box = instance.box
    return {
        "name": instance.name,
        "model": instance.model.name,
        "cls": instance.cls,
        "pose": _pose_to_json(instance.pose),
        "label": instance.label,
        "on": instance.on,
        "support": instance.support,
        "box": {
            "pose": _pose_to_json(box.pose),
            "size": _rounded(*box.sizes),
        },
    }


def _model_to_json(model: Model) -> dict[str, Any]:
    return {
        "cls": model.cls,
        "colour": list(model.colour),
        "vertices": model.mesh.vertices.tolist(),
        "triangles": model.mesh.triangles.tolist(),
        "solids": [list(solid) for solid in model.mesh.solids],
        "supports": [
            [s.name, s.x, s.y, s.z, s.x_size, s.y_size, s.clearance] for s in model.supports
        ],
        "polished": [list(part) for part in model.polished],
    }


def scene_from_json(document: Mapping[str, Any], mesh_folder: Path | None = None) -> Scene:
    """The scene that `scene_to_json` described.

    Args:
        document: plain data; `frame` and unknown keys are ignored.
        mesh_folder: where the CAD files of the models are that the document does not describe.

    Raises:
        InvalidInput: an entry is missing or malformed, or a model is neither described nor a file.
    """
    models: dict[tuple[str, str], Model] = {}
    instances: list[Instance] = []
    try:
        described: Mapping[str, Any] = document.get("models", {})
        for entry in document["instances"]:
            key = (str(entry["model"]), str(entry["cls"]))
            if key not in models:
                models[key] = _model_from_json(*key, described, mesh_folder)
            instances.append(
                Instance(
                    name=str(entry["name"]),
                    model=models[key],
                    pose=_pose_from_json(entry["pose"]),
                    label=int(entry.get("label", 0)),
                    on=str(entry.get("on", "")),
                    support=str(entry.get("support", "")),
                )
            )
        volumes = tuple(_volume_from_json(v) for v in document.get("search_volumes", ()))
        next_label = int(document.get("next_label", 1))
    except (KeyError, TypeError, ValueError) as error:
        what = f"no entry {error}" if isinstance(error, KeyError) else str(error)
        raise InvalidInput(f"not a scene: {what}; see the documentation of scene_json") from error
    return Scene(tuple(instances), volumes, next_label)


def load_scene(path: str | Path) -> Scene:
    """The scene of a JSON file, with the CAD files in `meshes` beside it.

    Where the file does not say what stands on what, the geometry decides.

    Raises:
        InvalidInput: the file is missing, not JSON, or not a scene.
    """
    path = Path(path)
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InvalidInput(f"cannot read the scene {path}: {error.strerror}") from error
    except ValueError as error:
        raise InvalidInput(f"the scene {path} is not JSON: {error}") from error
    if not isinstance(document, dict):
        raise InvalidInput(
            f"the scene {path} holds a {type(document).__name__}, expected an object"
        )
    return with_supports_resolved(scene_from_json(document, path.parent / "meshes"))


def _pose_from_json(values: Sequence[float]) -> Pose:
    if len(values) != 6:
        raise ValueError(f"a pose of {len(values)} numbers, expected x y z roll pitch yaw")
    return Pose.from_rpy(*(float(v) for v in values))


def _volume_from_json(entry: Mapping[str, Any]) -> SearchVolume:
    x, y, z = (float(v) for v in entry["center"])
    x_size, y_size, z_size = (float(v) for v in entry["size"])
    pose = Pose.from_rpy(x, y, z, yaw=float(entry.get("yaw", 0.0)))
    return SearchVolume(str(entry["name"]), BoundingBox(pose, x_size, y_size, z_size))


def _model_from_json(
    name: str, cls: str, described: Mapping[str, Any], mesh_folder: Path | None
) -> Model:
    if name in described:
        entry = described[name]
        red, green, blue = (int(v) for v in entry["colour"])
        mesh = Mesh(
            np.array(entry["vertices"], dtype=np.float64),
            np.array(entry["triangles"], dtype=np.int32),
            tuple((int(first), int(end)) for first, end in entry["solids"]),
        )
        supports = tuple(Support(str(s[0]), *(float(v) for v in s[1:])) for s in entry["supports"])
        polished = tuple((int(first), int(end)) for first, end in entry.get("polished", ()))
        return Model(name, cls, mesh, (red, green, blue), supports, polished)
    files = [mesh_folder / (name + suffix) for suffix in CAD_SUFFIXES] if mesh_folder else []
    for file in files:
        if file.is_file():
            mesh = load_mesh(file)
            colour = _CLASS_COLOURS.get(cls, _PLAIN)
            return Model(name, cls, mesh, colour, horizontal_supports(mesh))
    raise ValueError(
        f"model {name!r} is neither described under `models` nor a CAD file in {mesh_folder}"
    )
