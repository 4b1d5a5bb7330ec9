"""The measures of the evaluation, on records that are made up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fluentboard_modules.anchoring.crf_data import LabelledGraphs, load_graphs
from fluentboard_modules.anchoring.datasets import LabelledScene, read_kth_desks
from fluentboard_modules.anchoring.evaluation_association import (
    Counts,
    duplicates,
    evaluate_association,
    evaluate_similarity,
    labelled_pairs,
)
from fluentboard_modules.anchoring.evaluation_context import evaluate_context
from fluentboard_modules.anchoring.evaluation_desks import anchor_across_sessions
from fluentboard_modules.anchoring.evaluation_records import FrameRecord, SceneRecord, Seen
from fluentboard_modules.anchoring.evaluation_run import export_results
from fluentboard_modules.anchoring.observation import (
    Cluster,
    Detection,
    Recognition,
    SceneObject,
)

CLASSES = ("Fork", "Knife", "Plate")


@pytest.fixture
def records(
    laid_tables: Callable[..., tuple[list[LabelledScene], LabelledGraphs]],
) -> list[SceneRecord]:
    """Laid tables whose left and right half are seen in turns: every half has two tracks."""
    scenes = laid_tables(6)[0]
    made: list[SceneRecord] = []
    for number, scene in enumerate(scenes):
        frames: list[FrameRecord] = []
        for turn in range(4):
            shown = range(3) if turn % 2 == 0 else range(3, 6)
            seen: list[Seen] = []
            tracks: dict[str, int] = {}
            anchors: list[SceneObject] = []
            for k, thing in enumerate(scene.objects):
                if k in shown:
                    track = 10 * turn + k
                    seen.append(_seen(thing, track, float(turn + 1), scene.labels[k]))
                    tracks[thing.name] = track
                if k < 3 or turn > 0:
                    anchors.append(replace(thing, is_tracked=k in shown))
            frames.append(FrameRecord(turn + 1.0, tuple(seen), tuple(anchors), tracks))
        truth = {o.name: cls for o, cls in zip(scene.objects, scene.labels, strict=True)}
        made.append(SceneRecord(number, truth, tuple(frames)))
    return made


def _seen(thing: SceneObject, track: int, stamp_s: float, cls: str) -> Seen:
    cluster = Cluster(
        np.zeros((0, 3)),
        np.zeros((0, 2), np.int64),
        thing.box,
        stamp_s,
        np.zeros(3),
        support=thing.support,
        track_id=track,
    )
    return Seen(Detection(cluster, Recognition(CLASSES, thing.confidence)), thing.name, cls)


def test_pairs_under_perfect_association_are_new_tracks_and_untracked_anchors(
    records: list[SceneRecord],
) -> None:
    pairs = labelled_pairs(records)
    # In turns 2 to 4 three new tracks meet three, six and six untracked anchors.
    assert len(pairs.is_same) == 6 * 45
    assert int(pairs.is_same.sum()) == 6 * 6


def test_tables_that_do_not_change_are_associated_without_a_mistake(
    records: list[SceneRecord],
) -> None:
    pairs = labelled_pairs(records)
    assert evaluate_similarity(pairs)["a"].accuracy == 1.0
    results = evaluate_association(records, pairs)
    assert set(results) == {"gnn", "thesis", "nn", "murty"}
    assert results["gnn"].right == 1.0
    assert results["gnn"].counts.accuracy == 1.0


def test_context_classifies_tracks_that_local_recognition_cannot(
    records: list[SceneRecord], tmp_path: Path
) -> None:
    result = evaluate_context(records, CLASSES)
    assert len(result.truth) == 6 * 12
    assert result.accuracy("Loc") == pytest.approx(2.0 / 3.0)
    assert result.accuracy("CRF+A+Loc") > 0.8
    assert result.confusion("CRF+A+Loc", CLASSES).sum() == 6 * 12
    written = export_results(tmp_path, result, None, None)
    assert [path.name for path in written] == ["tables_anchored.npz", "tables_seen.npz"]
    assert load_graphs(written[0]).classes == CLASSES


def test_every_object_is_counted_once_at_the_end(records: list[SceneRecord]) -> None:
    total = duplicates(records)
    assert total == {
        "objects": 36,
        "anchored": 36,
        "duplicates": 0,
        "missed": 0,
        "inventions": 0,
    }


def test_measures_are_those_of_a_classification_report() -> None:
    # Table 4.5 and its Table 4.6.
    counts = Counts(np.array([[28, 5], [11, 228]]))
    assert counts.accuracy == pytest.approx(0.9412, abs=5e-5)
    assert (round(counts.precision(0), 2), round(counts.recall(0), 2)) == (0.72, 0.85)
    assert (round(counts.precision(1), 2), round(counts.f1(1), 2)) == (0.98, 0.97)
    averages = [round(counts.average(m), 2) for m in ("precision", "recall", "f1")]
    assert averages == [0.95, 0.94, 0.94]


def test_real_desks_keep_their_anchors_from_session_to_session(shared_data: Path) -> None:
    scenes = read_kth_desks(shared_data / "kth_desks")
    result = anchor_across_sessions(scenes, [scene.labels for scene in scenes])
    assert result.found > 0.8 * result.pairs
