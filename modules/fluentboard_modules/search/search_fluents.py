"""What one robot says about its part of a search on the board (pure)."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.geometry import Pose
from fluentboard.model.interval import UNKNOWN, Interval
from fluentboard_modules.geometry_fluents import pose_fluent
from fluentboard_modules.search.record import SearchRecord, SearchStep
from fluentboard_modules.simulation.robots import RobotModel
from fluentboard_modules.statements import Ending, Statement


@dataclass(eq=False)
class SearchFluents:
    """Claims, progress and the result of one robot in one search.

    Attributes:
        search: name of the activity.
        robot: name of the robot.
        model: of the robot, for the sensor's pose.
    """

    search: str
    robot: str
    model: RobotModel
    _steps: int = 0
    _claimed: list[str] = field(default_factory=list)
    _progress: str = ""

    def begin(self, time_s: float) -> list[Statement]:
        """The robot, and that it takes part."""
        return [
            Fluent(self.robot, "Robot", UNKNOWN),
            self._activity(Property("hasRobot", "Robot", self.robot)),
        ]

    def claim(self, step: SearchStep, time_s: float) -> list[Statement]:
        """The view that the robot is going to take: the others plan without what it will show."""
        self._steps += 1
        stem = f"{self.search}_{self.robot}_{self._steps}"
        view, pose = f"view_{stem}", f"pose_view_{stem}"
        since = Interval.at(time_s)
        self._claimed = [view, pose]
        properties = (
            Property("hasPose", "Pose", pose),
            Property("hasRobot", "Robot", self.robot),
            Property("hasRank", "xsd:integer", 0),
            Property("hasExpectedCells", "xsd:integer", step.expected_cells),
        )
        where = Pose.from_transform(self.model.T_map_sensor(step.view))
        return [
            pose_fluent(pose, where, since),
            Fluent(view, "View", since, UNKNOWN, properties),
            self._activity(Property("hasView", "View", view)),
        ]

    @property
    def claimed(self) -> str:
        """Name of the view that is claimed; empty if none is."""
        return self._claimed[0] if self._claimed else ""

    def done(self, step: SearchStep) -> list[Statement]:
        """What became of the view, and how far the search is now."""
        now = Interval.at(step.stamp_s)
        view, pose = self._claimed
        outcome = (
            Property("hasViewOutcome", "xsd:string", "taken" if step.is_reached else "unreachable"),
            Property("hasRevealedCells", "xsd:integer", step.revealed_cells),
        )
        progress = f"progress_{self.search}_{self.robot}_{self._steps}"
        statements: list[Statement] = [
            Fluent(view, "View", UNKNOWN, UNKNOWN, outcome),
            Ending(view, now),
            Ending(pose, now),
            Fluent(progress, "SearchProgress", now, UNKNOWN, self._numbers(step)),
            self._activity(Property("hasSearchProgress", "SearchProgress", progress)),
        ]
        if self._progress:
            statements.append(Ending(self._progress, now))
        self._progress = progress
        self._claimed = []
        return statements

    def leave(self, time_s: float) -> list[Statement]:
        """The robot takes no further part: its claim and its progress are over."""
        statements = self.release(time_s)
        if self._progress:
            statements.append(Ending(self._progress, Interval.at(time_s)))
        self._progress = ""
        return statements

    def release(self, time_s: float) -> list[Statement]:
        """The claimed view is left to others, if there is one."""
        if not self._claimed:
            return []
        released = Property("hasViewOutcome", "xsd:string", "released")
        statements: list[Statement] = [Fluent(self._claimed[0], "View", properties=(released,))]
        statements += [Ending(name, Interval.at(time_s)) for name in self._claimed]
        self._claimed = []
        return statements

    def result(self, outcome: str, time_s: float, found: Fluent | None = None) -> list[Statement]:
        """How the search ended, and its end."""
        properties = [Property("hasResult", "xsd:string", outcome)]
        if found is not None:
            properties.append(Property("hasFoundObject", found.class_name, found.name))
        return [
            *self.leave(time_s),
            self._activity(*properties),
            Ending(self.search, Interval.at(time_s)),
        ]

    def _activity(self, *properties: Property) -> Fluent:
        return Fluent(self.search, "SearchObjectActivity", UNKNOWN, UNKNOWN, properties)

    def _numbers(self, step: SearchStep) -> tuple[Property, ...]:
        moment = step.moment
        return (
            Property("hasElapsedTime", "xsd:double", moment.elapsed_s + moment.planning_s),
            Property("hasViewCount", "xsd:integer", self._steps),
            Property("hasUnknownCellCount", "xsd:integer", step.unknown_cells),
            Property("hasCumulativeProbability", "xsd:double", moment.probability),
            Property("hasRemainingProbability", "xsd:double", step.remaining_probability),
            Property("hasExpectedTime", "xsd:double", step.expected_time_s),
            Property("hasOptimalityGap", "xsd:double", step.gap),
        )


def story(record: SearchRecord) -> str:
    """A search in a sentence, for logs and the terminal."""
    return (
        f"{record.outcome or 'going on'} after {len(record.steps)} views and "
        f"{record.duration_s:.0f} s; {100 * record.probability:.0f} % of what was believed is seen"
    )


def result_fluent(name: str, result: str) -> Fluent:
    """A search with how it ended."""
    return Fluent(
        name, "SearchObjectActivity", properties=(Property("hasResult", "xsd:string", result),)
    )


def map_fluent(robot: str, path: Path, resolution_m: float) -> Fluent:
    """Where a robot keeps its map."""
    properties = (
        Property("hasMapFile", "xsd:string", str(path.resolve())),
        Property("hasResolution", "xsd:double", resolution_m),
    )
    return Fluent(f"occupancyMap_{robot}", "OccupancyMap", properties=properties)


def belief_fluents(
    search: str, believed: dict[str, float], robot: str, time_s: float
) -> list[Statement]:
    """What the memory of the board says about the volumes of a search, from a time on."""
    return [
        Fluent(
            f"belief_{volume}_{robot}",
            "VolumeBelief",
            Interval.at(time_s),
            UNKNOWN,
            (
                Property("isBeliefOfSearch", "SearchObjectActivity", search),
                Property("isBeliefAbout", "SearchVolume", volume),
                Property("hasProbability", "xsd:double", round(probability, 6)),
                Property("hasProbabilitySource", "xsd:string", "co-occurrence"),
            ),
        )
        for volume, probability in believed.items()
    ]
