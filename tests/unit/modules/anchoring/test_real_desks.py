"""Readers of the recorded desks and rooms."""

from __future__ import annotations

from pathlib import Path

import pytest

from fluentboard.errors import InvalidInput
from fluentboard_modules.anchoring.datasets import (
    frequent_classes,
    labelled_graphs,
    read_kth_desks,
    read_sunrgbd_boxes,
)


def test_desks_are_read_in_time_order(shared_data: Path) -> None:
    scenes = read_kth_desks(shared_data / "kth_desks")
    assert len(scenes) == 29
    assert scenes[0].name == "606-alejandro 2013-06-21 afternoon"
    assert {"Monitor", "Keyboard"} <= set(frequent_classes(scenes, 15))


def test_furniture_boxes_become_scene_graphs_without_a_table(shared_data: Path) -> None:
    scenes = read_sunrgbd_boxes(shared_data / "sunrgbd_boxes")[:50]
    graphs = labelled_graphs(scenes, frequent_classes(scenes, 5))
    assert len({scene.place for scene in scenes}) == 1
    assert 0 < len(graphs) <= 50


@pytest.mark.parametrize("reader", [read_kth_desks, read_sunrgbd_boxes])
def test_a_missing_data_set_is_refused(reader: object, tmp_path: Path) -> None:
    assert callable(reader)
    with pytest.raises(InvalidInput, match="expected a"):
        reader(tmp_path)
