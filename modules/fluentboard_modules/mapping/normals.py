"""Local planes of an organised depth image, fitted in inverse depth.

A plane n . p = d seen by a pinhole camera has, along the ray r = ((u - cx)/fx, (v - cy)/fy, 1), the
inverse depth q = m . r with m = n / d: linear in the pixel. So a plane fit is a linear regression
whose moments are separable image filters, and since a structured-light or stereo sensor measures
disparity, the noise of q is nearly the same everywhere: no point is weighted by its distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from fluentboard_modules.frames.sensor_frame import Camera
from fluentboard_modules.mapping.config import DepthNoiseConfig, NormalsConfig

Image = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class LocalPlanes:
    """Per cell, every so many pixels, the plane of its neighbourhood, in the camera frame.

    Attributes:
        inverse_depth: `(h, w)` float32; q in 1/m as measured, 0 where unknown.
        smooth_inverse_depth: `(h, w)` float32; q of the fitted plane at the pixel.
        coefficients: `(h, w, 3)` float32; m = n / d in 1/m, so that q = m . r.
        is_planar: `(h, w)`; whether the neighbourhood is one plane up to noise.
    """

    inverse_depth: Image
    smooth_inverse_depth: Image
    coefficients: NDArray[np.float32]
    is_planar: NDArray[np.bool_]


def depth_sigma_m(depth_m: Image, noise: DepthNoiseConfig) -> Image:
    """Standard deviation of depth readings in metres, same shape (Nguyen 2012, frontal)."""
    return noise.constant_m + noise.quadratic_per_m * (depth_m - noise.reference_m) ** 2


def depth_tolerance_m(depth_m: Image, noise: DepthNoiseConfig) -> Image:
    """Random and systematic depth error together in metres, same shape."""
    return np.sqrt(depth_sigma_m(depth_m, noise) ** 2 + noise.systematic_m**2)


def lateral_sigma_px(camera: Camera, noise: DepthNoiseConfig) -> float:
    """Standard deviation of a pixel's sideways position, in pixels of this camera."""
    return noise.lateral_px * camera.width / 640.0


def fit_local_planes(
    depth_m: Image,
    camera: Camera,
    config: NormalsConfig,
    noise: DepthNoiseConfig,
    step_px: int = 1,
) -> LocalPlanes:
    """The local plane of every cell that has one, by all pixels around it.

    Args:
        depth_m: `(h, w)` float32; metres, 0 where unknown.
        camera: the depth camera.
        config: window sizes and the limit on the residual.
        noise: what residual is to be expected.
        step_px: one cell per so many pixels in both directions.
    """
    valid = depth_m > 0.0
    q = np.divide(1.0, depth_m, out=np.zeros_like(depth_m), where=valid)
    lateral_px = lateral_sigma_px(camera, noise)
    fit = _fit_windows(q, valid, config.radius_px, config, noise, lateral_px, step_px)
    if config.fine_radius_px < config.radius_px:
        fine = _fit_windows(q, valid, config.fine_radius_px, config, noise, lateral_px, step_px)
        use_fine = fine.is_planar & ~fit.is_planar
        for coarse_part, fine_part in (
            (fit.slope_u, fine.slope_u),
            (fit.slope_v, fine.slope_v),
            (fit.value, fine.value),
            (fit.is_planar, fine.is_planar),
        ):
            np.copyto(coarse_part, fine_part, where=use_fine)
    u = (np.arange(0, camera.width, step_px, dtype=np.float32) - camera.cx)[None, :]
    v = (np.arange(0, camera.height, step_px, dtype=np.float32) - camera.cy)[:, None]
    coefficients = np.stack(
        [
            fit.slope_u * np.float32(camera.fx),
            fit.slope_v * np.float32(camera.fy),
            fit.value - fit.slope_u * u - fit.slope_v * v,
        ],
        axis=-1,
    ).astype(np.float32, copy=False)
    return LocalPlanes(q[::step_px, ::step_px], fit.value, coefficients, fit.is_planar)


@dataclass(frozen=True, slots=True)
class _WindowFit:
    slope_u: Image  # dq/du in 1/m per pixel
    slope_v: Image
    value: Image  # q of the plane at the window's centre
    is_planar: NDArray[np.bool_]


def _fit_windows(
    q: Image,
    valid: NDArray[np.bool_],
    radius: int,
    config: NormalsConfig,
    noise: DepthNoiseConfig,
    lateral_px: float,
    step_px: int,
) -> _WindowFit:
    """Least squares q = value + slope_u du + slope_v dv over the valid pixels of each window.

    A pixel that wanders sideways reads the slope as noise, so steep planes may fit less well.
    """
    offset = np.arange(-radius, radius + 1, dtype=np.float32)
    one = np.ones_like(offset)
    square = offset * offset
    weight = valid.astype(np.float32)

    def moment(image: Image, along_u: Image, along_v: Image) -> Image:
        everywhere = cv2.sepFilter2D(
            image, cv2.CV_32F, along_u, along_v, borderType=cv2.BORDER_CONSTANT
        )
        return np.ascontiguousarray(everywhere[::step_px, ::step_px])

    count = moment(weight, one, one)
    per_count = 1.0 / np.maximum(count, 1.0)
    mean_u = moment(weight, offset, one) * per_count
    mean_v = moment(weight, one, offset) * per_count
    mean_q = moment(q, one, one) * per_count
    var_u = moment(weight, square, one) * per_count - mean_u * mean_u
    var_v = moment(weight, one, square) * per_count - mean_v * mean_v
    cov_uv = moment(weight, offset, offset) * per_count - mean_u * mean_v
    cov_uq = moment(q, offset, one) * per_count - mean_u * mean_q
    cov_vq = moment(q, one, offset) * per_count - mean_v * mean_q
    var_q = moment(q * q, one, one) * per_count - mean_q * mean_q

    determinant = var_u * var_v - cov_uv * cov_uv
    # Half of a full window's spread in either direction: thinner strips do not fix a normal.
    enough = (
        valid[::step_px, ::step_px]
        & (count >= config.filled_share * one.size**2)
        & (determinant > 1e-3 * radius**4)
    )
    determinant[~enough] = 1.0
    slope_u = (cov_uq * var_v - cov_vq * cov_uv) / determinant
    slope_v = (cov_vq * var_u - cov_uq * cov_uv) / determinant
    value = mean_q - slope_u * mean_u - slope_v * mean_v
    variance = np.maximum(var_q - slope_u * cov_uq - slope_v * cov_vq, 0.0)

    enough &= value > 1e-3  # a kilometre: the fit has left the scene
    depth = 1.0 / np.where(enough, value, 1.0)
    expected = depth_sigma_m(depth, noise) * value * value  # sigma of q = sigma_z / z^2
    limit = (config.residual_max_sigma * expected) ** 2
    limit += (config.lateral_max_sigma * lateral_px) ** 2 * (slope_u * slope_u + slope_v * slope_v)
    planar = enough & (variance <= limit)
    return _WindowFit(slope_u, slope_v, value, planar)
