"""Who is whom among found and true furniture."""

from __future__ import annotations

import math

from fluentboard.model.geometry import BoundingBox, Pose
from fluentboard_modules.mapping.evaluation import TruePiece, compare, score


def a_box(x: float) -> BoundingBox:
    return BoundingBox(Pose(x, 1.0, 0.4), 0.5, 0.5, 0.8)


def found(name: str, class_name: str, x: float) -> TruePiece:
    return TruePiece(name, class_name, a_box(x))


def test_each_true_piece_is_found_once_by_the_nearest() -> None:
    findings = [found("chair1", "Chair", 1.10), found("chair2", "Chair", 1.02)]
    matches = compare(findings, [TruePiece("seat", "Chair", a_box(1.0))])
    assert [(m.found and m.found.name, m.true and m.true.name) for m in matches] == [
        ("chair1", None),
        ("chair2", "seat"),
    ]


def test_class_and_distance_must_agree() -> None:
    true = [TruePiece("seat", "Chair", a_box(1.0)), TruePiece("top", "Table", a_box(1.0))]
    matches = compare([found("chair1", "Chair", 1.3), found("table1", "Table", 1.3)], true)
    assert [(m.found is not None, m.true is not None) for m in matches] == [
        (True, False),
        (True, True),
        (False, True),
    ]


def test_score_counts_hits_inventions_and_misses() -> None:
    true = [TruePiece(f"seat{n}", "Chair", a_box(float(n))) for n in range(3)]
    result = score(compare([found("a", "Chair", 0.1), found("b", "Chair", 9.0)], true))
    counts = (result.true_positives, result.false_positives, result.false_negatives)
    assert counts == (1, 1, 2)
    assert math.isclose(result.mean_distance_m, 0.1)
    assert math.isclose(result.f1, 0.4)


def test_finding_nothing_where_nothing_is_is_perfect() -> None:
    assert score(compare(list[TruePiece](), [])).f1 == 1.0
