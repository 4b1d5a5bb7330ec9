"""Transfer: importing and exporting whole boards, in constant memory."""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import AsyncIterator
from dataclasses import replace
from typing import IO

import pyoxigraph as ox

from fluentboard.api import parameters
from fluentboard.api.bodies import NDJSON, YAML, body_format
from fluentboard.api.exchange import Call, Reply, StreamedReply, json_reply
from fluentboard.api.export_formats import (
    MEDIA_TYPES,
    OF_DATASETS,
    Lines,
    Writer,
    writer_for,
)
from fluentboard.api.import_formats import READERS, graph_named
from fluentboard.api.negotiation import Offer, negotiated
from fluentboard.api.operations import Answer, Content, Operation, Parameter
from fluentboard.api.rdf_bodies import InvalidRdf
from fluentboard.api.schemas.fluents import ImportReceipt
from fluentboard.api.spool import Spool
from fluentboard.api.writing import commit_header, outcome
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.change_feed import statements_said
from fluentboard.board.commands import AssertFluent
from fluentboard.board.graphs import CHANGES_MAX
from fluentboard.board.intervals import FluentFilter
from fluentboard.board.owl_time import owl_time_lines, relation_lines
from fluentboard.board.statement_rules import ProtectedStatement
from fluentboard.board.triples import fluent_lines
from fluentboard.board.update_operations import Create, Graph, InsertStatements
from fluentboard.board.writer import Whole
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
    ShapeViolation,
    StorageFailed,
    TooLarge,
    UnknownClass,
    UnsupportedMediaType,
)
from fluentboard.model.fluent import Fluent

_EXPORT_OFFERS = tuple(Offer(media_type, media_type) for media_type in MEDIA_TYPES.values())
_WRITE_BYTES = 2**20
_EXPORT_PAGE = 5_000

RELATED_MAX = 500
"""Relations are written between at most so many fluents: they grow with the square."""


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
        values = call.parameters()
        target = graph_named(parameters.text(values, "graph"), "default" in values)
        statements: list[ox.Quad] = []
        with Spool(self._board) as spool:
            with tempfile.TemporaryFile(prefix="fluentboard-import-") as file:
                await self._receive(call, file)
                await asyncio.to_thread(self._check, file, media_type, target, spool, statements)
            size = self._limits.import_batch
            whole = await asyncio.to_thread(spool.check_shapes, size)
            said = await self._say(statements, author)
            return await self._commit(spool, author, said, whole)

    async def export_fluents(self, call: Call) -> StreamedReply:
        """`GET /export`: the board as of the commit at which the export began."""
        values = call.parameters()
        name = parameters.text(values, "format")
        if name is None:
            media_type = negotiated(call.header(b"accept"), _EXPORT_OFFERS).media_type
        elif name in MEDIA_TYPES:
            media_type = MEDIA_TYPES[name]
        else:
            raise InvalidInput(f"the format is {name!r}; give one of {', '.join(MEDIA_TYPES)}")
        as_of = parameters.as_of(values, self._board)
        commit = self._board.commit if as_of is None else as_of
        wanted = FluentFilter(
            class_name=parameters.text(values, "class"),
            at_s=parameters.time_s(values, "at", self._board.clock),
            during=parameters.window_s(values, "during"),
            certainty=parameters.certainty(values),
            as_of=commit,
        )
        is_narrowed = any(parameters.text(values, key) for key in ("class", "at", "during"))
        chunks = self._chunks(
            wanted,
            writer_for(media_type, self._lines(values, media_type)),
            with_statements=media_type in OF_DATASETS and not is_narrowed,
            with_relations=self._wants_relations(values),
        )
        headers = [commit_header(commit), (b"vary", b"Accept")]
        return await StreamedReply(chunks, media_type.encode(), headers=headers).begun()

    def _lines(self, values: parameters.Values, media_type: str) -> Lines:
        """How fluents are said in RDF."""
        vocabulary = self._board.vocabulary
        name = parameters.text(values, "vocabulary")
        if name is None or name == "upper":
            return lambda fluent: fluent_lines(fluent, vocabulary)
        if name != "owl-time":
            raise InvalidInput(f"the vocabulary is {name!r}; give upper or owl-time")
        if media_type in (YAML, NDJSON):
            raise InvalidInput(
                f"{media_type} is not RDF and has no vocabulary; ask for turtle, ntriples, trig, "
                "nquads or jsonld"
            )
        return lambda fluent: owl_time_lines(fluent, vocabulary)

    def _wants_relations(self, values: parameters.Values) -> bool:
        wanted = parameters.flag(values, "relations") or False
        if wanted and parameters.text(values, "vocabulary") != "owl-time":
            raise InvalidInput("relations are written with vocabulary=owl-time only")
        return wanted

    def operations(self) -> list[Operation]:
        """The routes, documented."""
        text, flag = {"type": "string"}, {"type": "boolean"}
        export = {media_type: Content() for media_type in MEDIA_TYPES.values()}
        imported = {media_type: Content(text) for media_type in READERS}
        receipt = {
            **{"commit": 12, "commits": 1, "fluents": 3, "changed": 3, "statements": 0},
            "warnings": list[str](),
        }
        return [
            Operation(
                "POST",
                "/import",
                self.import_fluents,
                "importFluents",
                "Import many fluents",
                "The whole body is read and checked first, against the board, its ontologies and "
                "its shapes; if anything in it is wrong, nothing of it is stored. Then it is "
                "committed in batches. Fluents that are on the board are "
                "refined, so an import that was interrupted can be repeated.",
                tag="transfer",
                role="write",
                parameters=(
                    Parameter(
                        "graph",
                        "IRI of the graph for the statements of RDF that are not about fluents "
                        "and in no graph of their own.",
                        {"type": "string", "format": "iri"},
                        "urn:kitchen",
                    ),
                    Parameter(
                        "default", "Such statements go to the default graph; without a value.", text
                    ),
                    Parameter("X-Author", "Whom the commits are attributed to.", place="header"),
                ),
                body=imported,
                body_description="`!Fluent` documents, one JSON object per line, or RDF: fluents "
                "as GET /export writes them, and other statements.",
                answers={
                    200: Answer(
                        "Everything is on the board.",
                        {"application/json": Content(ImportReceipt, receipt)},
                        {"X-Commit": "Number of the last commit."},
                    )
                },
                errors=(
                    InvalidInput,
                    InvalidRdf,
                    InvalidYaml,
                    InvalidName,
                    InvalidTime,
                    InvalidValue,
                    UnknownClass,
                    NotARefinement,
                    ProtectedStatement,
                    ShapeViolation,
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
                        "By default what Accept asks for, else yaml.",
                        {"type": "string", "enum": list(MEDIA_TYPES)},
                        "yaml",
                    ),
                    Parameter("class", "Only fluents of this class.", text, "Mug"),
                    Parameter("during", "Only what may hold in this window.", text, "100.0,160.5"),
                    Parameter(
                        "vocabulary",
                        "Of RDF: upper, the board's own, or owl-time.",
                        {"type": "string", "enum": ["upper", "owl-time"]},
                        "owl-time",
                    ),
                    Parameter(
                        "relations",
                        "With owl-time: also Allen's relations that certainly hold.",
                        flag,
                        True,
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
                errors=(InvalidInput, InvalidTime, UnknownClass, NotAcceptable, TooLarge),
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

    def _check(
        self,
        file: IO[bytes],
        media_type: str,
        target: Graph | None,
        spool: Spool,
        statements: list[ox.Quad],
    ) -> None:
        file.seek(0)
        for found in READERS[media_type](file, self._board, target):
            if isinstance(found, Fluent):
                spool.add(found)
                continue
            statements.append(found)
            if len(statements) > CHANGES_MAX:
                raise TooLarge(
                    f"the import has more than {CHANGES_MAX:,} statements that are not about "
                    "fluents; send it in parts",
                    limit=CHANGES_MAX,
                )

    async def _say(self, statements: list[ox.Quad], author: str) -> int:
        """Commits what is said outside fluents; how many statements of it were new."""
        if not statements:
            return 0
        graphs = {quad.graph_name for quad in statements}
        made = [Create(g, is_silent=True) for g in graphs if isinstance(g, ox.NamedNode)]
        operations = [*made, InsertStatements(tuple(statements))]
        future = await asyncio.to_thread(self._board.graphs.change, operations, author)
        commit = await outcome(future)
        return sum(change.added.count("\n") for change in commit.statements)

    async def _commit(self, spool: Spool, author: str, said: int, whole: Whole | None) -> Reply:
        commits, changed, stored = int(said > 0), 0, 0
        number = self._board.commit
        batches = spool.batches(self._limits.import_batch)
        while True:
            batch = await asyncio.to_thread(next, batches, None)
            if batch is None:
                break
            commands = [AssertFluent(fluent, merge=True) for fluent in batch]
            try:
                commit = await outcome(
                    await asyncio.to_thread(self._board.submit, commands, author, whole=whole)
                )
            except FluentboardError as problem:
                if stored == said == 0:
                    raise
                # Checked before, so it was another writer, or the disk. Each batch is whole.
                raise type(problem)(
                    f"{problem.message}. Before that, {stored:,} of the {spool.count:,} fluents of "
                    "the import were stored; importing again goes on from there",
                    **{**problem.detail, "stored": stored},
                ) from None
            stored += len(batch)
            if whole is not None:
                is_own = whole.met_at == commit.number - bool(commit.events)
                whole = replace(whole, met_at=commit.number if is_own else None)
            number = commit.number
            if commit.events:
                commits += 1
                changed += len(commit.events)
        receipt = {
            "commit": number,
            "commits": commits,
            "fluents": spool.count,
            "changed": changed,
            "statements": said,
            "warnings": await asyncio.to_thread(spool.warnings),
        }
        return json_reply(receipt, 200, [commit_header(number)])

    async def _chunks(
        self, wanted: FluentFilter, writer: Writer, *, with_statements: bool, with_relations: bool
    ) -> AsyncIterator[bytes]:
        def page(start: int) -> tuple[bytes, int | None]:
            limit = RELATED_MAX if with_relations else _EXPORT_PAGE
            found = self._board.list(wanted, after=start, limit=limit)
            text = writer.fluents(found.fluents)
            if with_relations:
                if found.next is not None:
                    raise TooLarge(
                        f"relations are written between at most {RELATED_MAX} fluents; narrow the "
                        "export by class, at or during",
                        limit=RELATED_MAX,
                    )
                lines = "".join(relation_lines(found.fluents))
                text += writer.statements(ox.parse(lines, format=ox.RdfFormat.N_TRIPLES))
            return text, found.next

        def statements() -> bytes:
            return writer.statements(statements_said(self._board, wanted.as_of or 0))

        beginning = writer.begin()
        after: int | None = 0
        while after is not None:
            chunk, after = await asyncio.to_thread(page, after)
            if beginning or chunk:
                yield beginning + chunk
            beginning = b""
        if with_statements and (chunk := await asyncio.to_thread(statements)):
            yield chunk
        if ending := writer.end():
            yield ending


def _write(file: IO[bytes], chunks: list[bytes]) -> None:
    try:
        file.writelines(chunks)
    except OSError as problem:
        raise StorageFailed(
            f"the import needs a temporary file, which cannot be written: {problem}; make room in "
            "the folder for temporary files, or set TMPDIR to another one"
        ) from None
