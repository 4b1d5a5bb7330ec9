"""How much a depth reading of a Kinect scatters."""

from __future__ import annotations

from pydantic import Field

from fluentboard_modules.settings import Settings


class KinectNoiseConfig(Settings):
    """Standard deviation of a depth reading: that of the Kinect (Nguyen, Izadi and Lovell 2012).

    sigma_z = `constant_m` + `quadratic_per_m` (z - `reference_m`)^2.
    """

    constant_m: float = Field(default=0.0012, gt=0.0, description="At the reference.")
    quadratic_per_m: float = Field(
        default=0.0019, ge=0.0, description="How it grows with the depth."
    )
    reference_m: float = Field(default=0.4, ge=0.0, description="Depth where it is least.")
