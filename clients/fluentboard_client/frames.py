"""FrameClient: a sensor's frames to a board and from it, as messages of bytes.

What is in a message is the business of `fluentboard.model.frame_message`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import httpx

from fluentboard_client import exchange

FRAME_MEDIA_TYPE = "application/vnd.fluentboard.frame"


@dataclass(frozen=True, slots=True)
class ReceivedFrame:
    """A frame as it came from the board.

    Attributes:
        index: its number among all frames of the sensor.
        content: its message.
    """

    index: int
    content: bytes


class FrameClient:
    """The live frames of one sensor.

    Args:
        board: address of the board.
        sensor: name of the sensor.
        token: bearer token, where the board asks for one.
        timeout_s: how long to wait for a reply, besides the time that was asked for.
        transport: replaces the network, in tests.
    """

    def __init__(
        self,
        board: str,
        sensor: str,
        *,
        token: str | None = None,
        timeout_s: float = 30.0,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        self.board = exchange.board_address(board)
        self.sensor = sensor
        self._path = "/frames/" + exchange.segment(sensor)
        self._timeout_s = timeout_s
        self._http = httpx.Client(
            base_url=self.board,
            headers=exchange.headers("", token),
            timeout=timeout_s,
            transport=transport,
            trust_env=not exchange.is_loopback(self.board),
        )

    @property
    def address(self) -> str:
        """Where the frames are."""
        return self.board + self._path

    def send(self, content: bytes) -> int:
        """Sends a frame; returns the number that the board gave it.

        It is not repeated when the connection fails: the next frame says more than a late one.

        Raises:
            BoardUnreachable: the board is away.
            InvalidFrame, TooLarge: it refuses the frame.
        """
        headers = {"Content-Type": FRAME_MEDIA_TYPE}
        return int(self._exchange("POST", content=content, headers=headers).json()["index"])

    def newest(self, after: int | None = None, wait_s: float = 0.0) -> ReceivedFrame | None:
        """The newest frame, None if no new one came in time.

        Args:
            after: number of the last frame that the caller has.
            wait_s: how long to wait for one.

        Raises:
            BoardUnreachable: the board is away.
        """
        params = {"wait": str(wait_s)} | ({} if after is None else {"after": str(after)})
        reply = self._exchange("GET", params=params, timeout=self._timeout_s + wait_s)
        if reply.status_code == 204:
            return None
        return ReceivedFrame(int(reply.headers["X-Frame-Index"]), reply.content)

    def sensors(self) -> list[str]:
        """Names of the sensors of which the board keeps frames."""
        reply = self._exchange("GET", path="/frames")
        return [str(entry["sensor"]) for entry in reply.json()["sensors"]]

    def close(self) -> None:
        """Closes the connections."""
        self._http.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _exchange(self, method: str, path: str | None = None, **options: Any) -> httpx.Response:
        try:
            reply = self._http.request(method, path or self._path, **options)
        except httpx.TransportError as failure:
            raise exchange.unreachable(self.board, failure, 1) from failure
        exchange.check(reply, self.board)
        return reply
