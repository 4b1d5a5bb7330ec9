"""Depth noise of a structured-light camera, after measurements of the Kinect.

Sources: axial and lateral noise from Nguyen, Izadi and Lovell, "Modeling Kinect sensor noise for
improved 3D reconstruction and tracking", 3DIMPVT 2012; quantisation of the disparity to 1/8 px from
Khoshelham and Elberink, Sensors 12 (2012).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fluentboard.model.geometry import FloatArray
from fluentboard_modules.settings import Settings
from fluentboard_modules.simulation.noise_kernels import (
    STEEPEST_RAD,
    measured,
    shadow_of_projector,
)


class NoiseConfig(Settings):
    """How a depth camera errs. The defaults are a Kinect; `NoiseConfig.none()` is exact."""

    axial: float = Field(default=1.0, ge=0.0)
    """Factor on the standard deviation of the depth; 1 as measured (Nguyen 2012, Eq. 3)."""

    lateral: float = Field(default=1.0, ge=0.0)
    """Factor on the sideways wander of a pixel; 1 as measured (Nguyen 2012, Eq. 2)."""

    quantisation: bool = True
    """Round the disparity to `disparity_step_px` (Khoshelham 2012)."""

    disparity_step_px: float = Field(default=0.125, gt=0.0)
    """Kinect: 1/8 pixel."""

    shadow: bool = True
    """Lose the depth that the infrared projector cannot see past a nearer edge."""

    baseline_m: float = Field(default=0.075, gt=0.0)
    """Projector to camera, to the right in the image (Khoshelham 2012: 7.5 cm)."""

    focal_px: float = Field(default=580.0, gt=0.0)
    """Of the camera the formulas were measured with, at 640 px image width."""

    grazing_from_rad: float = Field(default=math.radians(75.0), ge=0.0, le=math.pi / 2)
    """Incidence from which pixels get lost; Nguyen measured clean data up to 60 deg and rapid decay
    beyond, the ramp is ours."""

    grazing_to_rad: float = Field(default=math.radians(87.0), ge=0.0, le=math.pi / 2)
    """Incidence from which every pixel is lost."""

    dropout: float = Field(default=0.001, ge=0.0, le=1.0)
    """Share of pixels lost for no visible reason."""

    polished: float = Field(default=0.95, ge=0.0, le=1.0)
    """Share of pixels lost on polished metal, which mirrors the projected pattern away; ours."""

    @classmethod
    def none(cls) -> NoiseConfig:
        """A camera without error."""
        return cls(
            axial=0.0,
            lateral=0.0,
            quantisation=False,
            shadow=False,
            grazing_from_rad=math.pi / 2,
            grazing_to_rad=math.pi / 2,
            dropout=0.0,
            polished=0.0,
        )

    @property
    def is_exact(self) -> bool:
        """Whether nothing would be changed."""
        return self == NoiseConfig.none()


@dataclass(frozen=True, slots=True)
class NoisyDepth:
    """A depth image after the noise.

    Attributes:
        depth_m: `(h, w)` float32; 0 where nothing was measured.
        source: `(h, w)` int64; flat index of the pixel of the clean images that each pixel shows,
            for labels and other images that must agree with the depth.
    """

    depth_m: NDArray[np.float32]
    source: NDArray[np.int64]


def axial_sigma_m(depth_m: FloatArray, incidence_rad: FloatArray) -> FloatArray:
    """Standard deviation of the depth in metres (Nguyen 2012, Eq. 3).

    sigma_z(z, a) = 0.0012 + 0.0019 (z - 0.4)^2 + 0.0001 / sqrt(z) * (a / (pi/2 - a))^2

    Args:
        depth_m: `(...)`; z, positive.
        incidence_rad: `(...)`; a, the angle between the line of sight and the surface normal.
    """
    steep = _steepness(incidence_rad)
    frontal = 0.0012 + 0.0019 * (depth_m - 0.4) ** 2
    return frontal + 0.0001 / np.sqrt(np.maximum(depth_m, 1e-3)) * steep**2


def lateral_sigma_px(incidence_rad: FloatArray) -> FloatArray:
    """Standard deviation of a pixel's sideways position at 640 px width (Nguyen 2012, Eq. 2).

    sigma_L(a) = 0.8 + 0.035 a / (pi/2 - a)
    """
    return 0.8 + 0.035 * _steepness(incidence_rad)


def _steepness(incidence_rad: FloatArray) -> FloatArray:
    """The factor a / (pi/2 - a), cut off below 90 deg where it has its pole."""
    angle = np.minimum(incidence_rad, STEEPEST_RAD)
    return angle / (0.5 * math.pi - angle)


def projector_shadow(
    depth_m: NDArray[np.floating[Any]], focal_px: float, baseline_m: float
) -> NDArray[np.bool_]:
    """`(h, w)`; which pixels the projector, `baseline_m` to the right of the camera, cannot reach.

    Every row is drawn into the projector's own row, where the nearest surface wins; what lies more
    than two pixels of disparity behind it is in its shadow, to the left of the nearer surface.

    Args:
        depth_m: `(h, w)`; 0 or infinite where there is no surface.
        focal_px: of the camera.
        baseline_m: metres.
    """
    shadow = np.zeros(depth_m.shape, dtype=np.bool_)
    shadow_of_projector(np.ascontiguousarray(depth_m), focal_px * baseline_m, shadow)
    return shadow


def noisy_depth(
    depth_m: NDArray[np.float32],
    incidence_rad: NDArray[np.floating[Any]],
    focal_px: float,
    config: NoiseConfig,
    rng: np.random.Generator,
    polished: NDArray[np.bool_] | None = None,
) -> NoisyDepth:
    """What the camera measures instead of the true depth.

    Args:
        depth_m: `(h, w)`; true depth in metres, 0 or infinite where there is nothing.
        incidence_rad: `(h, w)`; angle between the line of sight and the surface normal.
        focal_px: of the camera; a smaller image has a smaller lateral noise in pixels.
        config: which errors, and how large.
        rng: source of all randomness.
        polished: `(h, w)`; which pixels show polished metal.
    """
    clean = np.where(np.isfinite(depth_m), depth_m, 0.0).astype(np.float32)
    incidence = np.ascontiguousarray(incidence_rad, dtype=np.float32)
    lost = clean <= 0.0
    if config.shadow:
        lost |= projector_shadow(clean, focal_px, config.baseline_m)
    ramp = max(config.grazing_to_rad - config.grazing_from_rad, 1e-9)
    if incidence.max(initial=0.0) > config.grazing_from_rad:
        fading = (incidence - np.float32(config.grazing_from_rad)) * np.float32(1.0 / ramp)
        lost |= rng.random(clean.shape, dtype=np.float32) < fading
    if polished is not None and config.polished > 0.0 and polished.any():
        lost |= polished & (rng.random(clean.shape, dtype=np.float32) < config.polished)
    clean[lost] = 0.0

    nothing = np.zeros((0, 0), dtype=np.float32)
    is_wandering, is_axial, is_dropping = config.lateral > 0, config.axial > 0, config.dropout > 0
    depth = np.zeros(clean.shape, dtype=np.float32)
    source = np.zeros(clean.shape, dtype=np.int64)
    measured(
        clean,
        incidence,
        rng.standard_normal((2, *clean.shape), dtype=np.float32) if is_wandering else nothing[None],
        rng.standard_normal(clean.shape, dtype=np.float32) if is_axial else nothing,
        rng.random(clean.shape, dtype=np.float32) if is_dropping else nothing,
        config.lateral * focal_px / config.focal_px,
        config.axial,
        config.focal_px * config.baseline_m,
        config.disparity_step_px if config.quantisation else 0.0,
        config.dropout,
        depth,
        source,
    )
    return NoisyDepth(depth, source)
