"""Settings of anchoring, each with a unit and where its value comes from."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from fluentboard_modules.frames.depth_noise import KinectNoiseConfig
from fluentboard_modules.settings import Settings


class SupportConfig(Settings):
    """Tops that objects stand on, found by RANSAC among level patches."""

    range_max_m: float = Field(
        default=3.5, gt=0.0, description="Beyond, a mug has fewer than 20 x 20 pixels."
    )
    height_min_m: float = Field(
        default=0.55,
        description="Lower level surfaces are floors and seats, unless the camera is near them.",
    )
    floor_below_camera_m: float = Field(
        default=0.9,
        gt=0.0,
        description="What is less below the camera is no floor, whatever its height in the map.",
    )
    height_max_m: float = Field(default=1.6, description="Higher surfaces are out of reach.")
    level_deg: float = Field(
        default=20.0,
        gt=0.0,
        lt=90.0,
        description="Local patches tilted more are not part of a top; noise tilts them by 5.",
    )
    tilt_max_deg: float = Field(
        default=4.0,
        gt=0.0,
        lt=45.0,
        description="Gravity prior: poses and gravity are 2 degrees off (7-Scenes).",
    )
    samples: int = Field(default=60, ge=1, description="RANSAC draws per top.")
    tolerance_m: float = Field(
        default=0.008, gt=0.0, description="Distance of inliers, to which 2 sigma of noise add."
    )
    area_min_m2: float = Field(
        default=0.10, gt=0.0, description="Smaller tops are boxes, seats or books; in one frame."
    )
    known_area_min_m2: float = Field(
        default=0.04, gt=0.0, description="Of a part of a table that is known."
    )
    area_margin_m: float = Field(
        default=0.10,
        ge=0.0,
        description="Placing areas of the board are taken for a top but for so wide a rim.",
    )
    cell_m: float = Field(default=0.02, gt=0.0, description="Raster of outlines.")
    gap_m: float = Field(
        default=0.16,
        ge=0.0,
        description="Objects and their shadows leave gaps in a top; so wide ones are closed.",
    )
    tops_max: int = Field(default=6, ge=1, description="Per frame, the largest.")
    same_height_m: float = Field(
        default=0.06, gt=0.0, description="Views of one top agree so well: poses drift 2-4 cm."
    )


class SegmentationConfig(Settings):
    """Clusters of points above a top."""

    noise: KinectNoiseConfig = KinectNoiseConfig()
    rise_m: float = Field(
        default=0.006, gt=0.0, description="Points are above a top from here on, plus noise."
    )
    rise_sigma: float = Field(
        default=1.6, ge=0.0, description="Noise of the height that adds to it, averaged over 3x3."
    )
    height_max_m: float = Field(default=0.5, gt=0.0, description="Larger things are no tableware.")
    width_max_m: float = Field(default=0.6, gt=0.0, description="Largest horizontal extent.")
    flat_m: float = Field(
        default=0.03, ge=0.0, description="Lower clusters may be dents of the top: see below."
    )
    height_min_m: float = Field(
        default=0.007,
        gt=0.0,
        description="A flat cluster rises as much above the top around it, plus noise.",
    )
    height_min_sigma: float = Field(default=2.0, ge=0.0, description="Noise that adds to it.")
    rim_m: float = Field(
        default=0.03, ge=0.0, description="Flat clusters within so narrow a rim are the edge."
    )
    core_share: float = Field(
        default=0.35,
        ge=0.0,
        le=1.0,
        description="Of an object so many points lie within the rim; what has fewer is behind it.",
    )
    rim_sigma: float = Field(default=8.0, ge=0.0, description="Noise of height that adds to it.")
    join_m: float = Field(
        default=0.012, gt=0.0, description="Step in depth between neighbours of one object."
    )
    join_sigma: float = Field(default=4.0, ge=0.0, description="Noise that adds to it.")
    join_gap_px: int = Field(
        default=2, ge=1, description="Pixels without depth or on the top that a join may cross."
    )
    rejoin_m: float = Field(
        default=0.012, ge=0.0, description="Fragments nearer to a larger part belong to it."
    )
    rejoin_share: float = Field(
        default=0.25, ge=0.0, le=1.0, description="Fragments have at most so large a share of it."
    )
    hollow_m: float = Field(
        default=0.002,
        ge=0.0,
        description="The middle of a plate lies so far above the top around it, on the average; 0 "
        "joins nothing.",
    )
    hollow_rim_m: float = Field(
        default=0.045, gt=0.0, description="Higher parts are not pieces of a plate's rim."
    )
    hollow_width_max_m: float = Field(default=0.34, gt=0.0, description="Of a plate.")
    points_min: int = Field(
        default=60, ge=1, description="Smaller clusters are noise; a fork has 400 at 1.2 m."
    )
    edge_margin_px: int = Field(default=4, ge=0, description="As near to the border is cut off.")
    off_top_share: float = Field(
        default=0.5, gt=0.0, le=1.0, description="With more points beside the top it is no object."
    )
    hang_share: float = Field(
        default=0.10,
        gt=0.0,
        le=1.0,
        description="With so many points below the top, joined to it, it stands on the floor.",
    )
    neck_ratio: float = Field(
        default=0.6,
        gt=0.0,
        lt=1.0,
        description="Touching objects are cut where the silhouette is narrower by this.",
    )
    part_min_m: float = Field(
        default=0.03, gt=0.0, description="Width of a part that may be cut off; a handle has less."
    )


class TrackingConfig(Settings):
    """Track identifiers from frame to frame."""

    reach_m: float = Field(
        default=0.07, gt=0.0, description="Between frames; poses drift by 2-4 cm (7-Scenes)."
    )
    reach_per_s: float = Field(
        default=0.1, ge=0.0, description="Adds per second between the frames."
    )
    size_ratio_max: float = Field(
        default=3.0, gt=1.0, description="Longest edges of one object differ by less."
    )
    patience_s: float = Field(
        default=0.7, ge=0.0, description="A track survives so long without being seen."
    )
    pause_max_s: float = Field(
        default=3.0,
        ge=0.0,
        description="Of slower frames, the next one continues tracks if it comes so soon.",
    )


class FilterConfig(Settings):
    """Pose and size of an anchor over its observations."""

    across_sigma_m: float = Field(
        default=0.010, gt=0.0, description="Of a box's centre across the line of sight."
    )
    along_sigma_m: float = Field(
        default=0.025, gt=0.0, description="Along it: the far side is hidden."
    )
    hidden_factor: float = Field(
        default=4.0, ge=1.0, description="On sigma where a part is cut off or occluded."
    )
    pose_sigma_m: float = Field(
        default=0.015, ge=0.0, description="Of the camera's place; does not average out."
    )
    drift_m_per_sqrt_s: float = Field(
        default=0.005, ge=0.0, description="Objects are nudged now and then."
    )
    moved_sigma: float = Field(
        default=4.0, gt=0.0, description="A tracked object this far off has been moved: start anew."
    )
    growth_max: float = Field(
        default=1.4,
        gt=1.0,
        description="Once the size is known, views larger or smaller by more count a tenth.",
    )
    confidence_decay: float = Field(
        default=0.9, ge=0.0, lt=1.0, description="Weight of earlier recognitions; 0 keeps the last."
    )


class AssociationConfig(Settings):
    """Which new object is which untracked anchor."""

    method: Literal["gnn", "nn", "thesis", "murty"] = Field(
        default="gnn",
        description="One assignment with discover columns; nearest neighbour; Algorithm 4.1 as "
        "printed; or the k best assignments, carried on as hypotheses.",
    )
    gate_m: float = Field(
        default=0.40,
        gt=0.0,
        description="Anchors further away are not candidates; the thesis saw errors up to 0.3 m.",
    )
    hypotheses: int = Field(default=20, ge=1, description="For murty: assignments considered.")
    keep_share: float = Field(
        default=0.5,
        gt=0.0,
        le=1.0,
        description="For murty: a pair needs this share of the weight of all hypotheses.",
    )
    model: str | None = Field(
        default=None, description="File of a trained mismatch; the built-in one by default."
    )


class RemovalConfig(Settings):
    """Is this box visible and empty (Algorithm 4.2 with corrections)?"""

    shrink_m: float = Field(
        default=0.010,
        ge=0.0,
        description="Taken off every side, and twice at the bottom: the top is no object.",
    )
    points_max: int = Field(
        default=15, ge=1, description="Fewer points in or before the box: nothing is there (n)."
    )
    points_max_share: float = Field(
        default=0.15, ge=0.0, le=1.0, description="And at most this share of the box's pixels."
    )
    behind_min_share: float = Field(
        default=0.6,
        gt=0.0,
        le=1.0,
        description="Share of the pixels that must be seen behind the box: missing depth is none.",
    )
    behind_m: float = Field(
        default=0.005, ge=0.0, description="As much behind its far side counts as behind."
    )
    range_min_m: float = Field(default=0.4, ge=0.0, description="Nearest depth of a Kinect.")
    range_max_m: float = Field(default=4.0, gt=0.0, description="Farthest useful depth.")
    confirm_frames: int = Field(
        default=3, ge=1, description="Looks that find the place empty before an anchor goes."
    )


class WorldConfig(Settings):
    """Anchors over time."""

    filter: FilterConfig = FilterConfig()
    association: AssociationConfig = AssociationConfig()
    removal: RemovalConfig = RemovalConfig()
    confirm_frames: int = Field(
        default=3,
        ge=1,
        description="A track is anchored when so many frames have shown it; the thesis anchors at "
        "once.",
    )
    cut_off_weight: float = Field(
        default=0.34,
        gt=0.0,
        le=1.0,
        description="Of a frame whose border cuts the object off: corners hold most artefacts.",
    )
    overlap_same: float = Field(
        default=0.35,
        gt=0.0,
        le=1.0,
        description="What overlaps an anchor that is being seen so much is a piece of that object.",
    )
    overlap_replaced: float = Field(
        default=0.6,
        gt=0.0,
        le=1.0,
        description="An unseen anchor whose place another one takes so much has been replaced.",
    )


class UpdateConfig(Settings):
    """When the board is told (Section 4.2.4 asks for a threshold and a time-out)."""

    position_m: float = Field(
        default=0.03, gt=0.0, description="Poses of a hand-held Kinect agree to 2-4 cm."
    )
    angle_deg: float = Field(default=15.0, gt=0.0, description="Turn of an oblong object.")
    size_m: float = Field(default=0.03, gt=0.0, description="An edge grew as more was seen.")
    rest_s: float = Field(
        default=1.0, ge=0.0, description="Pose updates are not more frequent than this."
    )
    timeout_s: float = Field(
        default=30.0,
        gt=0.0,
        description="After so long smaller changes are written too.",
    )
    timeout_share: float = Field(
        default=0.2, ge=0.0, le=1.0, description="Share of the thresholds that counts then."
    )
    evidence_s: float = Field(
        default=10.0, ge=0.0, description="Class evidence is renewed no more often than this."
    )
    class_probability: float = Field(
        default=0.35, ge=0.0, le=1.0, description="Less sure objects are of `unknown_class`."
    )
    unknown_class: str = Field(
        default="PersonalItem", description="Class of objects that no class fits."
    )
    reclassify_probability: float = Field(
        default=0.95,
        gt=0.0,
        le=1.0,
        description="A fluent gives way to one of another class if that is so probable.",
    )
    reclassify_frames: int = Field(
        default=15, ge=0, description="And was in so many frames in a row; 0 never does."
    )


class DetectionsConfig(Settings):
    """Detections that an external detector posts to the board; see docs/reference/detectors.md."""

    fallback: str = Field(
        default="geometric",
        description="Recogniser of clusters that no detection fits: `geometric`, `spin-images`, "
        "`household` or a file.",
    )
    classes: tuple[str, ...] = Field(
        default=(), description="Classes of the detector that the fallback does not know."
    )
    names: dict[str, str] = Field(
        default={}, description="Class of the ontology by the detector's name, where they differ."
    )
    image_overlap_min: float = Field(
        default=0.3,
        gt=0.0,
        le=1.0,
        description="Of the boxes of detection and cluster in the image, as IoU: occluded objects "
        "have boxes around what is hidden, too.",
    )
    box_overlap_min: float = Field(
        default=0.1,
        gt=0.0,
        le=1.0,
        description="Of boxes in the map, as IoU: the far side of an object is not seen.",
    )
    tolerance_s: float = Field(
        default=0.01, ge=0.0, description="By which stamps of frame and detection may differ."
    )
    wait_s: float = Field(
        default=0.5, ge=0.0, description="How long a frame waits for its detections."
    )


class RecognitionConfig(Settings):
    """What rates the classes of single clusters and of whole scenes."""

    recogniser: str = Field(
        default="geometric",
        description="`geometric`, `spin-images` (tableware), `household` (the same for what "
        "else stands about: bottles, books, boxes, pepper mills), `detections` of an external "
        "detector, or the file of a trained recogniser.",
    )
    context: str | None = Field(
        default=None, description="`tableware`, or the file of a trained context model."
    )
    detections: DetectionsConfig = DetectionsConfig()


class AnchoringConfig(Settings):
    """Everything the anchoring module can be told."""

    supports: SupportConfig = SupportConfig()
    segmentation: SegmentationConfig = SegmentationConfig()
    tracking: TrackingConfig = TrackingConfig()
    world: WorldConfig = WorldConfig()
    update: UpdateConfig = UpdateConfig()
    recognition: RecognitionConfig = RecognitionConfig()
