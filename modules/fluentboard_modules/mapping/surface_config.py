"""Settings of what is seen: from frames to planar regions and the mesh."""

from __future__ import annotations

from pydantic import Field

from fluentboard_modules.frames.depth_noise import KinectNoiseConfig
from fluentboard_modules.settings import Settings


class DepthNoiseConfig(KinectNoiseConfig):
    """What a depth reading is known to: the noise of a Kinect, and all that adds to it.

    On the 7-Scenes red kitchen the residuals of local plane fits are 0.9 times the noise (median
    over a frame, 0.8 to 3.3 m).
    """

    systematic_m: float = Field(
        default=0.005,
        ge=0.0,
        description="What does not average out: lens distortion bends a 1.5 m table by 1 cm.",
    )
    quantisation_per_m: float = Field(
        default=0.00083,
        ge=0.0,
        description="Rounding of the disparity to 1/8 px (Khoshelham 2012): a standard deviation "
        "per square metre of depth. A flat wall at 4 m is no rough one.",
    )
    doubt_share: float = Field(
        default=0.1,
        ge=0.0,
        description="The variance itself is known so well only; a surface is rough beyond it.",
    )
    lateral_px: float = Field(
        default=0.8,
        ge=0.0,
        description="Sideways wander of a pixel at 640 columns (Nguyen 2012, Eq. 2): it shows as "
        "depth noise where a surface is seen at a grazing angle.",
    )


class NormalsConfig(Settings):
    """Local planes: windows of the organised depth image."""

    radius_px: int = Field(
        default=7, ge=1, description="Half window: 2.6 cm at 1 m, 7.7 cm at 3 m."
    )
    fine_radius_px: int = Field(
        default=4,
        ge=1,
        description="Half window where the larger one spans an edge: chair slats, rails.",
    )
    filled_share: float = Field(
        default=0.5, gt=0.0, le=1.0, description="Share of the window that must have depth."
    )
    residual_max_sigma: float = Field(
        default=1.8, gt=0.0, description="Windows that fit worse span an edge; 1.0 is pure noise."
    )
    lateral_max_sigma: float = Field(
        default=1.25,
        ge=0.0,
        description="The same for the sideways wander of pixels. A window across an edge fits a "
        "steep plane with a residual of 1.9 of these.",
    )


class SegmentationConfig(Settings):
    """Local planes to planar segments: connected components, grown and merged."""

    step_px: int = Field(
        default=2, ge=1, description="One cell per so many pixels in both directions."
    )
    join_angle_deg: float = Field(
        default=8.0, gt=0.0, lt=90.0, description="Neighbours of one plane differ by less."
    )
    join_distance_tolerances: float = Field(
        default=3.0,
        gt=0.0,
        description="In units of the depth tolerance; 3 of them are 1.6 cm at 1 m.",
    )
    seed_cells: int = Field(default=40, ge=4, description="Smallest segment that may grow.")
    planar_share: float = Field(
        default=0.9, gt=0.0, le=1.0, description="A component with fewer inliers is split."
    )
    grow_distance_tolerances: float = Field(
        default=3.0, gt=0.0, description="The same for cells that a plane grows by."
    )
    grow_angle_deg: float = Field(
        default=25.0,
        gt=0.0,
        lt=90.0,
        description="Cells beside an edge have bad normals; this admits them.",
    )
    grow_margin: float = Field(
        default=0.1,
        ge=0.0,
        description="A larger plane keeps what fits a smaller one hardly better.",
    )
    grow_margin_cells: int = Field(
        default=20, ge=0, description="How far a seed may grow at least."
    )
    grow_margin_share: float = Field(
        default=0.75,
        ge=0.0,
        description="How far a seed may grow, as a share of its own width or height.",
    )
    merge_angle_deg: float = Field(
        default=12.0,
        gt=0.0,
        lt=90.0,
        description="Between mean local normals; the misfit decides finely.",
    )
    merge_misfit: float = Field(
        default=1.5,
        gt=0.0,
        description="Root mean square misfit of either part, in depth tolerances.",
    )
    merge_gap_m: float = Field(
        default=0.10,
        ge=0.0,
        description="A mug's shadow cuts a table; two chairs stand further apart.",
    )
    segments_max: int = Field(default=96, ge=1, description="The largest so many are grown.")


class ContourConfig(Settings):
    """Segments to polygons."""

    simplify_m: float = Field(
        default=0.01, ge=0.0, description="Douglas-Peucker tolerance on the plane."
    )
    smallest_hole_m2: float = Field(default=0.004, ge=0.0, description="Smaller holes are noise.")
    smallest_part_m2: float = Field(
        default=0.002, ge=0.0, description="Smaller islands are dropped."
    )
    smallest_region_m2: float = Field(
        default=0.008,
        ge=0.0,
        description="Below the smallest plane any furniture rule speaks of (0.01).",
    )
    edge_margin_px: int = Field(
        default=6, ge=0, description="As near to the border counts as touching."
    )


class CloudConfig(Settings):
    """Planes of clouds without rows and columns, and of many registered frames."""

    voxel_m: float = Field(default=0.02, gt=0.0, description="One mean point per voxel.")
    planar_residual_m: float = Field(
        default=0.012,
        gt=0.0,
        description="Root mean square within 5 voxels; edges and clutter exceed it.",
    )
    grow_angle_deg: float = Field(
        default=18.0, gt=0.0, lt=90.0, description="Of a voxel's normal to the segment's."
    )
    grow_distance_m: float = Field(
        default=0.025, gt=0.0, description="Registered frames agree to 2-4 cm only."
    )
    border_angle_deg: float = Field(
        default=40.0, gt=0.0, lt=90.0, description="Voxels beside an edge have bad normals."
    )
    seed_voxels: int = Field(default=40, ge=4, description="Smallest segment; 160 cm^2 at 2 cm.")
    merge_angle_deg: float = Field(
        default=10.0, gt=0.0, lt=90.0, description="Planes that differ by more stay apart."
    )
    merge_distance_m: float = Field(
        default=0.04, gt=0.0, description="From the centre of one to the plane of the other."
    )
    merge_misfit_m: float = Field(
        default=0.015, gt=0.0, description="Of either part from their common plane."
    )
    merge_gap_m: float = Field(
        default=0.10, ge=0.0, description="As between segments of one image."
    )


class SurfacesConfig(Settings):
    """Everything from a frame to its planar regions."""

    noise: DepthNoiseConfig = DepthNoiseConfig()
    normals: NormalsConfig = NormalsConfig()
    segmentation: SegmentationConfig = SegmentationConfig()
    contours: ContourConfig = ContourConfig()
    cloud: CloudConfig = CloudConfig()
    range_max_m: float = Field(
        default=6.0, gt=0.0, description="Beyond, a Kinect's depth is 7 cm off."
    )


class MeshConfig(Settings):
    """The triangle mesh of the environment."""

    voxel_m: float = Field(default=0.02, gt=0.0, description="Side of a voxel of the mesh.")
    range_max_m: float = Field(
        default=5.0, gt=0.0, description="Beyond, a Kinect's depth is 4 cm off."
    )
    truncation_voxels: float = Field(
        default=4.0, ge=1.0, description="Registered frames agree to 2-4 cm only."
    )
    least_weight: float = Field(
        default=3.0, ge=0.0, description="Surfaces seen less often are noise, given many frames."
    )
    edge_share: float = Field(
        default=0.04,
        gt=0.0,
        description="Neighbouring pixels of one surface differ by less of their depth.",
    )
    blocks: int = Field(default=8_000, ge=1, description="Of 16^3 voxels at first; it grows.")
