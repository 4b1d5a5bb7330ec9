"""The office and the seminar room of Section 3.3: as many pieces, as close, as full."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from fluentboard_modules.frames.sources import open_source
from fluentboard_modules.simulation.cad import load_mesh
from fluentboard_modules.simulation.cad_writing import write_meshes
from fluentboard_modules.simulation.chapter3_rooms import office, seminar_room
from fluentboard_modules.simulation.collision import all_collisions
from fluentboard_modules.simulation.drive import SimulatedDrive
from fluentboard_modules.simulation.office_furniture import l_desk
from fluentboard_modules.simulation.scene import Scene

FURNITURE = ("Chair", "Desk", "Shelf", "Table")


def counted(scene: Scene) -> Counter[str]:
    return Counter(thing.cls for thing in scene.of_class(*FURNITURE))


@pytest.fixture(scope="module")
def made_office() -> Scene:
    return office(np.random.default_rng(0))


@pytest.fixture(scope="module")
def made_seminar() -> Scene:
    return seminar_room(np.random.default_rng(0))


def test_the_office_has_the_thirteen_pieces_of_the_thesis(made_office: Scene) -> None:
    assert counted(made_office) == {"Shelf": 5, "Chair": 6, "Desk": 1, "Table": 1}


def test_the_seminar_room_has_twelve_tables_and_twenty_chairs(made_seminar: Scene) -> None:
    assert counted(made_seminar) == {"Table": 12, "Chair": 20}


def test_every_chair_of_the_seminar_room_is_another(made_seminar: Scene) -> None:
    poses = {chair.pose for chair in made_seminar.of_class("Chair")}
    assert len(poses) == 20


def test_nothing_in_the_rooms_reaches_into_anything(made_seminar: Scene) -> None:
    assert all_collisions(made_seminar, 0.002) == []
    desk_and_chairs = office(np.random.default_rng(1), filled=0.0)
    assert all_collisions(desk_and_chairs, 0.002) == []


def test_shelves_and_tables_stand_side_by_side_without_a_gap(
    made_office: Scene, made_seminar: Scene
) -> None:
    shelves = np.array([s.T_map_model.translation[:2] for s in made_office.of_class("Shelf")])
    gaps = [np.linalg.norm(shelves[b] - shelves[a]) for a, b in ((0, 1), (1, 2), (3, 4))]
    assert gaps == pytest.approx([0.8, 0.8, 0.8])
    tables = np.array([t.T_map_model.translation[:2] for t in made_seminar.of_class("Table")])
    pairs = np.linalg.norm(tables[1::2] - tables[::2], axis=1)
    assert pairs == pytest.approx(np.full(6, 1.401))


def test_the_shelves_of_the_office_are_full(made_office: Scene) -> None:
    for shelf in made_office.of_class("Shelf"):
        books = made_office.standing_on(shelf.name)
        thickness = sum(float(book.model.mesh.size[1]) for book in books)
        boards = [s for s in shelf.model.supports if s.clearance < 1.0]
        assert thickness > 0.8 * sum(board.y_size for board in boards)


def test_a_user_of_the_l_shaped_desk_sits_in_its_angle() -> None:
    desk = l_desk()
    assert desk.mesh.volume_m3 > 0.0
    x, y = 0.3, 0.3  # free floor: in front of the board, right of the wing
    for first, end in desk.mesh.solids:
        low = desk.mesh.vertices[first:end].min(axis=0)
        high = desk.mesh.vertices[first:end].max(axis=0)
        assert not (low[0] < x < high[0] and low[1] < y < high[1])


def test_models_come_out_as_cad_files_in_metres(made_office: Scene, tmp_path: Path) -> None:
    count = write_meshes(made_office, tmp_path)
    names = {instance.model.name for instance in made_office.instances}
    assert count == len(names) == len(list(tmp_path.glob("*.stl")))
    for thing in (made_office["desk1"], made_office["desk1Chair"], made_office["shelf1"]):
        mesh = load_mesh(tmp_path / f"{thing.model.name}.stl")
        assert mesh.bounds == pytest.approx(thing.model.mesh.bounds, abs=1e-6)
        assert mesh.volume_m3 == pytest.approx(thing.model.mesh.volume_m3, rel=1e-4)


def test_a_short_drive_still_looks_at_every_piece() -> None:
    drive = open_source("sim:office?frames=16&width=64&noise=0")
    assert isinstance(drive, SimulatedDrive)
    seen: set[int] = set()
    for frame in drive:
        assert frame.labels is not None
        seen |= {int(label) for label in np.unique(frame.labels)}
    assert {thing.label for thing in drive.scene.of_class(*FURNITURE)} <= seen
