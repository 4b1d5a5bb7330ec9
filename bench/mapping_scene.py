"""A registered scene of 9,475,220 points, as large as the thesis's: planes, and all the way."""

from __future__ import annotations

import time

import numpy as np

from bench.measuring import Report, compare
from bench.registered_scene import whole_way
from fluentboard.model.geometry import FloatArray
from fluentboard_modules.frames.sources import open_source
from fluentboard_modules.mapping.cloud_regions import regions_of_cloud
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.floor import sloping_floor
from fluentboard_modules.mapping.rules import load_rules
from fluentboard_modules.mapping.scene_mesh import SceneMesh
from fluentboard_modules.mapping.voxel_cloud import SceneCloud
from fluentboard_ontology import read

POINTS = 9_475_220
_FRAMES = 60
_THESIS_S = {"surfaces": 117.06, "classification": 2.67}


def run() -> list[Report]:
    """Planes and classes of a scene, its mesh, and the whole way to verified furniture."""
    frames = list(open_source(f"sim:room?seed=3&frames={_FRAMES}"))
    parts: list[tuple[FloatArray, FloatArray]] = []
    left = POINTS
    for frame in frames:
        points = frame.points_map()[frame.valid][:left]
        parts.append((points, frame.T_map_sensor.translation))
        left -= len(points)
    if left > 0:
        raise SystemExit(f"{_FRAMES} frames have {left:,} points too few; raise _FRAMES")
    config = MappingConfig()
    rules = load_rules(read("furniture"))

    def ours() -> None:
        scene = SceneCloud(config.surfaces.cloud.voxel_m)
        for points, sensor in parts:
            scene.add(points, sensor)
        found = regions_of_cloud(scene.voxels(), config.surfaces.cloud, config.surfaces.contours)
        floor = sloping_floor(found, config.furniture.floor_reach_m)
        rules.classify(found, floor=floor, explain=False)

    def open3d() -> float:
        import open3d as o3d

        everything = np.concatenate([points for points, _ in parts])
        begin = time.perf_counter()
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(everything))
        cloud = cloud.voxel_down_sample(config.surfaces.cloud.voxel_m)
        cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(radius=0.08, max_nn=30))
        cloud.detect_planar_patches(min_num_points=config.surfaces.cloud.seed_voxels)
        return time.perf_counter() - begin

    def mesh() -> None:
        scene = SceneMesh(config.mesh)
        for frame in frames:
            scene.add(frame)
        scene.mesh()

    ours()  # compiles
    return [
        compare(
            f"Planes and furniture classes of a registered scene of {POINTS:,} points",
            {
                "fluentboard: voxels, planes, contours, classes": ours,
                "Open3D: voxels, normals, detect_planar_patches (boxes, no classes)": open3d,
            },
            rounds=3,
            unit="s",
            target="at most 10 s on two cores, and a fifteenth of the thesis's time",
            notes=[
                f"The thesis took {_THESIS_S['surfaces']} s for surfaces and "
                f"{_THESIS_S['classification']} s for classes on its own computer and scene of "
                "that size; ours is simulated."
            ],
        ),
        compare(
            f"Mesh fused from {_FRAMES} frames", {"fluentboard (TSDF)": mesh}, rounds=2, unit="s"
        ),
        whole_way(POINTS),
    ]
