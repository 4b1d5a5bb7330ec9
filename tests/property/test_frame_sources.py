"""Frame sources that take a while: real recordings, simulated drives, and pictures of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fluentboard_modules.frames.cloud_views import GRAPHICS
from fluentboard_modules.frames.clouds import open_cloud
from fluentboard_modules.frames.folders import open_folder
from fluentboard_modules.frames.pictures import draw_source
from fluentboard_modules.frames.recorder import Layout, record_source
from fluentboard_modules.frames.report import describe, examine
from fluentboard_modules.frames.sensor_frame import Camera
from fluentboard_modules.frames.sources import open_source
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.map_frame import place
from fluentboard_modules.mapping.surfaces import detect_regions
from fluentboard_modules.simulation.drive import SimulatedDrive


def test_real_organised_clouds_have_the_kinects_camera(shared_data: Path) -> None:
    recording = open_cloud(shared_data / "mosd" / "learn40.pcd")
    (frame,) = recording
    assert frame.camera == Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
    assert 0.5 < frame.depth_m[frame.valid].min() < frame.depth_m.max() < 2.0
    assert set(np.unique(np.asarray(frame.labels))) == {0, 1, 20, 30, 40, 41, 42}
    assert recording.gravity_world is not None
    assert recording.gravity_world[1] > 0.7  # looks down at a table


def test_real_cloud_with_negative_z_is_turned_to_the_front(shared_data: Path) -> None:
    recording = open_cloud(shared_data / "tabletop" / "milk_cartoon_all_small_clorox.pcd")
    (frame,) = recording
    assert frame.T_map_sensor == GRAPHICS
    assert frame.camera.fx == pytest.approx(525.0, abs=0.01)
    assert recording.gravity_world is not None
    assert recording.gravity_world[1] < -0.7  # y is up in this file


def test_real_kitchen_has_its_gravity_and_metric_scale(shared_data: Path) -> None:
    kitchen = open_folder(shared_data / "redkitchen")
    assert len(kitchen) == 200
    assert kitchen.gravity_world is not None
    frame = kitchen.read(0)
    nearest = frame.depth_m[frame.valid].min()
    assert 0.7 < nearest < 1.5  # the Kinect's nearest is 0.8 m


def test_simulated_scene_has_its_seed_and_number_of_frames() -> None:
    source = open_source("sim:restaurant?seed=3&frames=40&width=80&noise=0", start_s=5.0)
    assert isinstance(source, SimulatedDrive)
    assert (len(source), source.seed, source.camera.width, source.start_s) == (40, 3, 80, 5.0)
    assert source.noise.is_exact


def test_older_name_of_the_simulated_restaurant_still_works() -> None:
    source = open_source("simulated-restaurant:2")
    assert isinstance(source, SimulatedDrive)
    assert source.seed == 2


def test_real_kitchen_without_its_gravity_file_has_it_guessed(
    shared_data: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    kitchen = open_folder(shared_data / "redkitchen")
    for file in (shared_data / "redkitchen").glob("*0[05]0.*"):
        (tmp_path / file.name).symlink_to(file)
    guessed = open_folder(tmp_path).gravity_world
    assert "gravity is not recorded" in caplog.text
    assert guessed is not None
    assert kitchen.gravity_world is not None
    # The recorded vector itself is 1.6 degrees off the table's normal.
    assert guessed @ kitchen.gravity_world > np.cos(np.deg2rad(4.0))


def test_real_recordings_have_no_problems(shared_data: Path) -> None:
    report = examine(open_folder(shared_data / "redkitchen"), at_most=10)
    assert report.problems == []
    text = describe(report)
    assert "another camera 26 mm from the depth camera" in text
    assert "0.80 to" in text


@pytest.mark.parametrize("layout", ["7-scenes", "tum", "open3d", "bag", "mcap", "sqlite3"])
def test_real_frames_survive_every_layout(
    layout: Layout, shared_data: Path, tmp_path: Path
) -> None:
    kitchen = open_folder(shared_data / "redkitchen").every(100)
    copied = tmp_path / ("copy.bag" if layout == "bag" else "copy")
    assert record_source(kitchen, copied, layout) == 2
    for original, copy in zip(kitchen, open_source(str(copied)), strict=True):
        assert copy.camera == replace(original.camera, cx=copy.camera.cx)
        assert np.allclose(original.depth_m, copy.depth_m, atol=1e-6)
        assert copy.colour is not None


def test_pictures_of_a_drive_are_drawn(tmp_path: Path) -> None:
    report = examine(open_source("sim:table?frames=4&width=80"), at_most=4)
    files = draw_source(report, tmp_path)
    assert [file.name for file in files] == ["frames.png", "path.png"]
    assert all(file.stat().st_size > 5000 for file in files)


@pytest.mark.parametrize("layout", ["7-scenes", "open3d", "mcap"])
def test_real_table_has_its_height_in_every_layout(
    layout: Layout, shared_data: Path, tmp_path: Path
) -> None:
    kitchen = open_folder(shared_data / "redkitchen").every(20)
    record_source(kitchen, tmp_path / "copy", layout)
    config = MappingConfig()
    copy, _ = place(open_source(str(tmp_path / "copy")), config)
    regions = [r for frame in copy for r in detect_regions(frame, config.surfaces)]
    tops = [r for r in regions if r.normal[2] > 0.99 and 0.6 < r.centroid[2] < 0.85]
    largest = sorted(tops, key=lambda region: -region.area_m2)[:5]
    height_m = np.median([region.centroid[2] for region in largest])
    assert 0.71 < height_m < 0.73
