"""A simulated RGB-D camera: depth, shaded colour and instance labels of a scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fluentboard.errors import InvalidConfiguration
from fluentboard.model.geometry import Transform
from fluentboard_modules.frames.sensor_frame import Camera, SensorFrame
from fluentboard_modules.simulation.noise import NoiseConfig, noisy_depth
from fluentboard_modules.simulation.noise_kernels import incidence_of_hits
from fluentboard_modules.simulation.raycasting import Hits, SceneCaster
from fluentboard_modules.simulation.scene import Scene

BACKGROUND_COLOUR = (196, 208, 222)

# Direction and strength of lamps besides the light from all sides: no two sides of a box are alike.
_LAMPS = ((0.35, 0.25, 0.9, 0.5), (-0.6, -0.45, 0.3, 0.22), (0.8, -0.5, 0.1, 0.14))
_AMBIENT = 0.5


class RgbdSensor:
    """A depth camera with a registered colour image.

    It keeps what it built for the last scene, so looking at the same scene again is cheap.

    Attributes:
        camera: the pinhole of all its images.
        noise: how it errs.
        range_m: nearest and farthest depth it reports, in metres.
        name: of the sensor, as its frames carry it.

    Raises:
        InvalidConfiguration: the range is empty or negative.
    """

    def __init__(
        self,
        camera: Camera,
        noise: NoiseConfig | None = None,
        range_m: tuple[float, float] = (0.4, 5.0),
        name: str = "camera",
        threads: int = 1,
    ) -> None:
        if not 0.0 <= range_m[0] < range_m[1]:
            raise InvalidConfiguration(
                f"sensor range {range_m} m is empty; give nearest and farthest depth"
            )
        self.camera = camera
        self.noise = noise if noise is not None else NoiseConfig.none()
        self.range_m = range_m
        self.name = name
        self._threads = threads
        self._directions = camera.rays().astype(np.float32)
        self._ray_length = np.linalg.norm(self._directions, axis=-1)
        self._scene: Scene | None = None
        self._caster: SceneCaster | None = None
        self._shade: NDArray[np.uint8] | None = None

    def look(
        self,
        scene: Scene,
        T_map_sensor: Transform,
        stamp_s: float,
        rng: np.random.Generator,
        index: int = 0,
    ) -> SensorFrame:
        """One frame from that pose.

        Args:
            scene: what there is to see.
            T_map_sensor: takes points of the optical frame to the map frame.
            stamp_s: time of the frame.
            rng: source of the noise; not used by a sensor without noise.
            index: running number of the frame.

        Returns:
            Depth in metres with 0 where nothing is measured; colour registered to it; labels that
            are 0 on the room itself, on nothing, and wherever the depth is 0.
        """
        caster, shade = self._prepared(scene)
        hits = caster.cast_camera(self._directions, T_map_sensor)
        depth = np.where(np.isfinite(hits.distance), hits.distance, np.float32(0.0))
        labels = np.append(caster.triangle_label, np.int32(0))[hits.triangle]
        if not self.noise.is_exact:
            incidence = self._incidence_rad(caster, hits, T_map_sensor)
            polished = np.append(caster.triangle_polished, False)[hits.triangle]
            measured = noisy_depth(depth, incidence, self.camera.fx, self.noise, rng, polished)
            depth = measured.depth_m
            labels = labels.ravel()[measured.source]
        near, far = self.range_m
        depth = np.where((depth >= near) & (depth <= far), depth, np.float32(0.0))
        labels = np.where(depth > 0.0, labels, np.int32(0))
        return SensorFrame(
            depth_m=depth,
            camera=self.camera,
            stamp_s=stamp_s,
            T_map_sensor=T_map_sensor,
            colour=shade[hits.triangle],
            labels=labels,
            sensor=self.name,
            index=index,
        )

    def _prepared(self, scene: Scene) -> tuple[SceneCaster, NDArray[np.uint8]]:
        if self._caster is None or self._shade is None or scene is not self._scene:
            self._caster = SceneCaster(scene, self._threads)
            self._shade = shaded_triangles(self._caster)
            self._scene = scene
        return self._caster, self._shade

    def _incidence_rad(
        self, caster: SceneCaster, hits: Hits, T_map_sensor: Transform
    ) -> NDArray[np.float32]:
        # Turning the few normals into the camera frame is cheaper than turning all rays.
        normals = caster.triangle_normal @ T_map_sensor.rotation.astype(np.float32)
        incidence = np.zeros(hits.triangle.shape, dtype=np.float32)
        incidence_of_hits(
            hits.triangle.ravel(),
            normals,
            self._directions.reshape(-1, 3),
            self._ray_length.ravel(),
            incidence.ravel(),
        )
        return incidence


def shaded_triangles(caster: SceneCaster) -> NDArray[np.uint8]:
    """`(m + 1, 3)`; the Lambert-shaded colour of every triangle, and last that of the background.

    The last row is what index -1, a ray without a hit, picks.
    """
    normal = caster.triangle_normal
    light = np.full(len(normal), _AMBIENT, dtype=np.float32)
    for x, y, z, strength in _LAMPS:
        direction = np.array([x, y, z]) / np.linalg.norm([x, y, z])
        light += strength * np.maximum(normal @ direction.astype(np.float32), 0.0)
    lit = np.minimum(caster.triangle_colour * light[:, None], 255.0)
    return np.vstack([lit, BACKGROUND_COLOUR]).astype(np.uint8)
