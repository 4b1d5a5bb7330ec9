"""Furniture hypotheses over many frames to pieces of furniture with stable names.

`FurnitureMap.update` takes one frame at a time. It adds the frame's regions to the planes of the
map, classifies those, and decides which hypotheses are pieces of furniture. It touches nothing
outside and draws no random numbers: the same frames give the same furniture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fluentboard.model.geometry import BoundingBox
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.candidates import (
    Candidate,
    Stand,
    believed,
    case_of,
    choose,
    is_inside,
    lies_on,
    place_candidate,
    share_a_place,
    takes_the_place,
    with_verdicts,
)
from fluentboard_modules.mapping.config import DepthNoiseConfig, FurnitureMapConfig
from fluentboard_modules.mapping.floor import sloping_floor
from fluentboard_modules.mapping.furniture_change import differs
from fluentboard_modules.mapping.furniture_item import (
    CadFit,
    FurnitureChange,
    FurnitureItem,
    FurniturePlane,
    box_overlap,
)
from fluentboard_modules.mapping.furniture_track import Track, described
from fluentboard_modules.mapping.judge import FurnitureJudge
from fluentboard_modules.mapping.loose_planes import unexplained
from fluentboard_modules.mapping.near_misses import NearMiss
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.plane_map import PlaneMap
from fluentboard_modules.mapping.room_walls import is_in_wall, room_walls
from fluentboard_modules.mapping.rule_language import FurnitureClass
from fluentboard_modules.mapping.rules import (
    Classification,
    FurnitureHypothesis,
    FurnitureRules,
    partial_hypotheses,
)

_PIXELS_APART = 8  # of a depth image, where it is looked for what is behind walls


class FurnitureMap:
    """The furniture of a room, updated frame by frame.

    Args:
        rules: the furniture ontology.
        config: when a hypothesis is furniture.
        noise: of the depth sensor.
        judge: verifies hypotheses; without one, all are believed.
    """

    def __init__(
        self,
        rules: FurnitureRules,
        config: FurnitureMapConfig | None = None,
        noise: DepthNoiseConfig | None = None,
        judge: FurnitureJudge | None = None,
    ) -> None:
        self._judge = judge
        self._rules = rules
        self._config = config or FurnitureMapConfig()
        self._plane_map = PlaneMap(self._config.fusion, noise or DepthNoiseConfig())
        self._tracks: list[Track] = []
        self._numbers: dict[str, int] = {}
        self._stamp_s = 0.0
        self._walls: list[PlanarRegion] = []

    def update(
        self,
        frame: SensorFrame,
        regions: Sequence[PlanarRegion],
        classification: Classification | None = None,
    ) -> list[FurnitureChange]:
        """Takes in one frame.

        Args:
            frame: the frame, placed in the map frame.
            regions: its planar regions, from `detect_regions`.
            classification: `rules.classify(regions)`, if known: frames that show a whole piece at
                once are counted as direct support.

        Returns:
            The pieces that appeared, changed or disappeared.
        """
        self._stamp_s = frame.stamp_s
        if self._judge is not None:
            self._judge.look(frame)
        plane_of, _ = self._plane_map.update(frame, regions)
        identifiers, map_regions, verdict = self.classified_planes(explain=False)
        candidates = self._candidates(identifiers, map_regions, verdict)
        direct = {
            (hypothesis.class_name, plane_of[hypothesis.main_plane])
            for hypothesis in (classification.hypotheses if classification else ())
        }
        chosen = self._choose(candidates)
        self._follow(chosen, candidates, direct)
        return self._report()

    def settle(self) -> list[FurnitureChange]:
        """Verifies everything that is due on all that was seen, after the last frame.

        Returns:
            The pieces that appeared, changed or disappeared.
        """
        # What the first pass believes in explains planes of others in the second.
        return [*self._settle_once(), *self._settle_once()]

    def _settle_once(self) -> list[FurnitureChange]:
        identifiers, map_regions, verdict = self.classified_planes(explain=False)
        # Nothing more will come that could speak for them.
        candidates = [
            believed(candidate, self._config.fusion.existence)
            for candidate in self._candidates(identifiers, map_regions, verdict, settle=True)
        ]
        chosen = self._choose(candidates)
        self._follow(chosen, candidates, set(), is_last=True)
        for track in self._tracks:
            if track.n_without > 0 and self._is_rejected(track):
                track.n_without = self._config.patience_frames + 1
        return self._report()

    def furniture(self) -> list[FurnitureItem]:
        """The pieces of furniture believed in now, oldest first."""
        return [track.item for track in self._tracks if track.is_accepted]

    def near_misses(self) -> list[tuple[NearMiss, FurniturePlane]]:
        """Planes that are nearly furniture and belong to no piece, the nearest first."""
        identifiers, regions, verdict = self.classified_planes()
        taken = {plane.identifier for item in self.furniture() for plane in item.planes}
        frames_of = {k: plane.n_frames for k, plane in self._plane_map.planes.items()}
        return unexplained(verdict, identifiers, regions, frames_of, taken)

    def classified_planes(
        self, *, explain: bool = True
    ) -> tuple[list[int], list[PlanarRegion], Classification]:
        """Identifiers of the map's planes, the planes, and what the ontology says about them.

        Args:
            explain: whether to look for near misses.
        """
        known = self._plane_map.regions(self._config.least_frames)
        identifiers = [identifier for identifier, _ in known]
        regions = [region for _, region in known]
        return (
            identifiers,
            regions,
            self._rules.classify(
                regions, floor=sloping_floor(regions, self._config.floor_reach_m), explain=explain
            ),
        )

    def _candidates(
        self,
        identifiers: list[int],
        regions: list[PlanarRegion],
        classification: Classification,
        *,
        settle: bool = False,
    ) -> list[Candidate]:
        """The hypotheses about planes of the map, placed, verified as far as they are due."""
        planes = self._plane_map.planes
        n_frames = {identifier: plane.n_frames for identifier, plane in planes.items()}
        beliefs = {identifier: plane.existence for identifier, plane in planes.items()}
        found = [
            place_candidate(
                hypothesis,
                self._rules.rules.furniture[hypothesis.class_name],
                identifiers,
                regions,
                n_frames,
                beliefs,
                self._config,
            )
            for hypothesis in self._hypotheses(classification, regions)
        ]
        if self._judge is None or not self._judge.is_on:
            return found
        found = [c for c in found if not self._is_explained(c.key, c.planes)]
        # What is not believed for lack of frames need not be verified yet.
        worth = [c for c in found if settle or c.score >= self._config.drop_score]
        cases = [case_of(c, min(planes[c.main_plane].stamps_s, default=None)) for c in worth]
        self._judge.consider(cases, all_of_them=settle)
        self._walls = room_walls(regions, self._judge.views, _PIXELS_APART)
        return [
            verified
            for candidate in found
            for verified in with_verdicts(candidate, self._judge.verdicts(candidate.key))
            if not self._is_in_wall(verified.fit, verified.geometry.box, candidate.furniture)
        ]

    def _is_in_wall(self, fit: CadFit | None, box: BoundingBox, furniture: FurnitureClass) -> bool:
        """Whether the walls, as far as they have been seen, leave no room for a CAD model."""
        if fit is None or not fit.is_exact:
            return False  # of planes alone the box is too uncertain
        return is_in_wall(box, self._walls, may_touch=bool(furniture.front_planes))

    def _hypotheses(
        self, classification: Classification, regions: Sequence[PlanarRegion]
    ) -> list[FurnitureHypothesis]:
        """What satisfies a definition; with CAD models to try, also what is a part of one."""
        partial = [
            hypothesis
            for furniture in self._rules.furniture_classes
            if self._judge is not None and self._judge.has_models(furniture.name)
            for hypothesis in partial_hypotheses(classification, furniture, regions)
        ]
        return [*classification.hypotheses, *partial]

    def _is_explained(self, key: tuple[str, int | None], planes: Sequence[FurniturePlane]) -> bool:
        """Whether the single plane of a hypothesis belongs to a piece that is known already."""
        return len(planes) == 1 and any(
            track.is_accepted
            and self._key(track) != key
            and is_inside(planes[0].region, track.item.box)
            and self._has_face(track.item, planes[0].region)
            for track in self._tracks
        )

    def _has_face(self, item: FurnitureItem, region: PlanarRegion) -> bool:
        """Whether a plane within the box of a piece is a part of it: below a top there is room."""
        if item.cad is None or not item.cad.is_exact or self._judge is None:
            return False
        model = self._judge.model(item.cad.model)
        if model is None or not self._rules.rules.furniture[item.class_name].has_room_below:
            return True
        return lies_on(region, model, item.cad.pose)

    def _choose(self, candidates: list[Candidate]) -> list[Candidate]:
        followed = {self._key(track) for track in self._tracks if track.is_accepted}
        return choose(candidates, followed, self._config)

    def _follow(
        self,
        chosen: list[Candidate],
        candidates: list[Candidate],
        direct: set[tuple[str, int]],
        *,
        is_last: bool = False,
    ) -> None:
        """Joins this update's hypotheses with the pieces known so far."""
        free = list(chosen)
        seen_now = self._plane_map.planes_seen_last
        for track in self._tracks:
            candidate = self._match(track, free)
            if candidate is None:
                # What is out of sight is not judged; what is gone is.
                main_plane = self._plane_map.current(track.main_plane)
                track.n_without += is_last or main_plane is None or main_plane in seen_now
                if any(takes_the_place(one, self._stand(track), self._config) for one in chosen):
                    track.n_without = self._config.patience_frames + 1
                continue
            free.remove(candidate)
            track.n_without = 0
            track.main_plane = candidate.main_plane
            key = (candidate.hypothesis.class_name, candidate.main_plane)
            track.n_direct += key in direct
            track.item = self._describe(candidate, candidates, track)
            track.is_pending = candidate.is_pending
        for candidate in free:
            key = (candidate.hypothesis.class_name, candidate.main_plane)
            track = Track(
                item=self._describe(candidate, candidates, None),
                main_plane=candidate.main_plane,
                n_direct=int(key in direct),
                is_pending=candidate.is_pending,
            )
            self._tracks.append(track)

    def _is_rejected(self, track: Track) -> bool:
        """Whether verification came to speak against a piece that was believed in."""
        verdicts = None if self._judge is None else self._judge.verdicts(self._key(track))
        return verdicts is not None and not any(verdict.is_accepted for verdict in verdicts)

    def _match(self, track: Track, free: list[Candidate]) -> Candidate | None:
        """The hypothesis about the same main plane, or else about the same place."""
        same_class = [
            candidate
            for candidate in free
            if candidate.hypothesis.class_name == track.item.class_name
        ]
        main_plane = self._plane_map.current(track.main_plane)
        same_plane = [c for c in same_class if c.main_plane == main_plane]
        if same_plane and not any(c.is_in_row for c in same_plane):
            return same_plane[0]
        taken = {
            self._plane_map.current(other.main_plane)
            for other in self._tracks
            if other is not track
        }
        rated = [
            (box_overlap(track.item.box, candidate.geometry.box), candidate)
            for candidate in same_class
            if candidate.main_plane not in taken or candidate.is_in_row
        ]
        best = max(rated, key=lambda pair: pair[0], default=(0.0, None))
        return best[1] if best[0] >= self._config.same_place_overlap else None

    def _describe(
        self, candidate: Candidate, candidates: list[Candidate], track: Track | None
    ) -> FurnitureItem:
        return described(
            candidate,
            candidates,
            track,
            self._stamp_s,
            self._frames_of(candidate),
            self._config.hypotheses,
            is_seen=candidate.main_plane in self._plane_map.planes_seen_last,
        )

    def _frames_of(self, candidate: Candidate) -> tuple[float, ...]:
        """Stamps of the frames that saw one of its planes."""
        planes = self._plane_map.planes
        known = [p.identifier for p in candidate.planes if p.identifier in planes]
        return tuple(sorted({stamp_s for k in known for stamp_s in planes[k].stamps_s}))

    def _report(self) -> list[FurnitureChange]:
        changes: list[FurnitureChange] = []
        kept: list[Track] = []
        explained = {
            self._plane_map.current(track.main_plane)
            for track in self._tracks
            if track.n_without == 0 and track.item.score >= self._config.accept_score
        }
        for track in self._tracks:
            order = self._stand(track).furniture.symmetry_order
            main_plane = self._plane_map.current(track.main_plane)
            lost = track.n_without > self._config.patience_frames or (
                # Nothing to wait for: the plane is gone, or is something else by now.
                track.n_without > 0
                and (main_plane is None or main_plane in explained or self._is_no_more(track))
            )
            if track.is_accepted and (lost or track.item.score < self._config.drop_score):
                changes.append(FurnitureChange("disappeared", track.item))
                continue
            if lost:
                continue  # it never was furniture
            kept.append(track)
            if (
                not track.is_accepted
                and track.item.score >= self._config.accept_score
                and not track.is_pending
            ):
                track.is_accepted = True
                track.item = replace(
                    track.item, identifier=self._new_identifier(track.item.class_name)
                )
                track.reported = track.item
                changes.append(FurnitureChange("appeared", track.item))
            elif (
                track.is_accepted
                and track.reported is not None
                and differs(track.reported, track.item, order, self._config)
            ):
                track.reported = track.item
                changes.append(FurnitureChange("changed", track.item))
        self._tracks = kept
        return changes

    def _is_no_more(self, track: Track) -> bool:
        """Whether what has no hypothesis is in a wall, in the place of another, or a part of it."""
        stand, item = self._stand(track), track.item
        return (
            self._is_in_wall(stand.fit, stand.box, stand.furniture)
            or self._is_explained(self._key(track), item.planes)
            or any(
                other.n_without == 0
                and other.is_accepted
                and share_a_place(self._stand(other), stand, self._config)
                for other in self._tracks
            )
        )

    def _stand(self, track: Track) -> Stand:
        furniture = self._rules.rules.furniture[track.item.class_name]
        return Stand(furniture, track.item.box, track.item.cad)

    def _key(self, track: Track) -> tuple[str, int | None]:
        """Class and main plane, as of a candidate."""
        return track.item.class_name, self._plane_map.current(track.main_plane)

    def _new_identifier(self, class_name: str) -> str:
        number = self._numbers.get(class_name, 0) + 1
        self._numbers[class_name] = number
        return f"{class_name[0].lower()}{class_name[1:]}{number}"
