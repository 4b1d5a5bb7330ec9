"""What is written about furniture: Listings 4.1 and 4.2, and honest intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from shapely.geometry import MultiPolygon, box

from fluentboard.model.fluent import Fluent
from fluentboard.model.geometry import BoundingBox, Pose, Transform
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_modules.mapping.furniture_fluents import FurnitureFluents
from fluentboard_modules.mapping.furniture_item import FurnitureItem, FurniturePlane
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.recollection import recollect
from fluentboard_modules.statements import Ending, Statement


def a_table(
    x: float = 2.0, last_seen_s: float = 5.0, identifier: str = "table1", frames: int = 4
) -> FurnitureItem:
    pose = Pose.from_rpy(x, 1.0, 0.74, yaw=0.3)
    T_map_region = Transform.from_parts(np.eye(3), np.array([x, 1.0, 0.74]))
    region = PlanarRegion(0, T_map_region, MultiPolygon([box(-0.6, -0.4, 0.6, 0.4)]), 900, 0.002)
    return FurnitureItem(
        identifier=identifier,
        class_name="Table",
        pose=pose,
        box=BoundingBox(replace(pose, z=0.37), 1.2, 0.8, 0.74),
        placing_area=BoundingBox(replace(pose, z=0.89), 1.2, 0.8, 0.3),
        score=0.8,
        n_frames=frames,
        n_direct=1,
        planes=(FurniturePlane(0, "TablePlane", region, frames),),
        rules=("TablePlaneRule",),
        alternatives=(),
        first_seen_s=3.0,
        last_seen_s=last_seen_s,
    )


def fluents(statements: Sequence[Statement]) -> dict[str, Fluent]:
    return {s.name: s for s in statements if isinstance(s, Fluent)}


def endings(statements: Sequence[Statement]) -> dict[str, Interval]:
    return {s.name: s.finish for s in statements if isinstance(s, Ending)}


def start() -> FurnitureFluents:
    return FurnitureFluents(symmetry_order={"Table": 2})


def test_new_piece_is_written_as_in_listing_4_1() -> None:
    _, statements = start().update([a_table()], 5.0)
    written = fluents(statements)
    assert written["table1"].class_name == "Table"
    assert written["table1"].values("hasPose") == ("poseTable1_0",)
    assert written["table1"].values("hasBoundingBox") == ("bBoxTable1_0",)
    assert written["bBoxTable1_0"].values("hasPose") == ("poseBBTable1_0",)
    assert written["poseTable1_0"].values("hasZ") == (0.74,)
    assert written["bBoxTable1_0"].values("hasXSize") == (1.2,)


def test_new_piece_possibly_stood_there_before_it_was_seen() -> None:
    _, statements = start().update([a_table()], 5.0)
    for fluent in fluents(statements).values():
        if fluent.class_name != "ExistenceEvidence":
            assert (fluent.start, fluent.finish) == (Interval(None, 3.0), UNKNOWN)


def test_planes_and_rules_explain_the_piece() -> None:
    _, statements = start().update([a_table()], 5.0)
    written = fluents(statements)
    assert written["table1"].values("isExplainedByRule") == ("TablePlaneRule",)
    plane = written[str(written["table1"].values("hasMainPlane")[0])]
    assert plane.class_name == "TablePlane"
    assert plane.values("hasSize") == (0.96,)
    assert plane.values("hasConfidence") == (0.8,)
    assert plane.values("hasContour") == (
        "MULTIPOLYGON Z (((2.600 0.600 0.740, 2.600 1.400 0.740, 1.400 1.400 0.740, "
        "1.400 0.600 0.740, 2.600 0.600 0.740)))",
    )


def test_placing_area_is_the_top_without_height() -> None:
    _, statements = start().update([a_table()], 5.0)
    written = fluents(statements)
    area = written["placingAreaTable1"]
    assert (area.class_name, area.values("isAreaOf")) == ("PlacingArea", ("table1",))
    area_box = written[str(area.values("hasBoundingBox")[0])]
    assert area_box.values("hasZSize") == (0.0,)
    assert written[str(area_box.values("hasPose")[0])].values("hasZ") == (0.74,)


def test_what_has_not_changed_is_not_written_again() -> None:
    state, _ = start().update([a_table()], 5.0)
    state, statements = state.update([a_table(x=2.03, last_seen_s=6.0)], 6.0)
    assert statements == []


def test_table_turned_by_half_a_turn_is_the_same_table() -> None:
    state, _ = start().update([a_table()], 5.0)
    turned = a_table(last_seen_s=6.0)
    pose = Pose.from_rpy(2.0, 1.0, 0.74, yaw=0.3 - np.pi)
    turned = replace(turned, pose=pose, box=replace(turned.box, pose=replace(pose, z=0.37)))
    assert state.update([turned], 6.0)[1] == []


def test_moved_piece_gets_new_fluents_as_in_listing_4_2() -> None:
    state, _ = start().update([a_table()], 5.0)
    _, statements = state.update([a_table(x=3.0, last_seen_s=9.0)], 9.0)
    written, ended = fluents(statements), endings(statements)
    assert written["table1"].values("hasPose") == ("poseTable1_1",)
    assert {"poseTable1_0", "bBoxTable1_0", "poseBBTable1_0"} <= ended.keys()
    assert "table1" not in ended


def test_change_happened_between_two_looks() -> None:
    state, _ = start().update([a_table()], 5.0)
    state, _ = state.update([a_table(last_seen_s=7.0)], 7.0)
    _, statements = state.update([a_table(x=3.0, last_seen_s=9.0)], 9.0)
    assert fluents(statements)["poseTable1_1"].start == Interval(7.0, 9.0)
    assert endings(statements)["poseTable1_0"] == Interval(7.0, 9.0)


def test_piece_that_grows_with_every_frame_is_not_written_with_every_frame() -> None:
    state, _ = start().update([a_table()], 5.0)
    state, statements = state.update([a_table(x=2.06, last_seen_s=5.5)], 5.5)
    assert statements == []
    _, statements = state.update([a_table(x=2.12, last_seen_s=7.0)], 7.0)
    assert fluents(statements)["poseTable1_1"].start == Interval(5.0, 7.0)


def test_large_change_is_written_at_once() -> None:
    state, _ = start().update([a_table()], 5.0)
    _, statements = state.update([a_table(x=2.5, last_seen_s=5.5)], 5.5)
    assert "poseTable1_1" in fluents(statements)


def test_moved_piece_takes_its_placing_area_along() -> None:
    state, _ = start().update([a_table()], 5.0)
    _, statements = state.update([a_table(x=3.0, last_seen_s=9.0)], 9.0)
    area = fluents(statements)["placingAreaTable1"]
    assert area.values("hasBoundingBox") == ("bBoxPlacingAreaTable1_1",)
    assert "bBoxPlacingAreaTable1_0" in endings(statements)


def test_piece_that_is_not_believed_in_any_more_ends_with_all_its_parts() -> None:
    state, introduced = start().update([a_table()], 5.0)
    state, statements = state.update([], 8.0)
    assert endings(statements).keys() == fluents(introduced).keys() - {"table1"}
    state, later = state.update([], 20.0)
    assert later == []
    _, later = state.update([], 40.0)
    assert endings(later).keys() == {"table1"}
    assert {*endings(statements).values(), *endings(later).values()} == {Interval(5.0, 8.0)}


def test_missing_piece_is_given_up_at_the_end_of_a_run() -> None:
    state, introduced = start().update([a_table()], 5.0)
    state, statements = state.update([], 8.0, final=True)
    assert endings(statements).keys() == fluents(introduced).keys()
    assert (state.moved, state.gone) == ((), ("table1",))


def test_piece_that_turns_up_elsewhere_keeps_its_name() -> None:
    state, introduced = start().update([a_table()], 5.0)
    state, _ = state.update([], 8.0)
    moved = replace(a_table(x=6.0, identifier="table2", last_seen_s=9.0), first_seen_s=7.0)
    state, statements = state.update([moved], 9.0)
    assert (state.moved, state.gone) == (("table1",), ())
    written = fluents(statements)
    assert written["table1"].values("hasPose") == ("poseTable1_1",)
    assert written["poseTable1_1"].start == Interval(5.0, 7.0)
    assert written["placingAreaTable1_1"].values("isAreaOf") == ("table1",)
    assert "table1" not in endings(statements)
    # Names are used once.
    assert written.keys() & fluents(introduced).keys() == {"table1"}


def test_piece_of_another_size_is_another_piece() -> None:
    state, _ = start().update([a_table()], 5.0)
    state, _ = state.update([], 8.0)
    other = replace(a_table(x=6.0, identifier="table2", last_seen_s=9.0), first_seen_s=7.0)
    other = replace(other, box=replace(other.box, x_size=2.0))
    assert "table2" in fluents(state.update([other], 9.0)[1])


def test_piece_is_not_in_two_places_at_once() -> None:
    state, _ = start().update([a_table()], 5.0)
    state, _ = state.update([], 8.0)
    seen_before = replace(a_table(x=6.0, identifier="table2"), first_seen_s=4.0)
    assert "table2" in fluents(state.update([seen_before], 9.0)[1])


def test_frames_that_support_a_piece_are_told_once_each() -> None:
    state, first = start().update([replace(a_table(), frames_s=(3.0, 4.0, 5.0))], 5.0)
    seen = replace(a_table(last_seen_s=9.0), frames_s=(3.0, 4.0, 5.0, 7.0, 9.0), score=0.95)
    state, second = state.update([seen], 9.0)
    assert fluents(first)["evidenceTable1_0"].values("hasSupportingFrame") == (3.0, 4.0, 5.0)
    assert fluents(second)["evidenceTable1_1"].values("hasSupportingFrame") == (7.0, 9.0)
    assert fluents(second)["evidenceTable1_1"].values("hasExistenceBelief") == (0.95,)
    assert endings(second)["evidenceTable1_0"] == Interval.at(9.0)
    assert state.update([seen], 10.0, final=True)[1] == []


def test_name_of_an_ended_piece_is_not_used_again() -> None:
    state, _ = start().update([a_table()], 5.0)
    state, _ = state.update([], 8.0)
    _, statements = state.update([a_table(x=6.0, identifier="table2")], 9.0)
    assert "table2" in fluents(statements)


def test_last_look_writes_small_improvements_and_all_evidence() -> None:
    state, _ = start().update([a_table()], 5.0)
    _, statements = state.update([a_table(x=2.03, last_seen_s=9.0, frames=40)], 9.0, final=True)
    written = fluents(statements)
    assert "poseTable1_1" in written
    assert written["planeTable1_40"].values("hasFrameCount") == (40,)
    assert "planeTable1_0" in endings(statements)


def test_board_is_remembered_by_a_later_run() -> None:
    _, statements = start().update([a_table()], 5.0)
    on_board = fluents(statements)
    parts = {name: f for name, f in on_board.items() if name != "table1"}
    later = replace(
        start(),
        remembered=tuple(recollect([on_board["table1"]], parts)),
        names=frozenset({"table1"}),
    )
    state, statements = later.update([a_table(last_seen_s=105.0)], 105.0)
    # Both runs have seen it, so the belief grows.
    (evidence,) = fluents(statements).values()
    assert evidence.name == "evidenceTable1_1"
    assert float(evidence.values("hasExistenceBelief")[0]) > 0.95
    assert endings(statements).keys() == {"evidenceTable1_0"}
    _, statements = state.update([a_table(x=2.5, last_seen_s=107.0)], 107.0)
    assert "poseTable1_1" in fluents(statements)
    assert endings(statements)["poseTable1_0"] == Interval(105.0, 107.0)


def test_doubt_about_a_piece_that_nobody_saw_is_written_with_the_last_look() -> None:
    _, statements = start().update([a_table()], 5.0)
    on_board = fluents(statements)
    parts = {name: f for name, f in on_board.items() if name != "table1"}
    remembered = tuple(recollect([on_board["table1"]], parts))
    later = replace(start(), remembered=remembered, names=frozenset({"table1"}))
    assert later.update([], 105.0, doubts={"table1": 0.4})[1] == []
    _, statements = later.update([], 105.0, final=True, doubts={"table1": 0.4})
    (evidence,) = fluents(statements).values()
    assert evidence.values("hasExistenceBelief") == (0.4,)
    assert evidence.values("isEvidenceAbout") == ("table1",)
    assert endings(statements).keys() == {"evidenceTable1_0"}
    parts = {name: f for name, f in parts.items() if name != "evidenceTable1_0"}
    parts[evidence.name] = evidence
    (known,) = recollect([on_board["table1"]], parts)
    assert known.belief == 0.4


def test_piece_elsewhere_is_a_new_one_for_a_later_run() -> None:
    _, statements = start().update([a_table()], 5.0)
    on_board = fluents(statements)
    parts = {name: f for name, f in on_board.items() if name != "table1"}
    remembered = tuple(recollect([on_board["table1"]], parts))
    later = replace(start(), remembered=remembered, names=frozenset({"table1"}))
    _, statements = later.update([a_table(x=6.0)], 5.0)
    assert "table2" in fluents(statements)


def test_recording_played_again_does_not_undo_what_came_later() -> None:
    _, statements = start().update([a_table(last_seen_s=50.0)], 50.0)
    on_board = fluents(statements)
    moved = replace(on_board["poseTable1_0"], start=Interval(40.0, 50.0))
    parts = {name: f for name, f in on_board.items() if name != "table1"} | {moved.name: moved}
    again = replace(start(), remembered=tuple(recollect([on_board["table1"]], parts)))
    state, statements = again.update([a_table(x=2.3, last_seen_s=5.0)], 5.0)
    assert statements == []
    assert state.update([], 8.0)[1] == []
