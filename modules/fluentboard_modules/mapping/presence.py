"""Which objects a simulated frame shows, and how much of each: who labels frames needs a rule.

Section 3.3.1 had a person write down which objects occur in each frame. Here an object occurs if it
fills a hundredth of the image and a quarter of what could be seen of it from there is in sight,
neither hidden nor beyond the image's border. Of what is less in sight nothing is expected, and a
detection of it counts neither for nor against. A person seems to have been stricter: the thesis
counts 1.5 objects per frame of the office and 3.1 of the seminar room, this rule about twice that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fluentboard.model.geometry import FloatArray, Transform
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.cad_models import CadModel, sample_surface
from fluentboard_modules.simulation.scene import Scene

SEEN_PX = 300  # of 640 x 480: less of it is nothing at all
EXPECTED_PX = 3000  # a hundredth of the image
EXPECTED_SHARE = 0.25

_SAMPLES = 600
_NEAREST_M = 0.1
_SELF_M = 0.02


@dataclass(frozen=True, slots=True)
class Sight:
    """How much of an object a frame shows.

    Attributes:
        pixels: of an image of 640 x 480.
        share: of the solid angle that its visible side fills, in [0, 1].
    """

    pixels: int
    share: float

    @property
    def is_hint(self) -> bool:
        """Whether there is anything of it."""
        return self.pixels >= SEEN_PX

    @property
    def is_expected(self) -> bool:
        """Whether it should be found."""
        return self.is_large and self.share >= EXPECTED_SHARE

    @property
    def is_large(self) -> bool:
        """Whether it fills enough of the image, however little of it that may be."""
        return self.pixels >= EXPECTED_PX


class Onlooker:
    """Looks at labelled frames of a scene; the books in a shelf are the shelf's.

    Args:
        scene: what there is.
        names: of the objects to look for.
        models: of their CAD models, in the same order.
    """

    def __init__(self, scene: Scene, names: Sequence[str], models: Sequence[CadModel]) -> None:
        self._names = list(names)
        row = {name: k + 1 for k, name in enumerate(self._names)}
        self._row_of = np.zeros(max((i.label for i in scene.objects), default=0) + 1, np.int64)
        for instance in scene.objects:
            owner = instance.name if instance.cls != "Book" else instance.on
            self._row_of[instance.label] = row.get(owner, 0)
        self._models = list(models)
        self._poses = [scene[name].pose.to_transform() for name in self._names]

    def look(self, frame: SensorFrame) -> dict[str, Sight]:
        """How much a frame shows of each object; of frames without labels nothing is known."""
        if frame.labels is None:
            return dict.fromkeys(self._names, Sight(0, 0.0))
        owners = self._row_of[np.maximum(frame.labels, 0)]
        counts = np.bincount(owners.ravel(), minlength=len(self._names) + 1)
        scale = 640 * 480 / owners.size
        found: dict[str, Sight] = {}
        for k, name in enumerate(self._names):
            pixels = int(counts[k + 1] * scale)
            share = 0.0
            if pixels >= SEEN_PX:
                share = _share(self._models[k], self._poses[k], frame, owners == k + 1)
            found[name] = Sight(pixels, share)
        return found


def _share(
    model: CadModel, T_map_model: Transform, frame: SensorFrame, own: NDArray[np.bool_]
) -> float:
    """Share of an object's visible side, by solid angle, that is in the image and not hidden."""
    surface = sample_surface(model.mesh, 0.0, _SAMPLES)
    T_sensor_model = frame.T_map_sensor.inverse() @ T_map_model
    points = T_sensor_model.apply(surface.points)
    normals = T_sensor_model.rotate(surface.normals)
    distance = np.linalg.norm(points, axis=1)
    cosine = -np.einsum("ij,ij->i", points, normals) / np.maximum(distance, 1e-6)
    faces = (cosine > 0.05) & (distance > _NEAREST_M)
    faces[faces] = ~_hides_itself(model, T_sensor_model.inverse(), surface.points[faces])
    if not faces.any():
        return 0.0
    weight = cosine[faces] / distance[faces] ** 2
    ahead = points[faces][:, 2] > _NEAREST_M
    pixels = np.zeros((len(weight), 2))
    pixels[ahead] = frame.camera.project(points[faces][ahead])
    column, row = np.rint(pixels).astype(int).T
    inside = ahead & (column >= 0) & (column < frame.camera.width)
    inside &= (row >= 0) & (row < frame.camera.height)
    seen = np.zeros(len(weight), dtype=np.bool_)
    seen[inside] = own[row[inside], column[inside]]
    return float(weight[seen].sum() / weight.sum())


def _hides_itself(
    model: CadModel, T_model_sensor: Transform, points: FloatArray
) -> NDArray[np.bool_]:
    """Which points of a model are behind others of it."""
    origin = np.broadcast_to(T_model_sensor.translation, points.shape)
    ray = points - origin
    length = np.linalg.norm(ray, axis=1)
    rays = np.concatenate([origin, ray / np.maximum(length, 1e-9)[:, None]], axis=1)
    return model.caster.cast(rays.astype(np.float32)).distance < length - _SELF_M
