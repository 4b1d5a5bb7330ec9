"""Transfer: importing and exporting whole boards, in constant memory."""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import AsyncIterator, Callable, Iterable
from typing import IO

import orjson

from fluentboard.api import parameters, schemas
from fluentboard.api.bodies import NDJSON, YAML, body_format
from fluentboard.api.exchange import Call, Reply, StreamedReply, json_reply
from fluentboard.api.import_formats import READERS, TURTLE
from fluentboard.api.negotiation import Offer, negotiated
from fluentboard.api.operations import Answer, Content, Operation, Parameter
from fluentboard.api.spool import Spool
from fluentboard.api.writing import commit_header, outcome
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent
from fluentboard.board.intervals import FluentFilter
from fluentboard.board.triples import fluent_lines
from fluentboard.board.vocabulary import Vocabulary
from fluentboard.config import LimitSettings
from fluentboard.errors import (
    FluentboardError,
    InvalidInput,
    InvalidName,
    InvalidTime,
    InvalidValue,
    InvalidYaml,
    NotAcceptable,
    NotARefinement,
    StorageFailed,
    TooLarge,
    UnknownClass,
    UnsupportedMediaType,
)
from fluentboard.model.fluent import Fluent
from fluentboard.model.json_format import fluent_to_json
from fluentboard.model.yaml_format import fluent_to_yaml
from fluentboard_ontology import PREFIXES

_FORMATS = {"yaml": YAML, "jsonl": NDJSON, "turtle": TURTLE}
_EXPORT_OFFERS = tuple(Offer(media_type, media_type) for media_type in _FORMATS.values())
_WRITE_BYTES = 2**20
_EXPORT_PAGE = 5_000


class TransferRoutes:
    """`/import` and `/export`.

    Args:
        board: where fluents go and come from.
        limits: on the length of an import and its commits.
    """

    def __init__(self, board: Blackboard, limits: LimitSettings) -> None:
        self._board = board
        self._limits = limits

    async def import_fluents(self, call: Call) -> Reply:
        """`POST /import`: everything is read and checked before anything is committed."""
        media_type = body_format(call, tuple(READERS))
        author = call.author
        with Spool(self._board) as spool:
            with tempfile.TemporaryFile(prefix="fluentboard-import-") as file:
                await self._receive(call, file)
                await asyncio.to_thread(self._check, file, media_type, spool)
            return await self._commit(spool, author)

    async def export_fluents(self, call: Call) -> StreamedReply:
        """`GET /export`: the board as of the commit at which the export began."""
        values = call.parameters()
        name = parameters.text(values, "format")
        if name is None:
            media_type = negotiated(call.header(b"accept"), _EXPORT_OFFERS).media_type
        elif name in _FORMATS:
            media_type = _FORMATS[name]
        else:
            raise InvalidInput(f"the format is {name!r}; give one of {', '.join(_FORMATS)}")
        as_of = parameters.as_of(values, self._board)
        commit = self._board.commit if as_of is None else as_of
        wanted = FluentFilter(
            at_s=parameters.time_s(values, "at", self._board.clock),
            certainty=parameters.certainty(values),
            as_of=commit,
        )
        chunks = self._chunks(wanted, _writer(media_type, self._board.vocabulary))
        headers = [commit_header(commit), (b"vary", b"Accept")]
        return await StreamedReply(chunks, media_type.encode(), headers=headers).begun()

    def operations(self) -> list[Operation]:
        """The routes, documented."""
        text, flag = {"type": "string"}, {"type": "boolean"}
        export = {media_type: Content(text) for media_type in _FORMATS.values()}
        receipt = {"commit": 12, "commits": 1, "fluents": 3, "changed": 3, "warnings": list[str]()}
        return [
            Operation(
                "POST",
                "/import",
                self.import_fluents,
                "importFluents",
                "Import many fluents",
                "The whole body is read and checked first; if anything in it is wrong, nothing of "
                "it is stored. Then it is committed in batches. Fluents that are on the board are "
                "refined, so an import that was interrupted can be repeated.",
                tag="transfer",
                role="write",
                parameters=(
                    Parameter("X-Author", "Whom the commits are attributed to.", place="header"),
                ),
                body=export,
                body_description="`!Fluent` documents, one JSON object per line, or Turtle as "
                "GET /export writes it.",
                answers={
                    200: Answer(
                        "Everything is on the board.",
                        {"application/json": Content(schemas.ImportReceipt, receipt)},
                        {"X-Commit": "Number of the last commit."},
                    )
                },
                errors=(
                    InvalidInput,
                    InvalidYaml,
                    InvalidName,
                    InvalidTime,
                    InvalidValue,
                    UnknownClass,
                    NotARefinement,
                    TooLarge,
                    UnsupportedMediaType,
                    StorageFailed,
                ),
            ),
            Operation(
                "GET",
                "/export",
                self.export_fluents,
                "exportFluents",
                "Export everything",
                "Streamed, as of the commit at which the export began.",
                tag="transfer",
                parameters=(
                    Parameter(
                        "format",
                        "yaml, jsonl or turtle; by default what Accept asks for, else yaml.",
                        {"type": "string", "enum": list(_FORMATS)},
                        "yaml",
                    ),
                    Parameter("at", "Only what may hold at this time, or `now`.", text, "now"),
                    Parameter("certainly", "With `at`: only what surely holds.", flag, True),
                    Parameter(
                        "possibly", "With `at`: also what may hold; the default.", flag, True
                    ),
                    Parameter(
                        "asof",
                        "As the board believed after this commit, or at a time.",
                        text,
                        "17",
                    ),
                ),
                answers={
                    200: Answer(
                        "The fluents, in the order of their first assertion.",
                        export,
                        {"X-Commit": "The commit that the export is exact at."},
                    )
                },
                errors=(InvalidInput, InvalidTime, NotAcceptable),
            ),
        ]

    async def _receive(self, call: Call, file: IO[bytes]) -> None:
        waiting: list[bytes] = []
        size = 0
        async for chunk in call.chunks(self._limits.import_max_bytes):
            waiting.append(chunk)
            size += len(chunk)
            if size >= _WRITE_BYTES:
                await asyncio.to_thread(_write, file, waiting)
                waiting, size = [], 0
        await asyncio.to_thread(_write, file, waiting)

    def _check(self, file: IO[bytes], media_type: str, spool: Spool) -> None:
        file.seek(0)
        for fluent in READERS[media_type](file, self._board):
            spool.add(fluent)

    async def _commit(self, spool: Spool, author: str) -> Reply:
        commits = changed = stored = 0
        number = self._board.commit
        batches = spool.batches(self._limits.import_batch)
        while True:
            batch = await asyncio.to_thread(next, batches, None)
            if batch is None:
                break
            commands = [AssertFluent(fluent, merge=True) for fluent in batch]
            try:
                commit = await outcome(
                    await asyncio.to_thread(self._board.submit, commands, author)
                )
            except FluentboardError as problem:
                # Checked before, so it was another writer, or the disk. Each batch is whole.
                raise type(problem)(
                    f"{problem.message}. Before that, {stored:,} of the {spool.count:,} fluents of "
                    "the import were stored; importing again goes on from there",
                    **{**problem.detail, "stored": stored},
                ) from None
            stored += len(batch)
            number = commit.number
            if commit.events:
                commits += 1
                changed += len(commit.events)
        receipt = {
            "commit": number,
            "commits": commits,
            "fluents": spool.count,
            "changed": changed,
            "warnings": await asyncio.to_thread(spool.warnings),
        }
        return json_reply(receipt, 200, [commit_header(number)])

    async def _chunks(
        self, wanted: FluentFilter, write: Callable[[Iterable[Fluent], bool], bytes]
    ) -> AsyncIterator[bytes]:
        after: int | None = 0
        is_first = True

        def page(start: int) -> tuple[bytes, int | None]:
            found = self._board.list(wanted, after=start, limit=_EXPORT_PAGE)
            return write(found.fluents, is_first), found.next

        while after is not None:
            chunk, after = await asyncio.to_thread(page, after)
            is_first = False
            if chunk:
                yield chunk


def _write(file: IO[bytes], chunks: list[bytes]) -> None:
    try:
        file.writelines(chunks)
    except OSError as problem:
        raise StorageFailed(
            f"the import needs a temporary file, which cannot be written: {problem}; make room in "
            "the folder for temporary files, or set TMPDIR to another one"
        ) from None


def _writer(media_type: str, vocabulary: Vocabulary) -> Callable[[Iterable[Fluent], bool], bytes]:
    """What writes the fluents of one page; it is told whether the page is the first."""

    def yaml(fluents: Iterable[Fluent], is_first: bool) -> bytes:
        documents = "".join(f"---\n{fluent_to_yaml(fluent)}" for fluent in fluents)
        return (documents.removeprefix("---\n") if is_first else documents).encode()

    def json(fluents: Iterable[Fluent], is_first: bool) -> bytes:
        return b"".join(
            orjson.dumps(fluent_to_json(fluent), option=orjson.OPT_APPEND_NEWLINE)
            for fluent in fluents
        )

    def turtle(fluents: Iterable[Fluent], is_first: bool) -> bytes:
        lines: list[str] = []
        if is_first:
            lines += [f"@prefix {prefix}: <{iri}> .\n" for prefix, iri in PREFIXES.items()]
        for fluent in fluents:
            lines += fluent_lines(fluent, vocabulary)
        return "".join(lines).encode()

    return {YAML: yaml, NDJSON: json, TURTLE: turtle}[media_type]
