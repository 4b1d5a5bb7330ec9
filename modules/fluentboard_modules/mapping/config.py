"""Settings of mapping, each with a unit and where its value comes from."""

from __future__ import annotations

from fluentboard_modules.mapping.furniture_config import (
    ExistenceConfig,
    FurnitureMapConfig,
    FusionConfig,
    HypothesisConfig,
)
from fluentboard_modules.mapping.surface_config import (
    CloudConfig,
    ContourConfig,
    DepthNoiseConfig,
    MeshConfig,
    NormalsConfig,
    SegmentationConfig,
    SurfacesConfig,
)
from fluentboard_modules.mapping.verification_config import (
    AlignmentConfig,
    CovarianceConfig,
    EvidenceConfig,
    OddsConfig,
    RefinementConfig,
    VerificationConfig,
    VisibilityConfig,
)
from fluentboard_modules.settings import Settings

__all__ = [
    "AlignmentConfig",
    "CloudConfig",
    "ContourConfig",
    "CovarianceConfig",
    "DepthNoiseConfig",
    "EvidenceConfig",
    "ExistenceConfig",
    "FurnitureMapConfig",
    "FusionConfig",
    "HypothesisConfig",
    "MappingConfig",
    "MeshConfig",
    "NormalsConfig",
    "OddsConfig",
    "RefinementConfig",
    "SegmentationConfig",
    "SurfacesConfig",
    "VerificationConfig",
    "VisibilityConfig",
]


class MappingConfig(Settings):
    """Everything the mapping module can be told."""

    surfaces: SurfacesConfig = SurfacesConfig()
    mesh: MeshConfig = MeshConfig()
    furniture: FurnitureMapConfig = FurnitureMapConfig()
    verification: VerificationConfig = VerificationConfig()
