"""CAD files: the same table in every format, unit and up axis is the same table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fluentboard.errors import InvalidGeometry
from fluentboard_modules.simulation.cad import load_mesh, standing
from fluentboard_modules.simulation.furniture import table
from fluentboard_modules.simulation.mesh import Mesh, box
from fluentboard_modules.simulation.scene_json import load_scene

TABLE = table().mesh
SIZE = TABLE.size

# From x to the right, y away, z up to the axes of the file (COLLADA 1.4.1, up_axis).
AXES = {
    "Z_UP": np.eye(3),
    "Y_UP": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "X_UP": np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
}


def collada(mesh: Mesh, unit_m: float, up: str, faces: str = "triangles", node: str = "") -> str:
    vertices = (mesh.vertices @ AXES[up].T) / unit_m
    numbers = " ".join(f"{v:.9g}" for v in vertices.ravel())
    index = " ".join(str(i) for i in mesh.triangles.ravel())
    counts = "<vcount>" + "3 " * len(mesh.triangles) + "</vcount>" if faces == "polylist" else ""
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit name="u" meter="{unit_m}"/><up_axis>{up}</up_axis></asset>
  <library_geometries><geometry id="g"><mesh>
    <source id="p"><float_array id="a" count="{vertices.size}">{numbers}</float_array>
      <technique_common><accessor source="#a" count="{len(vertices)}" stride="3"/>
      </technique_common>
    </source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <{faces} count="{len(mesh.triangles)}"><input semantic="VERTEX" source="#v" offset="0"/>
      {counts}<p>{index}</p></{faces}>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="s"><node>{node}<instance_geometry url="#g"/></node>
  </visual_scene></library_visual_scenes>
  <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>"""


def obj(mesh: Mesh, unit_m: float, note: str = "") -> str:
    lines = [note, *(f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.vertices / unit_m)]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.triangles]
    return "\n".join(lines) + "\n"


def stl(mesh: Mesh, unit_m: float, header: bytes = b"") -> bytes:
    record = np.zeros(
        len(mesh.triangles), dtype=[("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")]
    )
    record["v"] = mesh.vertices[mesh.triangles] / unit_m
    record["n"] = mesh.normals()
    return header.ljust(80, b" ") + np.uint32(len(record)).tobytes() + record.tobytes()


@pytest.mark.parametrize("faces", ["triangles", "polylist"])
@pytest.mark.parametrize("up", AXES)
@pytest.mark.parametrize("unit_m", [1.0, 0.01, 0.001, 0.0254])
def test_collada_states_its_unit_and_its_up_axis(
    unit_m: float, up: str, faces: str, tmp_path: Path
):
    file = tmp_path / "table.dae"
    file.write_text(collada(TABLE, unit_m, up, faces))
    mesh = load_mesh(file)
    assert mesh.size == pytest.approx(SIZE, abs=1e-6)
    assert mesh.bounds[1, 2] == pytest.approx(0.74)
    assert mesh.volume_m3 == pytest.approx(TABLE.volume_m3, rel=1e-5)


def test_collada_nodes_are_placed(tmp_path: Path):
    file = tmp_path / "table.dae"
    node = "<translate>0 0 1</translate><rotate>0 0 1 90</rotate><scale>2 1 1</scale>"
    file.write_text(collada(box(1.0, 1.0, 1.0), 1.0, "Z_UP", node=node))
    low, high = load_mesh(file).bounds
    assert low == pytest.approx([-0.5, -1.0, 1.0])
    assert high == pytest.approx([0.5, 1.0, 2.0])


def test_a_mirroring_node_does_not_turn_the_surface_inside_out(tmp_path: Path):
    file = tmp_path / "box.dae"
    file.write_text(collada(box(1.0, 1.0, 1.0), 1.0, "Z_UP", node="<scale>-1 1 1</scale>"))
    assert load_mesh(file).volume_m3 == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("unit_m", "note"), [(0.001, "# Units: mm"), (0.0254, "# File units = inches")]
)
def test_an_obj_file_may_note_its_unit(unit_m: float, note: str, tmp_path: Path):
    file = tmp_path / "table.obj"
    file.write_text(obj(TABLE, unit_m, note))
    assert load_mesh(file).size == pytest.approx(SIZE, abs=1e-5)


def test_a_binary_stl_may_note_its_unit(tmp_path: Path):
    file = tmp_path / "table.stl"
    file.write_bytes(stl(TABLE, 0.001, b"solid table UNITS=mm"))
    assert load_mesh(file).size == pytest.approx(SIZE, abs=1e-5)


def test_a_file_without_a_unit_is_in_metres_unless_told_otherwise(tmp_path: Path):
    file = tmp_path / "table.stl"
    file.write_bytes(stl(TABLE, 0.01))
    assert load_mesh(file).size == pytest.approx(100.0 * SIZE, rel=1e-5)
    assert load_mesh(file, unit_m=0.01).size == pytest.approx(SIZE, abs=1e-5)


def test_touching_boards_stay_solids_of_their_own(tmp_path: Path):
    file = tmp_path / "table.stl"
    file.write_bytes(stl(TABLE, 1.0))
    assert len(load_mesh(file).solids) == len(TABLE.solids)


def test_sdf_shapes_are_placed_by_model_link_and_visual(tmp_path: Path):
    (tmp_path / "stool").mkdir()
    (tmp_path / "stool" / "leg.dae").write_text(collada(box(0.04, 0.04, 0.4), 0.01, "Y_UP"))
    file = tmp_path / "stool" / "model.sdf"
    file.write_text(
        """<sdf version="1.5"><model name="stool"><pose>1 0 0 0 0 0</pose><link name="l">
        <pose>0 2 0 0 0 0</pose>
        <visual name="seat"><pose>0 0 0.45 0 0 1.5707963</pose>
          <geometry><box><size>0.4 0.2 0.1</size></box></geometry></visual>
        <visual name="leg"><geometry><mesh><uri>model://stool/leg.dae</uri>
          <scale>1 1 0.01</scale></mesh></geometry></visual>
        </link></model></sdf>"""
    )
    low, high = load_mesh(file).bounds
    assert low == pytest.approx([0.9, 1.8, 0.0], abs=1e-6)
    assert high == pytest.approx([1.1, 2.2, 0.5], abs=1e-6)


def test_sdf_cylinders_and_spheres_are_centred(tmp_path: Path):
    file = tmp_path / "model.sdf"
    file.write_text(
        """<sdf version="1.5"><model name="m"><link name="l">
        <collision name="a"><geometry><cylinder><radius>0.1</radius><length>1.0</length>
        </cylinder></geometry></collision>
        <collision name="b"><pose>2 0 0 0 0 0</pose><geometry><sphere><radius>0.3</radius></sphere>
        </geometry></collision></link></model></sdf>"""
    )
    low, high = load_mesh(file).bounds
    assert low == pytest.approx([-0.1, -0.3, -0.5], abs=1e-6)
    assert high == pytest.approx([2.3, 0.3, 0.5], abs=1e-6)


def test_a_mesh_can_be_stood_on_its_origin():
    moved = standing(box(0.2, 0.2, 0.2, at=(5.0, 5.0, 5.0)))
    assert moved.bounds[0] == pytest.approx([-0.1, -0.1, 0.0])


@pytest.mark.parametrize(
    ("name", "content", "complaint"),
    [
        ("a.dae", "<COLLADA", "well-formed"),
        ("a.dae", "<html/>", "COLLADA"),
        ("a.dae", "<COLLADA/>", "no triangles"),
        ("a.sdf", "<sdf><model name='m'/></sdf>", "no box"),
        ("a.sdf", "<robot/>", "expected sdf"),
        ("a.stl", "", "no triangles"),
        ("a.step", "", "unknown kind"),
    ],
)
def test_a_damaged_file_is_named(name: str, content: str, complaint: str, tmp_path: Path):
    file = tmp_path / name
    file.write_text(content)
    with pytest.raises(InvalidGeometry, match=complaint):
        load_mesh(file)


def test_a_missing_file_is_named(tmp_path: Path):
    with pytest.raises(InvalidGeometry, match="no such file"):
        load_mesh(tmp_path / "table.stl")


@pytest.mark.parametrize(
    ("file", "width_m", "height_m"),
    [
        ("cafe_table/meshes/cafe_table.dae", 0.914, 0.775),  # drawn in inches
        ("cafe_table/model.sdf", 0.914, 0.775),
        ("bookshelf/model.sdf", 0.92, 1.2),
        ("table/model.sdf", 1.5, 1.015),
    ],
)
def test_real_models_have_their_real_size(
    file: str, width_m: float, height_m: float, shared_data: Path
):
    mesh = load_mesh(shared_data / "furniture_cad" / file)
    assert mesh.size[0] == pytest.approx(width_m, abs=0.002)
    assert mesh.size[2] == pytest.approx(height_m, abs=0.002)


def test_the_race_world_loads_as_it_is(shared_data: Path):
    scene = load_scene(shared_data / "race_world" / "scene.json")
    assert len(scene.instances) == 37
    assert len(scene.search_volumes) == 6
    assert scene["mug_321"].on == "table2"
    assert scene["menucard_s11"].on == "bookshelf_321"
    # Figure 5.8: two rooms of 2.5 m height.
    assert scene.bounds[1, 2] == pytest.approx(2.5)
