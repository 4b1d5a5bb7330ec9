"""Meshes: closed, oriented outwards, and refused when damaged."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from fluentboard.errors import InvalidGeometry
from fluentboard_modules.simulation.mesh import Mesh, bar, box, cylinder, lathe, merge, tube

CUP = lathe([(0.0, 0.0), (0.04, 0.0), (0.04, 0.1), (0.036, 0.1), (0.036, 0.006), (0.0, 0.006)])
BODIES = {
    "box": box(0.3, 0.2, 0.1),
    "cylinder": cylinder(0.1, 0.5),
    "cup": CUP,
    "tube": tube([(0.0, 0.0, 0.1), (0.05, 0.0, 0.08), (0.06, 0.0, 0.0)], 0.01),
    "bar": bar([(0.0, 0.0, 0.02, 0.003), (0.1, 0.01, 0.01, 0.003)]),
}


def edges_meet_in_opposite_pairs(mesh: Mesh) -> bool:
    directed = np.concatenate([mesh.triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    count = Counter((int(a), int(b)) for a, b in directed)
    return all(number == 1 and count[(b, a)] == 1 for (a, b), number in count.items())


@pytest.mark.parametrize("name", BODIES)
def test_every_body_is_closed(name: str):
    assert edges_meet_in_opposite_pairs(BODIES[name])


@pytest.mark.parametrize("name", BODIES)
def test_every_body_is_oriented_outwards(name: str):
    assert BODIES[name].volume_m3 > 0.0


def test_a_box_has_the_volume_of_a_box():
    assert box(2.0, 3.0, 4.0).volume_m3 == pytest.approx(24.0)


def test_a_cup_holds_nothing_of_its_own_volume_inside():
    hull = np.pi * 0.04**2 * 0.1
    assert 0.1 * hull < CUP.volume_m3 < 0.35 * hull


def test_a_box_stands_on_the_point_it_is_put_at():
    low, high = box(0.2, 0.4, 0.6, at=(1.0, 2.0, 3.0)).bounds
    assert low == pytest.approx([0.9, 1.8, 3.0])
    assert high == pytest.approx([1.1, 2.2, 3.6])


def test_merged_meshes_keep_their_solids_apart():
    both = merge([box(1.0, 1.0, 1.0), box(1.0, 1.0, 1.0, at=(5.0, 0.0, 0.0))])
    assert both.solids == ((0, 8), (8, 16))
    assert both.volume_m3 == pytest.approx(2.0)


def test_scaling_changes_the_unit():
    assert box(36.0, 36.0, 29.0).scaled(0.0254).size == pytest.approx([0.9144, 0.9144, 0.7366])


def test_tilting_tips_the_top_forwards():
    post = box(0.1, 0.1, 1.0).tilted(0.5)
    assert post.vertices[post.vertices[:, 2].argmax(), 0] > 0.3


def test_normals_have_unit_length_and_face_outwards():
    mesh = BODIES["box"]
    middle = mesh.vertices[mesh.triangles].mean(axis=1) - mesh.bounds.mean(axis=0)
    normals = mesh.normals()
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0)
    assert (np.einsum("ij,ij->i", normals, middle) > 0.0).all()


@pytest.mark.parametrize(
    ("vertices", "triangles", "complaint"),
    [
        (np.zeros((0, 3)), np.zeros((1, 3)), "vertices"),
        (np.zeros((3, 3)), np.zeros((0, 3)), "triangles"),
        (np.zeros((3, 3)), np.array([[0, 1, 7]]), "vertex 7"),
        (np.full((3, 3), np.nan), np.array([[0, 1, 2]]), "NaN"),
    ],
)
def test_a_damaged_mesh_is_refused(vertices: np.ndarray, triangles: np.ndarray, complaint: str):
    with pytest.raises(InvalidGeometry, match=complaint):
        Mesh(vertices, triangles)


def test_a_unit_of_no_length_is_refused():
    with pytest.raises(InvalidGeometry, match="scaled"):
        box(1.0, 1.0, 1.0).scaled(0.0)
