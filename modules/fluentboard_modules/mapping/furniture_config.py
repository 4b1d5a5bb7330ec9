"""Settings of what is remembered: planes of many frames, hypotheses and furniture."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from fluentboard_modules.mapping.surface_config import ContourConfig
from fluentboard_modules.settings import Settings


class ExistenceConfig(Settings):
    """Belief that something is there, per look that could have shown it.

    The shares are those of six simulated rooms (`python -m bench existence`): 83 % of the looks
    show what is there and 2 % see through it; of what was removed 87 % see through its place. How
    alike looks are makes what 77 planes showed in 980 looks most likely: e^191 times as likely as
    if looks were independent.
    """

    prior: float = Field(
        default=0.1,
        gt=0.0,
        lt=1.0,
        description="Before any look; three of a drive make it 0.6, seven from one place do.",
    )
    shown_if_there: float = Field(
        default=0.83, gt=0.0, lt=1.0, description="Looks that show it if it is there and in sight."
    )
    shown_if_gone: float = Field(
        default=0.09, gt=0.0, lt=1.0, description="Looks that seem to show it if it is not there."
    )
    through_if_there: float = Field(
        default=0.02, gt=0.0, lt=1.0, description="Looks that see through it if it is there."
    )
    through_if_gone: float = Field(
        default=0.87, gt=0.0, lt=1.0, description="Looks that see through its place if it is not."
    )
    own_looks: float = Field(
        default=0.25,
        gt=0.0,
        description="Looks that the shares above are worth, beside earlier ones from there.",
    )
    alike: float = Field(
        default=0.35,
        gt=0.0,
        description="A sensor that has moved by so much of its distance sees 1/e of the same.",
    )
    belief_max: float = Field(
        default=0.97,
        gt=0.5,
        lt=1.0,
        description="However many looks; from there, three that see through it make it 0.3.",
    )

    @model_validator(mode="after")
    def _tells(self) -> ExistenceConfig:
        if self.shown_if_there <= self.shown_if_gone:
            raise ValueError("shown_if_there must be more than shown_if_gone")
        if self.through_if_gone <= self.through_if_there:
            raise ValueError("through_if_gone must be more than through_if_there")
        return self


class FusionConfig(Settings):
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


class HypothesisConfig(Settings):
    """First poses and boxes."""

    top_orientation: Literal["rectangle", "pca"] = Field(
        default="rectangle", description="Of tables and shelves; pca is that of section 3.2.2."
    )
    placing_height_m: float = Field(
        default=0.3, gt=0.0, description="Placing areas reach so far up: bottles are 0.3 m high."
    )


class FurnitureMapConfig(Settings):
    """Hypotheses over many frames to furniture."""

    fusion: FusionConfig = FusionConfig()
    hypotheses: HypothesisConfig = HypothesisConfig()
    least_frames: int = Field(
        default=2, ge=1, description="Planes seen in fewer frames are not classified."
    )
    look_frames: int = Field(
        default=4,
        ge=0,
        description="Recordings of so few frames are searched in one look: memory needs more.",
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
