"""Settings of the mapping algorithms, each with a unit and where its value comes from."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator


class _Settings(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class DepthNoiseConfig(_Settings):
    """Standard deviation of a depth reading: that of the Kinect (Nguyen, Izadi and Lovell 2012).

    sigma_z = `constant_m` + `quadratic_per_m` (z - `reference_m`)^2. On the 7-Scenes red kitchen
    the residuals of local plane fits are 0.9 times this (median over a frame, 0.8 to 3.3 m).
    """

    constant_m: float = Field(default=0.0012, gt=0.0)
    quadratic_per_m: float = Field(default=0.0019, ge=0.0)
    reference_m: float = Field(default=0.4, ge=0.0)
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


class NormalsConfig(_Settings):
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


class SegmentationConfig(_Settings):
    """Local planes to planar segments (DESIGN: connected at 8 degrees and 1.5 cm)."""

    step_px: int = Field(
        default=2, ge=1, description="One cell per so many pixels in both directions."
    )
    join_angle_deg: float = Field(default=8.0, gt=0.0, lt=90.0)
    join_distance_tolerances: float = Field(
        default=3.0,
        gt=0.0,
        description="In units of the depth tolerance; 3 of them are 1.6 cm at 1 m.",
    )
    seed_cells: int = Field(default=40, ge=4, description="Smallest segment that may grow.")
    planar_share: float = Field(
        default=0.9, gt=0.0, le=1.0, description="A component with fewer inliers is split."
    )
    grow_distance_tolerances: float = Field(default=3.0, gt=0.0)
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


class ContourConfig(_Settings):
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


class CloudConfig(_Settings):
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
    merge_angle_deg: float = Field(default=10.0, gt=0.0, lt=90.0)
    merge_distance_m: float = Field(
        default=0.04, gt=0.0, description="From the centre of one to the plane of the other."
    )
    merge_misfit_m: float = Field(
        default=0.015, gt=0.0, description="Of either part from their common plane."
    )
    merge_gap_m: float = Field(
        default=0.10, ge=0.0, description="As between segments of one image."
    )


class MeshConfig(_Settings):
    """The triangle mesh of the environment."""

    voxel_m: float = Field(default=0.02, gt=0.0)
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


class SurfacesConfig(_Settings):
    """Everything from a frame to its planar regions."""

    noise: DepthNoiseConfig = DepthNoiseConfig()
    normals: NormalsConfig = NormalsConfig()
    segmentation: SegmentationConfig = SegmentationConfig()
    contours: ContourConfig = ContourConfig()
    cloud: CloudConfig = CloudConfig()
    range_max_m: float = Field(
        default=6.0, gt=0.0, description="Beyond, a Kinect's depth is 7 cm off."
    )


class ExistenceConfig(_Settings):
    """Belief that something is there, per frame that could have shown it.

    The rates are nearer to each other than those of single frames, because the errors of frames
    that follow each other are alike: a backrest that is overlooked once is overlooked again.
    """

    prior: float = Field(
        default=0.13, gt=0.0, lt=1.0, description="Before any frame; five frames make it 0.71."
    )
    detection_rate: float = Field(
        default=0.7, gt=0.0, lt=1.0, description="Frames that show it if it is there and in sight."
    )
    false_alarm_rate: float = Field(
        default=0.4, gt=0.0, lt=1.0, description="Frames that seem to show it if it is not there."
    )
    belief_max: float = Field(
        default=0.97,
        gt=0.5,
        lt=1.0,
        description="However many frames; from there, seven that see through it make it 0.2.",
    )

    @model_validator(mode="after")
    def _tells(self) -> ExistenceConfig:
        if self.detection_rate <= self.false_alarm_rate:
            raise ValueError("detection_rate must be more than false_alarm_rate")
        return self


class FusionConfig(_Settings):
    """Regions of many frames to the planes of the map.

    The distances allow for poses and depth that agree to 2-4 cm only (7-Scenes red kitchen).
    """

    existence: ExistenceConfig = ExistenceConfig()
    cell_m: float = Field(default=0.02, gt=0.0, description="Grid on each plane.")
    same_angle_deg: float = Field(
        default=12.0, gt=0.0, lt=90.0, description="Small far regions are off by as much."
    )
    same_distance_m: float = Field(
        default=0.06,
        gt=0.0,
        description="Poses 2-4 cm off, twice over; boards and box tops are further.",
    )
    same_reach_cells: int = Field(
        default=2, ge=0, description="Overlap is judged with so much drift."
    )
    same_overlap: float = Field(
        default=0.15, gt=0.0, le=1.0, description="Share of the smaller that must overlap."
    )
    solid_share: float = Field(
        default=0.4,
        gt=0.0,
        lt=1.0,
        description="A cell stays if so many of those who could see it did.",
    )
    fringe_share: float = Field(
        default=0.1,
        ge=0.0,
        lt=1.0,
        description="Cells seen by a smaller share of the frames are drift.",
    )
    fringe_frames: int = Field(
        default=20,
        ge=1,
        description="The share is taken of at most so many frames: a corner seen twice.",
    )
    slope_prior_weight: float = Field(
        default=1.0e4,
        gt=0.0,
        description="Prior of the first normal, in cells at 1 cm standard deviation.",
    )
    pose_sigma_m: float = Field(
        default=0.02,
        gt=0.0,
        description="What one frame's pose adds to the position of its regions.",
    )
    see_through_m: float = Field(
        default=0.08, gt=0.0, description="Measured so far behind a plane, the plane is not there."
    )
    missed_share: float = Field(
        default=0.5,
        gt=0.0,
        le=1.0,
        description="Seen through in so much of its visible part: a miss.",
    )
    judged_share: float = Field(
        default=0.3, gt=0.0, le=1.0, description="Frames that see less of a plane do not judge it."
    )
    memory_frames: int = Field(
        default=24,
        ge=4,
        description="Evidence counts are halved beyond, so that a moved chair goes away.",
    )
    forget_ratio: float = Field(
        default=3.0,
        gt=0.0,
        description="Forget a plane that this many times more views missed than saw.",
    )
    forget_least_views: int = Field(
        default=5, ge=1, description="Views that miss a plane before that."
    )
    stamps_max: int = Field(
        default=1000, ge=1, description="Frames that are remembered by name, the last ones."
    )
    stale_share: float = Field(
        default=0.02, ge=0.0, description="Contours are traced anew after such a change of area."
    )
    stale_m: float = Field(
        default=0.003, ge=0.0, description="And after such a shift, or such a turn in radians."
    )
    planes_max: int = Field(
        default=400, ge=1, description="The smallest, longest unseen are dropped."
    )
    contours: ContourConfig = ContourConfig(simplify_m=0.015, smallest_hole_m2=0.01)


class AlignmentConfig(_Settings):
    """Scene to model ICP (DESIGN: point to point, then point to plane, Tukey, upright)."""

    spacing_m: float = Field(default=0.025, gt=0.0, description="One scene point per such cube.")
    points_max: int = Field(default=1200, ge=50, description="Scene points that are used.")
    points_least: int = Field(default=40, ge=3, description="With fewer near the model, it stays.")
    point_steps: int = Field(default=6, ge=0, description="Point to point.")
    plane_steps: int = Field(default=10, ge=1, description="Point to plane.")
    scale_first_m: float = Field(default=0.25, gt=0.0, description="Points beyond do not vote.")
    scale_last_m: float = Field(default=0.04, gt=0.0, description="And in the last step.")
    damping: float = Field(
        default=1.0e-3, gt=0.0, description="Holds what no point binds, per point."
    )
    sigma_least_m: float = Field(
        default=0.01, gt=0.0, description="Residuals are never better than the depth's bias."
    )
    independent_share: float = Field(
        default=0.02, gt=0.0, le=1.0, description="Errors of neighbouring points are alike."
    )


class VisibilityConfig(_Settings):
    """Counting explained, occluded and violated pixels."""

    tolerance_m: float = Field(
        default=0.05, gt=0.0, description="Poses and depth agree to 2-4 cm only (7-Scenes)."
    )
    tolerance_sigma: float = Field(default=3.0, gt=0.0, description="Far pixels may err by more.")
    pixel_step: int = Field(default=1, ge=1, description="Every so many pixels of thinned views.")
    overrun_reach_m: float = Field(
        default=0.12, gt=0.0, description="A surface that goes on so far beyond the outline does."
    )
    overrun_weight: float = Field(default=0.5, ge=0.0, description="Against violated area.")
    filled_weight: float = Field(default=0.5, ge=0.0, description="Against violated area.")
    against_weight: float = Field(
        default=1.0,
        gt=0.0,
        description="Of two poses, one square metre that speaks against makes up for so many that "
        "speak for it.",
    )
    floor_clear_m: float = Field(
        default=0.1, ge=0.0, description="The floor goes on beyond everything that stands on it."
    )
    doubt_m2: float = Field(
        default=0.02, gt=0.0, description="So much violation is assumed before anything is seen."
    )


class VerificationConfig(_Settings):
    """Hypotheses to verified furniture."""

    is_on: bool = Field(default=True, description="False leaves hypotheses as they are.")
    generic_models: bool = Field(
        default=True,
        description="Classes without a CAD file are judged by their planes; False: not believed.",
    )
    alignment: AlignmentConfig = AlignmentConfig()
    visibility: VisibilityConfig = VisibilityConfig()
    views_max: int = Field(default=5, ge=1, description="Views that a placement is judged by.")
    starts_max: int = Field(default=3, ge=1, description="Starts of the ICP, the best first.")
    crop_margin_m: float = Field(
        default=0.25, gt=0.0, description="Scene points so far around the model take part."
    )
    size_slack_m: float = Field(
        default=0.12, gt=0.0, description="What is seen of a top may be so much larger than it is."
    )
    accept_score: float = Field(
        default=0.75, ge=0.0, le=1.0, description="Explained share from which it is furniture."
    )
    accept_exact_score: float = Field(
        default=0.75,
        ge=0.0,
        le=1.0,
        description="The same for CAD files, which real pieces agree with better.",
    )
    relief_m: float = Field(
        default=0.017,
        gt=0.0,
        description="Books stand 2 to 5 cm behind the edges of their boards, walls do not.",
    )
    cases_per_frame: int = Field(
        default=2, ge=1, description="Hypotheses that one frame verifies: 0.1 to 0.3 s each."
    )
    again_factor: float = Field(
        default=1.5, ge=1.0, description="After so many times the frames, it is verified again."
    )
    again_moved_m: float = Field(
        default=0.04, gt=0.0, description="And when the hypothesis has moved or grown by this."
    )
    again_turned_rad: float = Field(default=0.07, gt=0.0, description="Or turned by this.")


class HypothesisConfig(_Settings):
    """First poses and boxes."""

    top_orientation: Literal["rectangle", "pca"] = Field(
        default="rectangle", description="Of tables and shelves; pca is that of section 3.2.2."
    )
    placing_height_m: float = Field(
        default=0.3, gt=0.0, description="Placing areas reach so far up: bottles are 0.3 m high."
    )


class FurnitureMapConfig(_Settings):
    """Hypotheses over many frames to furniture."""

    fusion: FusionConfig = FusionConfig()
    hypotheses: HypothesisConfig = HypothesisConfig()
    least_frames: int = Field(
        default=2, ge=1, description="Planes seen in fewer frames are not classified."
    )
    floor_reach_m: float = Field(
        default=0.15, ge=0.0, description="The floor is within this of z = 0 everywhere."
    )
    accept_score: float = Field(default=0.6, gt=0.0, lt=1.0, description="Furniture from here on.")
    drop_score: float = Field(default=0.3, gt=0.0, lt=1.0, description="No furniture any more.")
    patience_frames: int = Field(
        default=15,
        ge=0,
        description="Views of its main plane a piece survives without a hypothesis.",
    )
    same_place_overlap: float = Field(
        default=0.4,
        gt=0.0,
        le=1.0,
        description="Boxes of one class that overlap so much are one piece.",
    )
    other_place_overlap: float = Field(
        default=0.5,
        gt=0.0,
        le=1.0,
        description="Boxes of two classes that overlap so much cannot both be; a chair below a "
        "table can.",
    )
    exact_overlap: float = Field(
        default=0.15,
        gt=0.0,
        le=1.0,
        description="Pieces with CAD files that fit overlap no more than their poses are wrong.",
    )
    moved_m: float = Field(
        default=0.02, ge=0.0, description="Smaller changes of pose are not reported."
    )
    turned_rad: float = Field(default=0.05, ge=0.0, description="Smaller turns are not reported.")
    resized_m: float = Field(
        default=0.04, ge=0.0, description="Smaller changes of size are not reported."
    )
    rescored: float = Field(
        default=0.1, ge=0.0, description="Smaller changes of score are not reported."
    )


class MappingConfig(_Settings):
    """Everything the mapping module can be told."""

    surfaces: SurfacesConfig = SurfacesConfig()
    mesh: MeshConfig = MeshConfig()
    furniture: FurnitureMapConfig = FurnitureMapConfig()
    verification: VerificationConfig = VerificationConfig()
