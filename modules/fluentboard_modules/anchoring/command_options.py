"""Options that the commands of anchoring share: of the simulated scenes that they run on."""

from __future__ import annotations

from typing import Annotated

import typer

SceneFrames = Annotated[int, typer.Option(min=4, help="Per simulated scene.")]
SceneWidth = Annotated[
    int, typer.Option(min=160, max=640, help="Of the simulated images in pixels.")
]
