"""The mapping worker: frames to furniture, placing areas and the map frame, on the board."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from fluentboard.errors import InvalidInput
from fluentboard.model.fluent import Fluent
from fluentboard.model.geometry import Transform
from fluentboard_client import AssertFluent, Client, Command, EndFluent, Event
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.frames.sources import open_source
from fluentboard_modules.mapping.album import Album
from fluentboard_modules.mapping.cad_library import CadLibrary, load_library
from fluentboard_modules.mapping.config import MappingConfig
from fluentboard_modules.mapping.furniture_fluents import FurnitureFluents
from fluentboard_modules.mapping.furniture_item import FurnitureItem
from fluentboard_modules.mapping.furniture_map import FurnitureMap
from fluentboard_modules.mapping.judge import FurnitureJudge
from fluentboard_modules.mapping.map_frame import (
    map_frame_fluents,
    place,
    read_gravity,
    write_transform,
)
from fluentboard_modules.mapping.model_map import with_models
from fluentboard_modules.mapping.near_miss_fluents import near_miss_fluents
from fluentboard_modules.mapping.near_misses import NearMiss
from fluentboard_modules.mapping.pellet import PelletReasoner
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.recollection import FLOOR_AREAS, recollect
from fluentboard_modules.mapping.remembered_places import RememberedPlaces, remembered_planes
from fluentboard_modules.mapping.rules import FurnitureRules, furniture_ontology, load_rules
from fluentboard_modules.mapping.scene_mesh import (
    SceneMesh,
    SurfaceMesh,
    check_mesh_path,
    joined,
    write_mesh,
)
from fluentboard_modules.mapping.single_look import Look, look_at
from fluentboard_modules.mapping.surfaces import detect_regions
from fluentboard_modules.mapping.written_furniture import UpdateConfig
from fluentboard_modules.progress import FrameProgress
from fluentboard_modules.statements import Ending, Statement
from fluentboard_modules.worker import WorkReport, run, stop_on_signals

logger = logging.getLogger(__name__)

_EVIDENCE = "ExistenceEvidence"


class MappingModule:
    """Mapping as the worker loop wants it.

    Args:
        source: name of the recording, for the map frame.
        T_map_world: takes the recording's world frame to the map frame.
        config: of the algorithms.
        update: how much has to change before the board is told.
        library: CAD models that hypotheses are verified with.
        keeps_mesh: whether the surfaces are fused for `mesh`.
        rules: the furniture ontology, by default our own.
    """

    name = "mapping"
    subscription = None

    def __init__(
        self,
        source: str,
        T_map_world: Transform,
        config: MappingConfig | None = None,
        update: UpdateConfig | None = None,
        library: CadLibrary | None = None,
        keeps_mesh: bool = False,
        rules: FurnitureRules | None = None,
    ) -> None:
        self._source = source
        self._T_map_world = T_map_world
        self._config = config or MappingConfig()
        self._rules = rules or load_rules(furniture_ontology())
        noise = self._config.surfaces.noise
        judge = FurnitureJudge(library or CadLibrary(), self._config.verification, noise)
        self._map = FurnitureMap(self._rules, self._config.furniture, noise, judge)
        self._fluents = FurnitureFluents(
            config=update or UpdateConfig(),
            existence=self._config.furniture.fusion.existence,
            symmetry_order={
                furniture.name: furniture.symmetry_order
                for furniture in self._rules.furniture_classes
            },
        )
        self._library = library or CadLibrary()
        self._places: RememberedPlaces | None = None
        self._near_misses: tuple[Fluent, ...] = ()
        self._mesh = SceneMesh(self._config.mesh) if keeps_mesh else None
        self._first_s: float | None = None
        self._last_s = 0.0
        self._album = Album()
        # The frames so far, as long as they are few.
        self._few: list[tuple[SensorFrame, Sequence[PlanarRegion]]] | None = []
        self._look: Look | None = None
        self._nearest: NearMiss | None = None

    @property
    def furniture(self) -> list[FurnitureItem]:
        """The furniture believed in at present."""
        return self._map.furniture() if self._look is None else self._look.furniture

    @property
    def span_s(self) -> tuple[float, ...]:
        """Times of the first and the last frame; empty before the first."""
        return () if self._first_s is None else (self._first_s, self._last_s)

    @property
    def best_view(self) -> SensorFrame | None:
        """The frame that shows most of the furniture; None before the first."""
        return self._album.best(self.furniture)

    def begin(self, board: Client) -> Sequence[Command]:
        """Takes over what the board knows about furniture; writes the map frame."""
        fusion = self._config.furniture.fusion
        known = list(board.fluents("Furniture", is_open=True))
        geometry = {
            fluent.name: fluent
            for class_name in ("Pose", "BBox", "PlacingArea", *FLOOR_AREAS, "Plane", _EVIDENCE)
            for fluent in board.fluents(class_name, is_open=True)
        }
        ended = board.fluents("Furniture", is_open=False)
        self._fluents = replace(
            self._fluents,
            remembered=tuple(recollect(known, geometry, fusion.existence)),
            names=frozenset(fluent.name for fluent in (*known, *ended)),
        )
        planes = remembered_planes(known, geometry)
        beliefs = {known.name: known.belief for known in self._fluents.remembered if known.evidence}
        drop = self._config.furniture.drop_score
        self._places = RememberedPlaces(planes, fusion, drop, beliefs)
        if self._fluents.remembered:
            logger.info("the board knows %d pieces of furniture", len(self._fluents.remembered))
        self._near_misses = tuple(board.fluents("NearMiss"))
        before = {f.name: f for f in board.fluents("MapFrame")}
        return commands_for(map_frame_fluents(self._source, self._T_map_world, before, geometry))

    def notice(self, event: Event) -> None:
        """Subscribes to nothing."""

    def process(self, frame: SensorFrame) -> Sequence[Command]:
        """What a frame changes about the furniture."""
        regions = detect_regions(frame, self._config.surfaces)
        self._map.update(frame, regions, self._rules.classify(regions, explain=False))
        unseen = [known.name for known in self._fluents.remembered]
        gone = self._places.look(frame, unseen) if self._places is not None else set()
        self._first_s = frame.stamp_s if self._first_s is None else self._first_s
        self._last_s = frame.stamp_s
        self._album.add(frame)
        if self._few is not None:
            few = len(self._few) < self._config.furniture.look_frames
            self._few = [*self._few, (frame, regions)] if few else None
        if self._mesh is not None:
            self._mesh.add(frame)
        return self._written(final=False, gone=gone)

    def finish(self) -> Sequence[Command]:
        """The last, best estimates."""
        if not self.span_s:
            return []
        if self._few:
            self._look = look_at(
                self._few, self._rules, self._library, self._config, self._map.furniture()
            )
            near = self._look.near_misses
        else:
            self._map.settle()
            near = self._map.near_misses()
        self._nearest = next((miss for miss, _ in near), None)
        misses = near_miss_fluents(near, self._near_misses, self._last_s)
        return [*self._written(final=True), *commands_for(misses)]

    def status(self) -> str:
        """How many pieces of each class, and what has changed since the board was told of them."""
        counts = Counter(item.class_name for item in self.furniture)
        told = [f"{count} {name}" for name, count in sorted(counts.items())]
        told += [f"{name} was moved" for name in self._fluents.moved]
        told += [f"{name} is gone" for name in self._fluents.gone]
        if not told and self._nearest is not None:
            told = [f"nothing found (nearest: {self._nearest.class_name}, {self._nearest.reason})"]
        return ", ".join(told)

    def draw(self, directory: Path) -> Sequence[Path]:
        """The planes and furniture from above."""
        from fluentboard_modules.mapping.picture_overlay import draw_overlay
        from fluentboard_modules.mapping.picture_plan import draw_plan
        from fluentboard_modules.mapping.picture_style import save_picture

        if self._look is not None:
            planes, classification = self._look.regions, self._look.classification
        else:
            _, planes, classification = self._map.classified_planes(explain=False)
        labels, furniture = classification.labels, self.furniture
        plan = draw_plan(planes, labels, furniture, path_map=self._album.path_map)
        save_picture(plan, directory / "map.png")
        drawn = [directory / "map.png"]
        frame = self.best_view
        if frame is not None:
            save_picture(draw_overlay(frame, planes, labels, furniture), directory / "view.png")
            drawn.append(directory / "view.png")
        return drawn

    def mesh(self) -> SurfaceMesh:
        """The surfaces seen so far, with CAD models in place of what they explain."""
        seen = self._mesh.mesh() if self._mesh is not None else joined([])
        return with_models(seen, self.furniture, self._library)

    def _written(self, *, final: bool, gone: Collection[str] = ()) -> list[Command]:
        self._fluents, statements = self._fluents.update(
            self.furniture,
            self._last_s,
            final=final,
            gone=gone,
            doubts=self._places.doubts if self._places is not None else None,
        )
        return commands_for(statements)


def commands_for(statements: Iterable[Statement]) -> list[Command]:
    """The commands that make the board say this."""
    return [
        EndFluent(statement.name, statement.finish)
        if isinstance(statement, Ending)
        else AssertFluent(statement, merge=True)
        for statement in statements
    ]


def run_mapping(
    frames: str,
    board: str,
    *,
    config: MappingConfig | None = None,
    gravity: Path | None = None,
    start_s: float | None = None,
    plot: Path | None = None,
    frame_out: Path | None = None,
    token: str | None = None,
    models: Path | None = None,
    mesh: Path | None = None,
    ontologies: Sequence[Path] = (),
    reasoner: str = "compiled",
) -> WorkReport:
    """Maps a source to its end, or until told to stop.

    Args:
        frames: as for `open_source`.
        board: address of the board.
        config: of all steps.
        gravity: file with the direction things fall.
        start_s: time of the first frame.
        plot: folder for pictures.
        frame_out: file for the map frame.
        token: bearer token for the board.
        models: folder of CAD models named after furniture classes.
        mesh: file for the mesh of the room with the CAD models in it (.ply, .glb).
        ontologies: files in Turtle with more classes of furniture.
        reasoner: `compiled` or `pellet`.

    Raises:
        FluentboardError: the source, the board or a file is not what it should be.
    """
    config = config or MappingConfig()
    if mesh is not None:
        check_mesh_path(mesh)
    turtle = furniture_ontology(ontologies)
    rules = load_rules(turtle)
    if reasoner == "pellet":
        rules = FurnitureRules(rules.rules, PelletReasoner(rules.rules, turtle))
    elif reasoner != "compiled":
        raise InvalidInput(f"no reasoner {reasoner!r}; give compiled or pellet")
    with stop_on_signals() as stop:
        source, T_map_world = place(
            open_source(frames, start_s=start_s, token=token),
            config,
            gravity and read_gravity(gravity),
        )
        if frame_out is not None:
            write_transform(frame_out, T_map_world)
        module = MappingModule(
            source.name,
            T_map_world,
            config,
            library=_library(models, rules),
            keeps_mesh=mesh is not None,
            rules=rules,
        )
        with Client(board, author=module.name, token=token) as client, FrameProgress() as progress:
            report = run(module, source, client, progress=progress, stop=stop)
        if plot is not None:
            plot.mkdir(parents=True, exist_ok=True)
            module.draw(plot)
        if mesh is not None:
            write_mesh(module.mesh(), mesh)
    return report


def _library(models: Path | None, rules: FurnitureRules) -> CadLibrary:
    if models is None:
        return CadLibrary()
    return load_library(models, [furniture.name for furniture in rules.furniture_classes])
