"""The time that queries at now are at, and what the clock alone will change next."""

from __future__ import annotations

import math
from collections.abc import Iterator

from fluentboard.board.coming import Coming, next_change_s
from fluentboard.board.events import Commit
from fluentboard.board.subscriptions.held import TimePassed, holds, time_passed
from fluentboard.board.subscriptions.reevaluate import Board
from fluentboard.board.vocabulary import Vocabulary
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Certainty
from fluentboard.model.relations import bounds_of


class TimeKeeper:
    """Follows the board's clock for the certainties that some query asks for.

    Used by the evaluator's thread alone. Without queries at now it costs nothing.

    Args:
        board: has the clock and the fluents.

    Attributes:
        at_s: the time that the queries are at, in seconds; NaN while there are none.
    """

    def __init__(self, board: Board) -> None:
        self._board = board
        self._coming: dict[Certainty, Coming[str]] = {}
        self.at_s = math.nan

    def __iter__(self) -> Iterator[Certainty]:
        return iter(tuple(self._coming))

    def __len__(self) -> int:
        return len(self._coming)

    def follow(self, certainty: Certainty, routed: int) -> None:
        """Begins to follow what holds with a certainty, as believed after the commit routed."""
        if certainty in self._coming:
            return
        if not self._coming:
            self.at_s = self._board.clock.now_s()
        self._read(certainty, routed)

    def leave(self, certainty: Certainty) -> None:
        """No query asks for that certainty any more."""
        self._coming.pop(certainty, None)
        if not self._coming:
            self.at_s = math.nan

    def note(self, commit: Commit) -> None:
        """Takes note of when the clock will change what a commit says."""
        for certainty, coming in self._coming.items():
            for event in commit.events:
                bounds = bounds_of(event.after)
                coming.put(event.after.name, next_change_s(bounds, certainty, self.at_s))

    def next_s(self) -> float:
        """When the clock alone changes next what holds, in seconds; infinite if never."""
        return min((coming.next_s() for coming in self._coming.values()), default=math.inf)

    def went_back(self, now_s: float, routed: int) -> bool:
        """Whether the clock was set back; then all that comes is read anew."""
        if now_s >= self.at_s:
            return False
        self.at_s = now_s
        for certainty in self:
            self._read(certainty, routed)
        return True

    def pass_to(
        self, now_s: float, routed: int, vocabulary: Vocabulary
    ) -> list[tuple[Certainty, TimePassed]]:
        """Goes on to a time, which is not before the present one.

        Args:
            now_s: the time, in seconds.
            routed: the last commit that was routed.
            vocabulary: as it is after that commit.

        Returns:
            What that changes, by certainty; empty if nothing changes.
        """
        since_s, self.at_s = self.at_s, now_s
        found: list[tuple[Certainty, TimePassed]] = []
        for certainty, coming in self._coming.items():
            changed: list[tuple[Fluent, bool]] = []
            for name in coming.pop(now_s):
                fluent = self._board.fluent(name, routed)
                coming.put(name, next_change_s(bounds_of(fluent), certainty, now_s))
                is_held = holds(fluent, certainty, now_s)
                # One that began and ceased meanwhile was never seen.
                if is_held != holds(fluent, certainty, since_s):
                    changed.append((fluent, is_held))
            if changed:
                passed = time_passed(changed, routed, vocabulary, since_s, now_s)
                found.append((certainty, passed))
        return found

    def _read(self, certainty: Certainty, routed: int) -> None:
        self._coming[certainty] = Coming(self._board.coming(certainty, self.at_s, routed))
