"""docs/reference/detectors.md: its examples are what the board and the client take."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import yaml

from fluentboard.model.detection import read_detections
from fluentboard.model.json_format import fluent_from_json
from fluentboard_modules.anchoring.config import AnchoringConfig

PAGE = (Path(__file__).parents[2] / "docs/reference/detectors.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)


def test_the_posted_detection_is_one() -> None:
    body = re.search(r"-d '(.*)'", blocks("sh")[1], re.DOTALL)
    assert body is not None
    fluents = [fluent_from_json(told) for told in json.loads(body[1])["fluents"]]
    (detection,) = read_detections(fluents, {}, "head")
    assert detection.confidences == {"cup": 0.83, "bowl": 0.1}


def test_the_detector_in_python_compiles_and_detects() -> None:
    (example,) = blocks("python")
    names: dict[str, Any] = {"__name__": "example"}
    exec(compile(example, "detectors.md", "exec"), names)
    assert names["detect"](b"")[0].confidences["cup"] == 0.83


def test_the_settings_are_settings() -> None:
    config = AnchoringConfig.model_validate(yaml.safe_load(blocks("yaml")[0]))
    assert config.recognition.detections.names["cup"] == "Mug"
