"""Which recogniser and which context model a configuration names: wiring, and nothing else."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from fluentboard.errors import InvalidInput
from fluentboard_modules.anchoring.config import RecognitionConfig
from fluentboard_modules.anchoring.context_model import CrfContextModel
from fluentboard_modules.anchoring.crf_files import load_crf
from fluentboard_modules.anchoring.geometric import GeometricRecogniser
from fluentboard_modules.anchoring.observation import ContextModel, Recogniser
from fluentboard_modules.anchoring.recogniser_detections import (
    DetectionRecogniser,
    DetectionSource,
)
from fluentboard_modules.anchoring.recogniser_spin_images import load_recogniser

_TRAINED = {"spin-images": "table_recogniser.npz", "household": "household_recogniser.npz"}


def recogniser_of(
    config: RecognitionConfig, detections: DetectionSource | None = None
) -> Recogniser:
    """The recogniser of a configuration.

    Args:
        config: its name.
        detections: what an external detector posts; None where there is no board to ask.

    Raises:
        InvalidInput: there is no such file, or it holds something else.
    """
    if config.recogniser == "detections":
        if detections is None:
            raise InvalidInput(
                "detections of an external detector are on a board, and there is none here; give "
                "geometric, spin-images, or the file of a trained recogniser"
            )
        if config.detections.fallback == "detections":
            raise InvalidInput(
                "recognition.detections.fallback = 'detections' rates nothing that no detection "
                "fits; give geometric, spin-images, household, or the file of a trained recogniser"
            )
        fallback = recogniser_of(RecognitionConfig(recogniser=config.detections.fallback))
        return DetectionRecogniser(detections, fallback, config.detections)
    if config.recogniser == "geometric":
        return GeometricRecogniser()
    if config.recogniser in _TRAINED:
        return load_recogniser(_built_in(_TRAINED[config.recogniser]))
    path = Path(config.recogniser)
    if not path.exists():
        raise InvalidInput(
            f"no recogniser is called {config.recogniser!r}; give geometric, spin-images, "
            "household, detections, or the file of a trained one"
        )
    return load_recogniser(path)


def context_of(config: RecognitionConfig, recogniser: Recogniser) -> ContextModel | None:
    """The context model of a configuration; None if it names none.

    Raises:
        InvalidInput: there is no such file, or it was trained for other classes.
    """
    if config.context is None:
        return None
    path = _built_in("table_crf.npz") if config.context == "tableware" else Path(config.context)
    model, graph = load_crf(path, recogniser.classes)
    return CrfContextModel(model, graph)


def _built_in(name: str) -> Path:
    return Path(str(files("fluentboard_modules.anchoring").joinpath(name)))
