"""Settings of the modules from a file and flags."""

from __future__ import annotations

from pathlib import Path

import pytest

from fluentboard.errors import InvalidInput
from fluentboard_modules.anchoring.config import AnchoringConfig
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.search.config import SearchConfig
from fluentboard_modules.settings import read_settings


def file_of(folder: Path, text: str) -> Path:
    path = folder / "anchoring.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_without_a_file_and_flags_all_is_as_by_default() -> None:
    assert read_settings(AnchoringConfig, None, {"recognition.context": None}) == AnchoringConfig()


def test_a_file_overrides_the_defaults_and_flags_the_file(tmp_path: Path) -> None:
    path = file_of(tmp_path, "world:\n  association: {method: nn, gate_m: 0.3}\n")
    flags = {"world.association.method": "murty", "recognition.recogniser": "spin-images"}
    settings = read_settings(AnchoringConfig, path, flags)
    assert settings.world.association.method == "murty"
    assert settings.world.association.gate_m == 0.3
    assert settings.recognition.recogniser == "spin-images"


def test_an_empty_file_changes_nothing(tmp_path: Path) -> None:
    assert read_settings(AnchoringConfig, file_of(tmp_path, ""), {}) == AnchoringConfig()


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("world: {gate: 1.0}", "world.gate"),
        ("tracking: {reach_m: -1.0}", "tracking.reach_m"),
        ("world: {association: {method: best}}", "world.association.method"),
    ],
)
def test_a_wrong_setting_is_named(tmp_path: Path, text: str, named: str) -> None:
    with pytest.raises(InvalidInput, match=named):
        read_settings(AnchoringConfig, file_of(tmp_path, text), {})


@pytest.mark.parametrize("text", ["- a\n- b\n", "world: [", "just words"])
def test_what_is_no_mapping_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(InvalidInput, match=r"anchoring\.yaml"):
        read_settings(AnchoringConfig, file_of(tmp_path, text), {})


def test_a_flag_below_a_value_is_refused(tmp_path: Path) -> None:
    path = file_of(tmp_path, "world: 3\n")
    with pytest.raises(InvalidInput, match="world is 3"):
        read_settings(AnchoringConfig, path, {"world.association.method": "gnn"})


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match=r"nowhere\.yaml"):
        read_settings(AnchoringConfig, tmp_path / "nowhere.yaml", {})


def test_a_file_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "anchoring.yaml"
    path.write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(InvalidInput, match=r"anchoring\.yaml: cannot be read"):
        read_settings(AnchoringConfig, path, {})


def test_every_module_reads_its_own(tmp_path: Path) -> None:
    normals = file_of(tmp_path, "surfaces: {normals: {radius_px: 5}}")
    assert read_settings(MappingConfig, normals, {}).surfaces.normals.radius_px == 5
    prior = file_of(tmp_path, "sampling: {unknown_occupancy: 0.1}")
    settings = read_settings(SearchConfig, prior, {"method": "greedy"})
    assert (settings.sampling.unknown_occupancy, settings.method) == (0.1, "greedy")
