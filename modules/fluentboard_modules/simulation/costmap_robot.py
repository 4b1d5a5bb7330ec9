"""What robots that drive by a costmap have in common: where they are, and what the time is."""

from __future__ import annotations

import math

from fluentboard.errors import UnreachableView
from fluentboard_modules.simulation.navigation import Costmap
from fluentboard_modules.simulation.robots import RobotModel, View


class CostmapRobot:
    """The moving half of a `Robot`: motions take the time that its model predicts.

    Args:
        model: which robot.
        costmap: the map that it drives by.
        start: its first view.
        start_s: time at the beginning, on the board's time axis.

    Raises:
        UnreachableView: it cannot stand at its first view.
    """

    def __init__(self, model: RobotModel, costmap: Costmap, start: View, start_s: float) -> None:
        self._model = model
        self._costmap = costmap
        self._view = start
        self._time_s = start_s
        self._index = 0
        model.check(start)
        costmap.path_costs(start.x, start.y)

    @property
    def model(self) -> RobotModel:
        """Limits, camera and motion times; heights count from the map's zero."""
        return self._model

    @property
    def costmap(self) -> Costmap:
        """The map that it drives by, the true one."""
        return self._costmap

    @property
    def view(self) -> View:
        """The present configuration."""
        return self._view

    @property
    def time_s(self) -> float:
        """The robot's own clock: it advances with motions and looks only."""
        return self._time_s

    def idle_until(self, time_s: float) -> None:
        """Does nothing up to a time; nothing happens if it has passed."""
        self._time_s = max(self._time_s, time_s)

    def predicted_time_s(self, start: View, goal: View) -> float:
        """Time to go and look; infinite where no way leads or a joint cannot go."""
        try:
            self._model.check(goal)
            cost = self._costmap.path((start.x, start.y), (goal.x, goal.y)).cost
        except UnreachableView:
            return math.inf
        return self._model.transition_time_s(start, goal, cost)

    def move_to(self, view: View) -> float:
        """Takes a view; the clock advances by the seconds returned.

        Raises:
            UnreachableView: a joint limit, an obstacle or a missing way forbids it; the robot has
                not moved.
        """
        self._model.check(view)
        cost = self._costmap.path((self._view.x, self._view.y), (view.x, view.y)).cost
        seconds = self._model.motion_time_s(self._view, view, cost)
        self._view = view
        self._time_s += seconds
        return seconds
