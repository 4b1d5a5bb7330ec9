"""Meshes of frames and of scenes: they lie on the surfaces seen, and can be written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fluentboard.errors import InvalidInput, StorageFailed
from fluentboard_modules.frames.ply_files import read_ply
from fluentboard_modules.mapping.scene_mesh import (
    SceneMesh,
    SurfaceMesh,
    joined,
    mesh_of_frame,
    write_mesh,
)

EYES = ((0.0, -0.5, 1.4), (0.6, -0.4, 1.5), (-0.6, -0.4, 1.5), (0.2, -0.6, 1.3))


def height_error_m(mesh: SurfaceMesh) -> float:
    """How far the vertices above the middle of the table are off its top, in the median."""
    x, y, z = mesh.vertices.T
    over = (np.abs(x) < 0.5) & (y > 1.3) & (y < 1.9) & (z > 0.5)
    assert over.any()
    return float(np.median(np.abs(z[over] - 0.72)))


def test_the_mesh_of_a_frame_lies_on_the_surfaces_and_spans_no_edge(
    render: Any, table_boxes: Any
) -> None:
    mesh = mesh_of_frame(render(table_boxes))
    assert height_error_m(mesh) < 1e-3
    corners = mesh.vertices[mesh.triangles]
    assert np.ptp(corners[:, :, 2], axis=1).max() < 0.4
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normals = np.cross(b - a, c - a)
    towards = np.array([0.0, -0.5, 1.4]) - a
    assert (np.einsum("ij,ij->i", normals, towards) > 0.0).mean() > 0.99


def test_fused_frames_make_one_mesh_on_the_surfaces(
    render: Any, table_boxes: Any, rng: np.random.Generator
) -> None:
    scene = SceneMesh()
    for eye in EYES:
        scene.add(render(table_boxes, eye=eye, noise=rng, width=320))
    assert scene.n_frames == len(EYES)
    assert height_error_m(scene.mesh()) < 0.01


def test_a_frame_without_depth_changes_no_mesh(render: Any) -> None:
    scene = SceneMesh()
    scene.add(render([], floor=False))
    assert scene.n_frames == 0
    assert len(scene.mesh().triangles) == 0


def test_covered_triangles_can_be_cut_out(render: Any, table_boxes: Any) -> None:
    mesh = mesh_of_frame(render(table_boxes))
    rest = mesh.without(mesh.vertices[:, 2] > 0.1)
    assert 0 < len(rest.triangles) < len(mesh.triangles)
    assert rest.triangles.max() == len(rest.vertices) - 1
    again = joined([rest, mesh])
    assert len(again.vertices) == len(rest.vertices) + len(mesh.vertices)


@pytest.mark.parametrize("suffix", [".ply", ".glb", ".gltf"])
def test_meshes_are_written(tmp_path: Path, render: Any, table_boxes: Any, suffix: str) -> None:
    path = tmp_path / f"scene{suffix}"
    mesh = mesh_of_frame(render(table_boxes))
    write_mesh(mesh, path)
    assert path.stat().st_size > 1_000
    if suffix == ".ply":
        assert len(read_ply(path).points) == len(mesh.vertices)


def test_meshes_that_cannot_be_written_are_errors(
    tmp_path: Path, render: Any, table_boxes: Any
) -> None:
    mesh = mesh_of_frame(render(table_boxes))
    with pytest.raises(InvalidInput, match=r"\.glb"):
        write_mesh(mesh, tmp_path / "scene.docx")
    with pytest.raises(InvalidInput, match="empty"):
        write_mesh(joined([]), tmp_path / "scene.ply")
    with pytest.raises(StorageFailed):
        write_mesh(mesh, tmp_path / "missing" / "scene.ply")
