"""Training the mismatch of object and anchor on runs past labelled tables.

The linear SVM of Section 4.2.2.1 learns what tells pairs apart. Its boundary is then moved to where
the assignment decides best: of all pairs only one in five is one object, but of all new tracks near
an untracked anchor nine in ten are known, so a boundary that is best for pairs makes too many new
anchors. Deviates from the thesis, which takes the boundary of the pairs.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fluentboard_modules.anchoring.config import AssociationConfig
from fluentboard_modules.anchoring.evaluation_association import decisions, labelled_pairs
from fluentboard_modules.anchoring.evaluation_records import SceneRecord
from fluentboard_modules.anchoring.similarity import (
    FEATURE_SETS,
    MismatchModel,
    train_mismatch,
)

_FACTORS = np.arange(0.6, 3.01, 0.2)
_AS_GOOD = 0.0025  # shares of right decisions that differ by less say nothing


@dataclass(frozen=True, slots=True)
class MismatchTraining:
    """A trained mismatch, and what it rests on.

    Attributes:
        model: the mismatch.
        pairs: how many pairs it was trained on.
        same: how many of them are one object.
        right: share of the decisions on the training runs that are right.
    """

    model: MismatchModel
    pairs: int
    same: int
    right: float


def train_on_runs(
    runs: Sequence[SceneRecord],
    features: Sequence[str] = FEATURE_SETS["a"],
    classes: Sequence[str] = (),
    association: AssociationConfig | None = None,
) -> MismatchTraining:
    """The mismatch by which the assignment decides best on labelled runs.

    Args:
        runs: recorded runs, perhaps with several recognisers.
        features: names of Table 4.1.
        classes: of the recogniser, if there is only one.
        association: how the boundary will be used.

    Raises:
        InvalidInput: the runs do not show both kinds of pairs.
    """
    association = association or AssociationConfig()
    pairs = labelled_pairs(runs)
    values, is_same = pairs.features(features), pairs.is_same
    digest = hashlib.sha256(values.tobytes() + is_same.tobytes()).hexdigest()
    model = train_mismatch(values, is_same, features, classes=classes, fingerprint=digest)
    model, right = _calibrated(model, runs, association)
    return MismatchTraining(model, len(values), int(is_same.sum()), right)


def _calibrated(
    model: MismatchModel, runs: Sequence[SceneRecord], association: AssociationConfig
) -> tuple[MismatchModel, float]:
    """The model with its boundary where most decisions are right, and their share.

    The optimum is flat, since the tables' objects stand still. Of all that is about as good, the
    boundary furthest out is taken: with it an object that was nudged keeps its name.
    """
    shares: list[float] = []
    for factor in _FACTORS:
        moved = replace(model, offset=float(factor) * model.offset)
        counted = [decisions(run, moved, association) for run in runs]
        shares.append(
            sum(right for _, right in counted) / max(1, sum(int(t.sum()) for t, _ in counted))
        )
    good = np.flatnonzero(np.array(shares) >= max(shares) - _AS_GOOD)
    factor = float(_FACTORS[good[-1]])
    return replace(model, offset=factor * model.offset), max(shares)
