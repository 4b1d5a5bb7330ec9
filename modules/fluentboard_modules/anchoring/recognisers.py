"""Which recogniser and which context model a configuration names: wiring, and nothing else."""

from __future__ import annotations

from pathlib import Path

from fluentboard.errors import InvalidInput
from fluentboard_modules.anchoring.config import RecognitionConfig
from fluentboard_modules.anchoring.context_model import CrfContextModel
from fluentboard_modules.anchoring.crf_files import load_crf
from fluentboard_modules.anchoring.geometric import GeometricRecogniser
from fluentboard_modules.anchoring.observation import ContextModel, Recogniser


def recogniser_of(config: RecognitionConfig) -> Recogniser:
    """The recogniser of a configuration.

    Raises:
        InvalidInput: there is no such file, or it holds something else.
    """
    if config.recogniser == "geometric":
        return GeometricRecogniser()
    raise InvalidInput(
        f"no recogniser is called {config.recogniser!r}; give geometric, or the file of a trained "
        "one"
    )


def context_of(config: RecognitionConfig, recogniser: Recogniser) -> ContextModel | None:
    """The context model of a configuration; None if it names none.

    Raises:
        InvalidInput: there is no such file, or it was trained for other classes.
    """
    if config.context is None:
        return None
    model, graph = load_crf(Path(config.context), recogniser.classes)
    return CrfContextModel(model, graph)
