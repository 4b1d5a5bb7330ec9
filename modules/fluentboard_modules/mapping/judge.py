"""Verification over many frames: which hypotheses are due, and what is known about the others."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fluentboard.model.geometry import BoundingBox, Pose, Transform
from fluentboard_modules.frames.sensor_frame import SensorFrame
from fluentboard_modules.mapping.cad_library import CadLibrary
from fluentboard_modules.mapping.cad_models import CadModel
from fluentboard_modules.mapping.config import DepthNoiseConfig, VerificationConfig
from fluentboard_modules.mapping.depth_views import DepthView, ViewMemory, best_views
from fluentboard_modules.mapping.hypotheses import FurnitureGeometry
from fluentboard_modules.mapping.planar_region import PlanarRegion
from fluentboard_modules.mapping.verify import Verdict, verify
from fluentboard_modules.mapping.visibility import compare_with_views
from fluentboard_modules.mapping.work_ahead import worked_ahead

_FRAMES_OF_A_VISIT = 3  # that show it again, before it is verified by them
_GONE_M2 = 0.05  # of a piece's surface, across the view


@dataclass(frozen=True, eq=False)
class Case:
    """A hypothesis that may have to be verified.

    Attributes:
        key: the same for the same hypothesis in later frames.
        class_name: what it says.
        geometry: where it puts the piece.
        parts: its planes, the main plane first.
        n_frames: that support it.
        since_s: when its main plane was first seen, if that is known.
    """

    key: Hashable
    class_name: str
    geometry: FurnitureGeometry
    parts: tuple[PlanarRegion, ...]
    n_frames: int
    since_s: float | None = None


@dataclass(frozen=True, slots=True)
class _Ruling:
    """What was decided, and what it was decided on."""

    case: Case
    verdicts: tuple[Verdict, ...]
    visit_s: float


class FurnitureJudge:
    """Verifies a few hypotheses per frame and remembers what came out.

    After a pause in the frames a visit begins, and furniture may have been moved. What first shows
    then is judged by the images of this visit only: those before may show its place empty. And
    where these see through what was believed in, those before do not count.

    Args:
        library: CAD models.
        config: of the comparison.
        noise: of the depth sensor.
    """

    def __init__(
        self, library: CadLibrary, config: VerificationConfig, noise: DepthNoiseConfig
    ) -> None:
        self._library = library
        self._config = config
        self._views = ViewMemory(noise)
        self._rulings: dict[Hashable, _Ruling] = {}
        self._visit_s = -math.inf
        self._last_s = math.inf

    @property
    def is_on(self) -> bool:
        """Whether hypotheses have to be verified before they are believed."""
        return self._config.is_on

    @property
    def views(self) -> list[DepthView]:
        """The depth images kept, oldest first."""
        return self._views.since()

    def has_models(self, class_name: str) -> bool:
        """Whether there are CAD models of a class."""
        return self.is_on and bool(self._library.of_class(class_name))

    def model(self, name: str) -> CadModel | None:
        """The CAD model of a name; None for one that was made up."""
        return self._library.named(name)

    def look(self, frame: SensorFrame) -> DepthView:
        """Keeps a frame."""
        if frame.stamp_s - self._last_s > self._config.visit_gap_s:
            self._visit_s = frame.stamp_s
        self._last_s = frame.stamp_s
        return self._views.add(frame)

    def consider(self, cases: Sequence[Case], *, all_of_them: bool = False) -> None:
        """Verifies the hypotheses that are due: never seen ones first, then the most outdated.

        Args:
            cases: all hypotheses worth it at present.
            all_of_them: whether every one that is due is verified, however long it takes.
        """
        due = [
            (urgency, k)
            for k, case in enumerate(cases)
            if (urgency := self._urgency(case, is_last=all_of_them)) > 0
        ]
        due.sort(key=lambda pair: (-pair[0], pair[1]))
        chosen = due if all_of_them else due[: self._config.cases_per_frame]
        work = (cases[k] for _, k in chosen)
        for case, ruling in list(worked_ahead(self._rule, work, self._config.threads)):
            self._rulings[case.key] = ruling

    def verdicts(self, key: Hashable) -> tuple[Verdict, ...] | None:
        """What was decided about a hypothesis; None if it is still pending."""
        ruling = self._rulings.get(key)
        return None if ruling is None else ruling.verdicts

    def _rule(self, case: Case) -> _Ruling:
        before = self._rulings.get(case.key)
        is_new = case.since_s is not None and case.since_s >= self._visit_s
        verdicts = verify(
            case.class_name,
            case.geometry,
            case.parts,
            self._views.since(self._visit_s if is_new else None),
            self._library,
            self._config,
            before.verdicts[0] if before is not None and len(before.verdicts) == 1 else None,
        )
        if not is_new and math.isfinite(self._visit_s):
            verdicts = tuple(
                replace(verdict, is_accepted=False) if self._is_gone(verdict) else verdict
                for verdict in verdicts
            )
        return _Ruling(case, verdicts, self._visit_s)

    def _is_gone(self, verdict: Verdict) -> bool:
        """Whether the images of this visit see through what those of all visits show."""
        low, high = verdict.model.mesh.bounds
        T_map_model = verdict.standing.transform
        centre = T_map_model.apply(0.5 * (low + high)[None])[0]
        radius = 0.5 * float(np.linalg.norm((high - low)[:2])) + 0.1
        views = self._views.since(self._visit_s)
        chosen = best_views(views, centre, radius, self._config.views_max)
        seen = compare_with_views(verdict.model, T_map_model, chosen, self._config.visibility)
        return seen.violated > max(seen.explained, _GONE_M2)

    def _urgency(self, case: Case, *, is_last: bool) -> float:
        """0 if nothing has changed since the last verification, infinite if there was none."""
        ruling = self._rulings.get(case.key)
        if ruling is None:
            return math.inf
        if is_last and math.isfinite(self._visit_s):
            return 1.0  # it may have been verified before its place was seen in this visit
        is_of_another_visit = ruling.visit_s != self._visit_s
        if is_of_another_visit and case.n_frames >= ruling.case.n_frames + _FRAMES_OF_A_VISIT:
            return 1.0
        if len(case.parts) != len(ruling.case.parts):
            return 1.0  # more of it, or less, is known
        before, now = ruling.case.geometry, case.geometry
        moved = math.hypot(now.pose.x - before.pose.x, now.pose.y - before.pose.y)
        turned = abs(math.remainder(now.pose.yaw_rad - before.pose.yaw_rad, 0.5 * math.pi))
        grown = float(np.abs(now.box.sizes - before.box.sizes).max())
        seen = case.n_frames / (self._config.again_factor * ruling.case.n_frames + 2.0)
        change = max(
            moved / self._config.again_moved_m,
            turned / self._config.again_turned_rad,
            grown / (2.0 * self._config.again_moved_m),
            seen,
        )
        return change if change >= 1.0 else 0.0


def verified_geometry(verdict: Verdict, main: PlanarRegion) -> FurnitureGeometry:
    """Pose and box of a piece from the CAD model that explains it.

    The origin stays where the hypothesis would put it: at the middle of the model's main face.
    """
    standing, model = verdict.standing, verdict.model
    T_map_model = standing.transform
    face = model.top_faces(main.height_m, 0.08)
    low, high = model.mesh.bounds
    middle = 0.5 * (low + high)[:2] if face is None else face.mean(axis=0)
    x, y, _ = T_map_model.apply(np.array([*middle, 0.0]))
    T_map_box = T_map_model @ Transform.from_parts(np.eye(3), 0.5 * (low + high))
    size = (float(v) for v in high - low)
    return FurnitureGeometry(
        Pose.from_rpy(float(x), float(y), main.height_m, yaw=standing.yaw_rad),
        BoundingBox(Pose.from_transform(T_map_box), *size),
        0,
    )
