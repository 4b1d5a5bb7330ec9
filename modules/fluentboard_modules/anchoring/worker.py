"""The anchoring worker: frames to objects with stable names, on the board."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from fluentboard_client import AssertFluent, Client, Command, Delta, EndFluent, Event
from fluentboard_modules.anchoring.anchors import Anchor
from fluentboard_modules.anchoring.config import AnchoringConfig
from fluentboard_modules.anchoring.context_model import CrfContextModel
from fluentboard_modules.anchoring.estimate import BoxEstimate
from fluentboard_modules.anchoring.pictures import Album, draw_album
from fluentboard_modules.anchoring.pipeline import AnchoringPipeline
from fluentboard_modules.anchoring.posted_detections import PostedDetections
from fluentboard_modules.anchoring.recognisers import context_of, recogniser_of
from fluentboard_modules.anchoring.recollection import BoardView, Recollection, recollect
from fluentboard_modules.anchoring.search_answers import SearchView, answers
from fluentboard_modules.anchoring.settings import for_short_recordings
from fluentboard_modules.anchoring.similarity import load_mismatch
from fluentboard_modules.anchoring.sync import ObjectFluents, Scene
from fluentboard_modules.frames.sensor_frame import FrameSource, SensorFrame
from fluentboard_modules.progress import FrameProgress
from fluentboard_modules.statements import Ending, Statement
from fluentboard_modules.worker import WorkReport, run, stop_on_signals

logger = logging.getLogger(__name__)

# The thesis's query (Section 4.2.4), restricted to what is open when it is read, and what else
# others may say about objects: that a gripper holds them, and where they can stand.
_SUBSCRIPTION = """
SELECT DISTINCT ?instance WHERE {
  {
    ?instance upper:hasBoundingBox ?any .
    ?instance a ?class .
    { ?class rdfs:subClassOf* race:Kitchenware }
    UNION
    { ?class rdfs:subClassOf* race:PersonalItem }
  }
  UNION { ?instance a race:Holding }
  UNION { ?instance a race:PlacingArea }
  UNION { ?instance a race:SearchObjectActivity }
  UNION { ?instance a race:SearchVolume }
}
"""
_OBJECT_CLASSES = ("Kitchenware", "PersonalItem")


class AnchoringModule:
    """Anchoring as the worker loop wants it.

    Args:
        config: of all steps.
        first: what to write before anything else, such as the map frame.
        seed: of the random samples that support planes are found by.
        keep_pictures: whether frames are kept for `draw`.
    """

    name = "anchoring"
    subscription = _SUBSCRIPTION

    def __init__(
        self,
        config: AnchoringConfig | None = None,
        first: Callable[[Client], Sequence[Statement]] | None = None,
        *,
        seed: int = 0,
        keep_pictures: bool = False,
    ) -> None:
        self._config = config or AnchoringConfig()
        self._posted = PostedDetections(self._config.recognition.detections)
        recogniser = recogniser_of(self._config.recognition, self._posted)
        context = context_of(self._config.recognition, recogniser)
        self._context = context if isinstance(context, CrfContextModel) else None
        self._has_searches = False
        model = self._config.world.association.model
        self._pipeline = AnchoringPipeline(
            recogniser, load_mismatch(Path(model) if model else None), self._config, context, seed
        )
        self._world = self._pipeline.world
        self._fluents = ObjectFluents(
            recogniser.classes, context.classes if context else (), self._config.update
        )
        self._first = first
        self._board: Client | None = None
        self._is_stale = False
        self._last: SensorFrame | None = None
        self._album = Album() if keep_pictures else None

    @property
    def anchors(self) -> list[Anchor]:
        """The anchors with the names and classes of their fluents."""
        return [self._labelled(anchor) for anchor in self._world.anchors]

    def begin(self, board: Client) -> Sequence[Command]:
        """Takes over the objects, placing areas and holdings that the board knows."""
        self._board = self._posted.board = board
        for class_name in (*_OBJECT_CLASSES, "On"):
            self._fluents.take_names(fluent.name for fluent in board.fluents(class_name))
        statements = list(self._first(board)) if self._first else []
        statements += self._reconcile(_read(board))
        self._has_searches = True
        if self._world.anchors:
            logger.info("the board knows %d objects", len(self._world.anchors))
        return commands_for(statements)

    def notice(self, event: Event) -> None:
        """Others changed something: what the board says is read again before the next frame."""
        is_ours = (
            isinstance(event, Delta)
            and bool(event.fluents)
            and all(change.author == self.name for change in event.fluents)
        )
        self._is_stale = self._is_stale or not is_ours

    def process(self, frame: SensorFrame) -> Sequence[Command]:
        """What a frame changes about the objects."""
        statements: list[Statement] = []
        if self._is_stale and self._board is not None:
            self._is_stale = False
            self._has_searches = True
            statements += self._reconcile(_read(self._board))
        step = self._pipeline.update(frame)
        self._last = frame
        for decision in step.decisions:
            logger.debug("frame %d: %s", frame.index, decision)
        scene = Scene(self._world.anchors, step.decisions, self._world.looks, frame.stamp_s)
        statements += self._fluents.update(scene)
        statements += self._answers(frame.stamp_s)
        if self._album is not None:
            self._album.add(frame, self.anchors, step.segmentation.tops)
        return commands_for(statements)

    def finish(self) -> Sequence[Command]:
        """The last, best estimates."""
        if self._last is None:
            return []
        scene = Scene(self._world.anchors, (), self._world.looks, self._last.stamp_s)
        return commands_for(self._fluents.update(scene, final=True))

    def status(self) -> str:
        """How many objects of each class."""
        counts = Counter(anchor.class_name for anchor in self.anchors)
        return ", ".join(f"{count} {name}" for name, count in sorted(counts.items()))

    def draw(self, directory: Path) -> Sequence[Path]:
        """The anchors over the colour images."""
        return draw_album(self._album, directory) if self._album is not None else []

    def _answers(self, now_s: float) -> list[Statement]:
        """Where the targets of open searches may be, if the context model is asked."""
        if self._context is None or self._board is None or not self._has_searches:
            return []
        view = _read_searches(self._board)
        # No need to look again before the board tells of a change.
        self._has_searches = bool(view.searches or view.beliefs)
        objects = [anchor.scene_object() for anchor in self._world.anchors]
        return answers(view, objects, self._context, now_s)

    def _labelled(self, anchor: Anchor) -> Anchor:
        told = self._fluents.written(anchor.identifier)
        return replace(anchor, name=told.name, class_name=told.class_name) if told else anchor

    def _reconcile(self, view: BoardView) -> list[Statement]:
        """Takes over what others have written since."""
        for area in view.placing_areas():
            self._fluents.areas.put(area)
            self._pipeline.tables.know(area.name, area.box)
        for name in self._fluents.areas.names - {area.name for area in view.areas}:
            self._fluents.areas.drop(name)
            self._pipeline.tables.forget(name)
        present = {r.written.name: r for r in recollect(view, self._world.classes)}
        for anchor in self._world.anchors:
            told = self._fluents.written(anchor.identifier)
            if told is not None and told.name not in {thing.name for thing in view.objects}:
                logger.info("%s has been ended by somebody else", told.name)
                self._world.remove(anchor.identifier)
                self._fluents.forget(anchor.identifier)
        for name, recollection in present.items():
            identifier = self._fluents.identifier_of(name)
            if identifier is None:
                self._find(recollection)
            else:
                self._moved(identifier, recollection)
        statements = self._hold(view)
        self._fluents.prune(view.open_names)
        return statements + self._fluents.settle(self._world.anchors)

    def _find(self, recollection: Recollection) -> None:
        told = recollection.written
        anchor = self._world.find(told.name, told.class_name, told.box)
        ours = recollection.author == self.name
        confidence = recollection.confidence
        self._world.change(
            replace(
                anchor,
                is_external=not ours,
                confidence=anchor.confidence if confidence is None else confidence,
                last_confidence=anchor.confidence if confidence is None else confidence,
            )
        )
        self._fluents.adopt(anchor.identifier, told)

    def _moved(self, identifier: int, recollection: Recollection) -> None:
        """Somebody else has given the object another place."""
        known, told = self._fluents.written(identifier), recollection.written
        anchor = self._world.anchor(identifier)
        if known is None or anchor is None or set(told.parts) <= set(known.parts):
            return
        logger.info("%s has been given another place by somebody else", told.name)
        estimate = BoxEstimate.of_box(told.box)
        self._world.change(replace(anchor, estimate=estimate, is_adrift=False, empty_looks=0))
        self._fluents.adopt(
            identifier,
            replace(
                known,
                box=told.box,
                parts=told.parts,
                generation=max(known.generation, told.generation),
                on=told.on,
                area=told.area,
            ),
        )

    def _hold(self, view: BoardView) -> list[Statement]:
        """Marks what grippers hold, and what they have put down somewhere."""
        held = view.held()
        statements: list[Statement] = []
        for anchor in self._world.anchors:
            told = self._fluents.written(anchor.identifier)
            if told is None:
                continue
            is_held = told.name in held
            if is_held and not anchor.is_held:
                if told.on in view.open_names:
                    statements += self._fluents.lifted(anchor.identifier, held[told.name])
                self._world.change(replace(anchor, is_held=True, is_adrift=False))
            elif anchor.is_held and not is_held:
                # Put down, nobody said where, unless its place was written in the meantime.
                lies_where_it_was = told.on in view.open_names
                self._world.change(replace(anchor, is_held=False, is_adrift=not lies_where_it_was))
        return statements


def commands_for(statements: Iterable[Statement]) -> list[Command]:
    """The commands that make the board say this."""
    return [
        EndFluent(statement.name, statement.finish)
        if isinstance(statement, Ending)
        else AssertFluent(statement, merge=True)
        for statement in statements
    ]


def _read(board: Client) -> BoardView:
    objects = {
        fluent.name: fluent
        for class_name in _OBJECT_CLASSES
        for fluent in board.fluents(class_name, is_open=True)
    }
    geometry = {
        fluent.name: fluent
        for class_name in ("Pose", "BBox")
        for fluent in board.fluents(class_name, is_open=True)
    }
    areas, holdings, relations, evidence = (
        list(board.fluents(class_name, is_open=True))
        for class_name in ("PlacingArea", "Holding", "On", "AnchoringEvidence")
    )
    return BoardView(list(objects.values()), geometry, areas, holdings, relations, evidence)


def _read_searches(board: Client) -> SearchView:
    searches = list(board.fluents("SearchObjectActivity", is_open=True))
    beliefs = [
        belief
        for belief in board.fluents("VolumeBelief", is_open=True)
        if "context" in belief.values("hasProbabilitySource")
    ]
    if not searches:
        return SearchView([], [], beliefs, {})
    geometry = {
        fluent.name: fluent
        for class_name in ("Pose", "BBox")
        for fluent in board.fluents(class_name, is_open=True)
    }
    volumes = list(board.fluents("SearchVolume", is_open=True))
    return SearchView(searches, volumes, beliefs, geometry)


def run_anchoring(
    source: FrameSource,
    board: str,
    *,
    config: AnchoringConfig | None = None,
    first: Callable[[Client], Sequence[Statement]] | None = None,
    plot: Path | None = None,
    seed: int = 0,
    token: str | None = None,
) -> WorkReport:
    """Anchors the objects of a source to its end, or until told to stop.

    Args:
        source: frames in the map frame.
        board: address of the board.
        config: of the module.
        first: what to write before anything else.
        plot: folder for pictures.
        seed: of whatever is random.
        token: bearer token for the board.

    Raises:
        FluentboardError: the source, the board or a file is not what it should be.
    """
    config = for_short_recordings(config or AnchoringConfig(), source)
    module = AnchoringModule(config, first, seed=seed, keep_pictures=plot is not None)
    with (
        stop_on_signals() as stop,
        Client(board, author=module.name, token=token) as client,
        FrameProgress() as progress,
    ):
        report = run(module, source, client, progress=progress, stop=stop)
    if plot is not None:
        plot.mkdir(parents=True, exist_ok=True)
        module.draw(plot)
    return report
