"""Objects: where a thing was, over time."""

from __future__ import annotations

import asyncio
import csv
import io
from collections.abc import Sequence
from typing import Any

from fluentboard.api import parameters
from fluentboard.api.exchange import Call, HeaderList, Reply, json_reply
from fluentboard.api.negotiation import Offer, content_type, negotiated
from fluentboard.api.operations import Answer, Content, Operation, Parameter
from fluentboard.api.schemas.trajectories import TrajectoryJson
from fluentboard.api.writing import commit_header
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.trajectory import trajectory_to_json
from fluentboard.errors import (
    InvalidInput,
    InvalidTime,
    NotAcceptable,
    UnknownFluent,
)

_JSON, _CSV = "application/json", "text/csv"
_OFFERS = (Offer(_JSON, _JSON), Offer(_CSV, _CSV))
_TIMES_MAX = 10_000
_COLUMNS = (
    *("fluent", "start_earliest", "start_latest", "finish_earliest", "finish_latest"),
    *("x", "y", "z", "roll", "pitch", "yaw"),
)


class ObjectRoutes:
    """`/objects/{name}/trajectory`.

    Args:
        board: what is read.
    """

    def __init__(self, board: Blackboard) -> None:
        self._board = board

    async def trajectory(self, call: Call) -> Reply:
        """`GET /objects/{name}/trajectory`."""
        offer = negotiated(call.header(b"accept"), _OFFERS)
        values = call.parameters()
        during = parameters.window_s(values, "during")
        times_s = self._times_s(values)
        as_of = parameters.as_of(values, self._board)
        commit = self._board.commit if as_of is None else as_of
        begin_s, end_s = (None, None) if during is None else during
        trajectory = await asyncio.to_thread(
            self._board.trajectory, call.arguments["name"], begin_s, end_s, as_of=commit
        )
        headers: HeaderList = [commit_header(commit), (b"vary", b"Accept")]
        document = trajectory_to_json(trajectory, times_s)
        if offer.format == _CSV:
            return Reply(_table(document["poses"]), content_type(_CSV), 200, headers)
        return json_reply({**document, "commit": commit}, 200, headers)

    def operations(self) -> list[Operation]:
        """The routes, documented."""
        return [
            Operation(
                "GET",
                "/objects/{name}/trajectory",
                self.trajectory,
                "readTrajectory",
                "Read where an object was",
                "All poses that the object had, each with what is known of when; the way that it "
                "travelled at least; the times between for which no pose is known; and its "
                "position at given times.",
                tag="fluents",
                parameters=(
                    Parameter(
                        "during",
                        "Only poses that it may have had at some moment of this window.",
                        example="100.0,160.5",
                    ),
                    Parameter(
                        "at",
                        "Tell its position at these times, too: seconds or `now`, separated by "
                        "commas.",
                        example="120.0,now",
                    ),
                    Parameter("asof", "As believed after this commit, or at a time.", example="17"),
                ),
                answers={
                    200: Answer(
                        "The trajectory.",
                        {
                            _JSON: Content(TrajectoryJson, _EXAMPLE),
                            _CSV: Content({"type": "string"}),
                        },
                        {"X-Commit": "The commit that it is exact at."},
                    )
                },
                errors=(UnknownFluent, InvalidInput, InvalidTime, NotAcceptable),
            )
        ]

    def _times_s(self, values: parameters.Values) -> list[float]:
        text = parameters.text(values, "at")
        if text is None:
            return []
        parts = [part.strip() for part in text.split(",")]
        if len(parts) > _TIMES_MAX:
            raise InvalidInput(
                f"at names {len(parts):,} times, more than {_TIMES_MAX:,}; ask in parts",
                limit=_TIMES_MAX,
            )
        now_s = self._board.clock.now_s()
        return [now_s if part == "now" else parameters.seconds(part, "at") for part in parts]


def _table(poses: Sequence[dict[str, Any]]) -> bytes:
    """The poses as CSV; what is unknown is empty."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(_COLUMNS)
    for step in poses:
        pose = step["pose"]
        writer.writerow(
            [
                *(step["fluent"], *step["start"], *step["finish"]),
                *(pose[key] for key in ("x", "y", "z", "roll", "pitch", "yaw")),
            ]
        )
    return text.getvalue().encode()


_POSE = {
    **{"x": 1.25, "y": 0.5, "z": 0.75, "roll": 0.0, "pitch": 0.0, "yaw": 0.0},
    "quaternion": [0.0, 0.0, 0.0, 1.0],
}
_FIRST = {"fluent": "pose3", "start": [None, 10.5], "finish": [119.6, 121.0], "pose": _POSE}
_EXAMPLE = {
    "name": "mug1",
    "poses": [_FIRST],
    "distance_m": 0.0,
    "gaps": list[Any](),
    "missing": list[str](),
    "positions": [{"at": 120.0, "poses": [{"certainty": "possible", **_FIRST}]}],
    "commit": 17,
}
