"""Settings of the mapping algorithms, each with a unit and where its value comes from."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field


class _Settings(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class DepthNoiseConfig(_Settings):
    """Standard deviation of a depth reading: that of the Kinect (Nguyen, Izadi and Lovell 2012).

    sigma_z = `constant_m` + `quadratic_per_m` (z - `reference_m`)^2. On the 7-Scenes red kitchen
    the residuals of local plane fits are 0.9 times this (median over a frame, 0.8 to 3.3 m).
    """

    constant_m: float = Field(0.0012, gt=0.0)
    quadratic_per_m: float = Field(0.0019, ge=0.0)
    reference_m: float = Field(0.4, ge=0.0)
    systematic_m: float = Field(
        0.005,
        ge=0.0,
        description="What does not average out: lens distortion bends a 1.5 m table by 1 cm.",
    )


class NormalsConfig(_Settings):
    """Local planes: windows of the organised depth image."""

    radius_px: int = Field(7, ge=1, description="Half window: 2.6 cm at 1 m, 7.7 cm at 3 m.")
    fine_radius_px: int = Field(
        4, ge=1, description="Half window where the larger one spans an edge: chair slats, rails."
    )
    filled_share: float = Field(
        0.5, gt=0.0, le=1.0, description="Share of the window that must have depth."
    )
    residual_max_sigma: float = Field(
        1.8, gt=0.0, description="Windows that fit worse span an edge; 1.0 is pure noise."
    )


class SegmentationConfig(_Settings):
    """Local planes to planar segments (DESIGN: connected at 8 degrees and 1.5 cm)."""

    step_px: int = Field(2, ge=1, description="One cell per so many pixels in both directions.")
    join_angle_deg: float = Field(8.0, gt=0.0, lt=90.0)
    join_distance_tolerances: float = Field(
        3.0, gt=0.0, description="In units of the depth tolerance; 3 of them are 1.6 cm at 1 m."
    )
    seed_cells: int = Field(40, ge=4, description="Smallest segment that may grow.")
    planar_share: float = Field(
        0.9, gt=0.0, le=1.0, description="A component with fewer inliers is split."
    )
    grow_distance_tolerances: float = Field(3.0, gt=0.0)
    grow_angle_deg: float = Field(
        25.0,
        gt=0.0,
        lt=90.0,
        description="Cells beside an edge have bad normals; this admits them.",
    )
    grow_margin: float = Field(
        0.1, ge=0.0, description="A larger plane keeps what fits a smaller one hardly better."
    )
    grow_margin_cells: int = Field(20, ge=0, description="How far a seed may grow at least.")
    grow_margin_share: float = Field(
        0.75, ge=0.0, description="How far a seed may grow, as a share of its own width or height."
    )
    merge_angle_deg: float = Field(
        12.0, gt=0.0, lt=90.0, description="Between mean local normals; the misfit decides finely."
    )
    merge_misfit: float = Field(
        1.5, gt=0.0, description="Root mean square misfit of either part, in depth tolerances."
    )
    merge_gap_m: float = Field(
        0.10, ge=0.0, description="A mug's shadow cuts a table; two chairs stand further apart."
    )
    segments_max: int = Field(96, ge=1, description="The largest so many are grown.")


class ContourConfig(_Settings):
    """Segments to polygons."""

    simplify_m: float = Field(0.01, ge=0.0, description="Douglas-Peucker tolerance on the plane.")
    smallest_hole_m2: float = Field(0.004, ge=0.0, description="Smaller holes are noise.")
    smallest_part_m2: float = Field(0.002, ge=0.0, description="Smaller islands are dropped.")
    smallest_region_m2: float = Field(
        0.008, ge=0.0, description="Below the smallest plane any furniture rule speaks of (0.01)."
    )
    edge_margin_px: int = Field(6, ge=0, description="As near to the border counts as touching.")


class SurfacesConfig(_Settings):
    """Everything from a depth image to its planar regions."""

    noise: DepthNoiseConfig = DepthNoiseConfig()
    normals: NormalsConfig = NormalsConfig()
    segmentation: SegmentationConfig = SegmentationConfig()
    contours: ContourConfig = ContourConfig()
    range_max_m: float = Field(6.0, gt=0.0, description="Beyond, a Kinect's depth is 7 cm off.")
