"""Changes: the feed of commits from one on, as RDF Patch or as JSON Lines."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence

import orjson

from fluentboard.api import parameters
from fluentboard.api.bodies import NDJSON
from fluentboard.api.exchange import Call, StreamedReply
from fluentboard.api.negotiation import Offer, negotiated
from fluentboard.api.operations import Answer, Content, Operation, Parameter
from fluentboard.api.writing import commit_header, event_json
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.change_feed import ChangeFeed, StatementChange, patch_text
from fluentboard.board.events import Commit
from fluentboard.errors import InvalidInput, NotAcceptable

Writer = Callable[[StatementChange], bytes]

RDF_PATCH = "application/rdf-patch"

_OFFERS = (Offer(RDF_PATCH, RDF_PATCH), Offer(NDJSON, NDJSON))
_STEP = 200  # commits told at once
# Proxies close connections on which nothing is sent for a minute.
_HEARTBEAT_S = 15.0
_STILL_HERE = {RDF_PATCH: b"# still here\n", NDJSON: b"\n"}


class ChangeRoutes:
    """`/changes`.

    Args:
        board: whose commits are told.
    """

    def __init__(self, board: Blackboard) -> None:
        self._board = board
        self._waiting: set[asyncio.Event] = set()
        self._is_closing = False

    async def read(self, call: Call) -> StreamedReply:
        """`GET /changes`."""
        offer = negotiated(call.header(b"accept"), _OFFERS)
        values = call.parameters()
        since, last = parameters.number(values, "since"), self._board.commit
        if since > last:
            raise InvalidInput(
                f"commit {since} has not been made yet; the last is {last}", commit=last
            )
        until = parameters.optional_number(values, "until")
        follows = parameters.flag(values, "follow") or False
        if follows and until is not None:
            raise InvalidInput("until and follow exclude each other; give one of them")
        end = last if until is None else min(until, last)
        feed = await asyncio.to_thread(ChangeFeed, self._board, since)
        write = _WRITERS[offer.format]
        chunks = self._chunks(feed, end, write)
        if follows:
            chunks = self._followed(feed, write, _STILL_HERE[offer.format])
        headers = [commit_header(end), (b"vary", b"Accept")]
        return StreamedReply(chunks, offer.media_type.encode(), headers=headers)

    def wake(self) -> None:
        """Ends all feeds that wait for commits."""
        self._is_closing = True
        for event in self._waiting:
            event.set()

    def operations(self) -> list[Operation]:
        """The routes, documented."""
        text = {"type": "string"}
        number = {"type": "integer", "minimum": 0}
        return [
            Operation(
                "GET",
                "/changes",
                self.read,
                "readChanges",
                "Read what commits changed",
                "Every commit after `since`, in order. As RDF Patch it is a transaction that "
                "turns what the board said before into what it says since; as JSON Lines it is "
                "the events and statements themselves.",
                tag="transfer",
                parameters=(
                    Parameter(
                        "since", "The last commit that the caller knows; 0 for all.", number, 17
                    ),
                    Parameter("until", "The last commit to tell of.", number, 20),
                    Parameter(
                        "follow", "Go on with commits as they are made.", {"type": "boolean"}, True
                    ),
                ),
                answers={
                    200: Answer(
                        "The changes.",
                        {
                            RDF_PATCH: Content(text, _EXAMPLE),
                            NDJSON: Content(text),
                        },
                        {"X-Commit": "The last commit there was when the feed began."},
                    )
                },
                errors=(InvalidInput, NotAcceptable),
            )
        ]

    async def _chunks(self, feed: ChangeFeed, end: int, write: Writer) -> AsyncIterator[bytes]:
        """What the commits up to `end` changed, a few at a time."""

        def step(up_to: int) -> bytes:
            return b"".join(map(write, feed.up_to(up_to)))

        while feed.commit < end:
            yield await asyncio.to_thread(step, min(feed.commit + _STEP, end))

    async def _followed(
        self, feed: ChangeFeed, write: Writer, still_here: bytes
    ) -> AsyncIterator[bytes]:
        """What commits change, as they are made, until the client goes or the board stops."""
        event, loop = asyncio.Event(), asyncio.get_running_loop()

        def told(commits: Sequence[Commit]) -> None:
            loop.call_soon_threadsafe(event.set)

        stop_listening = self._board.listen(told)
        self._waiting.add(event)
        try:
            while not self._is_closing:
                event.clear()
                async for chunk in self._chunks(feed, self._board.commit, write):
                    yield chunk
                try:
                    await asyncio.wait_for(event.wait(), _HEARTBEAT_S)
                except TimeoutError:
                    yield still_here
        finally:
            self._waiting.discard(event)
            stop_listening()


def _json_line(change: StatementChange) -> bytes:
    commit = change.commit
    document = {
        "commit": commit.number,
        "wall_s": commit.wall_s,
        "author": commit.author,
        "reason": commit.reason,
        "events": [event_json(event) for event in commit.events],
        "statements": [
            {
                "graph": said.graph or None,
                "ontology": said.ontology or None,
                "added": said.added,
                "removed": said.removed,
            }
            for said in commit.statements
        ],
    }
    return orjson.dumps(document, option=orjson.OPT_APPEND_NEWLINE)


def _patch(change: StatementChange) -> bytes:
    return patch_text(change).encode()


_WRITERS: dict[str, Writer] = {RDF_PATCH: _patch, NDJSON: _json_line}
_EXAMPLE = (
    "# commit 18 by mapping at 1760000000.25\n"
    "TX .\n"
    "A <https://w3id.org/fluentboard/fluent/mug1> "
    "<http://www.w3.org/1999/02/22-rdf-syntax-ns#type> <https://w3id.org/fluentboard/race#Mug> .\n"
    "TC .\n"
)
