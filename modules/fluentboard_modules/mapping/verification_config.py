"""Settings of the check of hypotheses: placing CAD models and judging them."""

from __future__ import annotations

from pydantic import Field

from fluentboard_modules.settings import Settings


class AlignmentConfig(Settings):
    """Scene to model ICP (point to point, then point to plane, Tukey weights, upright)."""

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


class RefinementConfig(Settings):
    """The last steps of an alignment, on all pixels that show the model."""

    steps: int = Field(default=5, ge=1, description="Each draws the model anew.")
    scale_first_m: float = Field(
        default=0.05, gt=0.0, description="Pixels that are further off do not vote."
    )
    scale_last_m: float = Field(default=0.025, gt=0.0, description="And in the last step.")
    independent_share: float = Field(
        default=0.25, gt=0.0, le=1.0, description="Pixels that err independently of the others."
    )
    bias_m: float = Field(
        default=0.004, gt=0.0, description="What depth is off besides its noise, per pixel."
    )
    edge_m: float = Field(
        default=0.05, gt=0.0, description="Where the drawn depth steps by more is an edge."
    )
    damping: float = Field(
        default=1.0e-3, gt=0.0, description="Holds what no pixel binds, share of the rest."
    )
    pixels_least: int = Field(default=60, ge=1, description="With fewer, the pose stays.")


class CovarianceConfig(Settings):
    """How far a verified pose may be off.

    Set so that the squared errors of 424 true poses in simulated rooms (seeds 1 and 31), over
    their variances, are in the mean 0.9 (chairs) to 3.1 (tables in rows), where 3 is expected.
    """

    floor_m: float = Field(default=0.002, ge=0.0, description="Errors that all pixels share.")
    floor_rad: float = Field(default=0.004, ge=0.0, description="The same of the heading.")
    contents_m: float = Field(
        default=0.02, ge=0.0, description="Along a shelf: books hide where its sides are."
    )
    noticed: float = Field(
        default=0.01,
        gt=0.0,
        lt=1.0,
        description="Where a model is moved and loses less of what speaks for it, nobody notices.",
    )
    doubt: float = Field(
        default=0.03,
        gt=0.0,
        lt=1.0,
        description="A place that loses so much of what speaks for it is 1/e times as likely.",
    )


class OddsConfig(Settings):
    """Log-odds that a piece is there, linear in what speaks for it."""

    intercept: float = Field(description="Before anything is known.")
    explained: float = Field(description="Per unit of the share of what was seen.")
    closeness: float = Field(description="Of the same, each pixel less the further off it is.")
    outline: float = Field(description="Of the outline beyond which one sees farther.")
    misfit: float = Field(default=0.0, description="Of the logarithm of the misfit.")
    relief: float = Field(default=0.0, description="Of the relief of a front, as a share of its.")


class EvidenceConfig(Settings):
    """How evidence for a CAD model becomes a probability.

    Logistic regressions, true and false weighed alike, on the 1,024 hypotheses of 96 frames of
    simulated offices and seminar rooms (seeds 31 and 32).
    """

    outline_m: float = Field(
        default=0.03, gt=0.0, description="A surface that goes on so near to a plane is in it."
    )
    misfit_max: float = Field(
        default=4.0, gt=1.0, description="Frames that disagree by centimetres say no more."
    )
    relief_m: float = Field(
        default=0.017,
        gt=0.0,
        description="Books stand 2 to 5 cm behind the edges of their boards, walls do not.",
    )
    bodies: OddsConfig = Field(
        default=OddsConfig(intercept=-11.7, explained=6.7, closeness=5.8, outline=3.8, misfit=-1.2),
        description="Of what was recognised by a seat, a top or a back.",
    )
    fronts: OddsConfig = Field(
        default=OddsConfig(intercept=-12.1, explained=7.0, closeness=3.2, outline=3.2, relief=3.7),
        description="Of what was recognised by its front: what stands in it spoils the misfit.",
    )


class VisibilityConfig(Settings):
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


class VerificationConfig(Settings):
    """Hypotheses to verified furniture."""

    is_on: bool = Field(default=True, description="False leaves hypotheses as they are.")
    generic_models: bool = Field(
        default=True,
        description="Classes without a CAD file are judged by their planes; False: not believed.",
    )
    alignment: AlignmentConfig = AlignmentConfig()
    refinement: RefinementConfig = RefinementConfig()
    covariance: CovarianceConfig = CovarianceConfig()
    evidence: EvidenceConfig = EvidenceConfig()
    visibility: VisibilityConfig = VisibilityConfig()
    threads: int = Field(
        default=2, ge=1, description="Hypotheses verified at the same time; the result is the same."
    )
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
        default=0.5,
        ge=0.0,
        le=1.0,
        description="Of a CAD file, the probability from which it is believed, besides.",
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
    visit_gap_s: float = Field(
        default=30.0,
        gt=0.0,
        description="After a pause of more than this, furniture may have been moved.",
    )
