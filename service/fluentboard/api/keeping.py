"""Keeping: the audit trail and the backup, for those who answer for a board."""

from __future__ import annotations

import asyncio
import tempfile
from pathlib import Path
from typing import IO

import orjson

from fluentboard.api import parameters
from fluentboard.api.exchange import Call, Reply, StreamedReply
from fluentboard.api.negotiation import Offer, negotiated
from fluentboard.api.operations import Answer, Content, Operation, Parameter
from fluentboard.api.results import file_chunks
from fluentboard.api.schemas.upkeep import Audit
from fluentboard.api.writing import commit_header
from fluentboard.board.audit import AuditFilter
from fluentboard.board.backup import write_backup
from fluentboard.board.blackboard import Blackboard
from fluentboard.errors import InvalidInput, NotAcceptable, StorageFailed, UnknownResource

SQLITE = "application/vnd.sqlite3"
_JSON, _NDJSON = "application/json", "application/x-ndjson"
_OFFERS = (Offer(_JSON, _JSON), Offer(_NDJSON, _NDJSON))
_PAGE_DEFAULT, _PAGE_MAX = 100, 10_000


class KeepingRoutes:
    """`/audit` and `/backup`.

    Args:
        board: whose journal is told and copied.
    """

    def __init__(self, board: Blackboard) -> None:
        self._board = board

    async def audit(self, call: Call) -> Reply:
        """`GET /audit`."""
        values = call.parameters()
        limit = parameters.number(values, "limit", least=1, most=_PAGE_MAX, default=_PAGE_DEFAULT)
        wanted = AuditFilter(
            parameters.as_of(values, self._board, "after") or 0,
            parameters.as_of(values, self._board, "upto"),
            parameters.text(values, "author"),
            parameters.text(values, "name"),
            bool(parameters.flag(values, "forced")),
        )
        media_type = negotiated(call.header(b"accept"), _OFFERS).media_type
        commit = self._board.commit
        # One more than wanted, to see whether there is a next page.
        entries = await asyncio.to_thread(self._board.audit, wanted, limit + 1)
        more = entries[limit:]
        found = [entry.to_json() for entry in entries[:limit]]
        if media_type == _NDJSON:
            lines = (orjson.dumps(entry, option=orjson.OPT_APPEND_NEWLINE) for entry in found)
            body = b"".join(lines)
        else:
            following = entries[limit - 1].commit if more else None
            body = orjson.dumps({"commits": found, "next": following})
        headers = [commit_header(commit), (b"vary", b"Accept")]
        return Reply(body, media_type.encode(), 200, headers)

    async def backup(self, call: Call) -> StreamedReply:
        """`GET /backup`."""
        values = call.parameters()
        journal = self._board.journal_file
        if journal is None:
            raise UnknownResource(
                "this board keeps nothing on disk, so there is no journal to back up; GET /export "
                "gives its fluents"
            )
        up_to = parameters.as_of(values, self._board, "upto")

        def copied() -> tuple[IO[bytes], int, int]:
            with tempfile.TemporaryDirectory(prefix="fluentboard-backup-") as folder:
                copy = Path(folder) / "journal.sqlite"
                last = write_backup(journal, copy, up_to)
                # The file stays readable until it is closed, whatever becomes of its name.
                return copy.open("rb"), copy.stat().st_size, last

        file, size_bytes, last = await asyncio.to_thread(copied)
        headers = [
            commit_header(last),
            (b"content-disposition", b'attachment; filename="fluentboard-%d.sqlite"' % last),
        ]
        return StreamedReply(file_chunks(file), SQLITE.encode(), size_bytes, headers)

    def operations(self) -> list[Operation]:
        """The routes, documented."""
        text, whole = {"type": "string"}, {"type": "integer", "minimum": 1}
        example = {
            "commits": [
                {
                    "commit": 12,
                    "wall_s": 1777636800.25,
                    "author": "anchoring",
                    "reason": "",
                    "idempotency_key": None,
                    "fluents": [{"event": "ended", "name": "on4", "class": "On"}],
                    "statements": list[str](),
                }
            ],
            "next": None,
        }
        return [
            Operation(
                "GET",
                "/audit",
                self.audit,
                "getAudit",
                "Who changed what and when",
                "Commit by commit, as the journal has it: nobody can change it afterwards.",
                tag="operation",
                role="admin",
                parameters=(
                    Parameter("after", "Only commits after this one, or this time.", text, "11"),
                    Parameter("upto", "Only commits up to this one, or this time.", text, "12"),
                    Parameter("author", "Only commits of this author.", text, "anchoring"),
                    Parameter("name", "Only commits that changed this fluent.", text, "on4"),
                    Parameter(
                        "forced",
                        "Only corrections, which an admin forced with a reason.",
                        {"type": "boolean"},
                        True,
                    ),
                    Parameter(
                        "limit", "At most so many commits.", {**whole, "maximum": _PAGE_MAX}, 100
                    ),
                ),
                answers={
                    200: Answer(
                        "The commits in order; `next` is what `after` has to be for more.",
                        {_JSON: Content(Audit, example), _NDJSON: Content(text)},
                        {"X-Commit": "The last commit of the board."},
                    )
                },
                errors=(InvalidInput, NotAcceptable),
            ),
            Operation(
                "GET",
                "/backup",
                self.backup,
                "getBackup",
                "A copy of the journal, with the durable subscriptions",
                "Made while the board goes on. `fluentboard restore` makes a board from it. It "
                "holds the keys that posts are signed with.",
                tag="operation",
                role="admin",
                parameters=(
                    Parameter(
                        "upto",
                        "Only up to this commit, or to a time: 2026-05-01T12:00:00Z, or seconds "
                        "with a decimal point.",
                        text,
                        "17",
                    ),
                ),
                answers={
                    200: Answer(
                        "A SQLite file.",
                        {SQLITE: Content({"type": "string", "format": "binary"})},
                        {
                            "X-Commit": "The last commit in it.",
                            "Content-Disposition": "A name for the file.",
                        },
                    )
                },
                errors=(InvalidInput, UnknownResource, StorageFailed),
            ),
        ]
