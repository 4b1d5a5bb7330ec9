"""Fluents: the REST routes that assert, list, read, refine and end them."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from urllib.parse import urlencode

import orjson

from fluentboard.api import fluents_documented as documented
from fluentboard.api import parameters
from fluentboard.api.bodies import (
    JSON,
    NDJSON,
    YAML,
    body_format,
    commands_from_json,
    ending_from_json,
    fluents_of,
    refinement_from_json,
)
from fluentboard.api.exchange import Call, HeaderList, Reply, json_reply, parsed_json
from fluentboard.api.negotiation import Offer, negotiated
from fluentboard.api.operations import Operation
from fluentboard.api.writing import (
    commit_header,
    commit_json,
    committed,
    etag,
    event_json,
    expected_version,
    fluent_headers,
    has_version,
)
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.commands import AssertFluent, Command, CorrectFluent
from fluentboard.board.events import Commit
from fluentboard.board.intervals import FluentFilter
from fluentboard.board.listing import Page
from fluentboard.config import LimitSettings
from fluentboard.errors import InvalidInput
from fluentboard.model.fluent import Fluent
from fluentboard.model.json_format import fluent_from_json, fluent_to_json
from fluentboard.model.yaml_format import fluent_to_yaml

_FLUENT_OFFERS = (Offer(JSON, JSON), Offer(YAML, YAML))
_LIST_OFFERS = (Offer(JSON, JSON), Offer(YAML, YAML), Offer(NDJSON, NDJSON))
_PAGE_DEFAULT = 100
_VARY = (b"vary", b"Accept")


class FluentRoutes:
    """`/fluents` and `/commands`.

    Args:
        board: what is read and written.
        limits: on bodies, batches and pages.
    """

    def __init__(self, board: Blackboard, limits: LimitSettings) -> None:
        self._board = board
        self._limits = limits

    async def assert_fluents(self, call: Call) -> Reply:
        """`POST /fluents`."""
        merge = False
        if call.query_string:
            merge = parameters.flag(call.parameters(), "merge") or False
        limits = self._limits
        fluents, is_single = await fluents_of(call, limits.body_max_bytes, limits.batch_max)
        commands = [AssertFluent(fluent, merge) for fluent in fluents]
        commit = await committed(self._board, call, commands)
        standing = self._standing(commit, fluents)
        added = any(event.kind == "added" for event in commit.events)
        headers: HeaderList = [commit_header(commit.number)]
        if is_single:
            only = standing[0]
            headers = fluent_headers(call, only.name, only.version, commit.number)
        receipt = {
            "commit": commit.number,
            "fluents": [
                {"name": f.name, "version": f.version, "created": f.created} for f in standing
            ],
            "warnings": self._board.remarks(commands),
        }
        return json_reply(receipt, 201 if added else 200, headers)

    async def run_commands(self, call: Call) -> Reply:
        """`POST /commands`."""
        body_format(call, (JSON,))
        document = parsed_json(await call.body(self._limits.body_max_bytes))
        commands = commands_from_json(document, self._limits.batch_max)
        commit = await committed(self._board, call, commands)
        receipt = {
            "commit": commit.number,
            "events": [event_json(event) for event in commit.events],
            "warnings": self._board.remarks(commands),
        }
        return json_reply(receipt, 200, [commit_header(commit.number)])

    async def list_fluents(self, call: Call) -> Reply:
        """`GET /fluents`."""
        values = call.parameters()
        offer = negotiated(call.header(b"accept"), _LIST_OFFERS)
        wanted = self._filter(values)
        limit = parameters.number(
            values, "limit", least=1, most=self._limits.page_max, default=_PAGE_DEFAULT
        )
        after = parameters.number(values, "cursor")
        page = await asyncio.to_thread(self._board.list, wanted, after=after, limit=limit)
        headers = [commit_header(page.commit), _VARY]
        if page.next is not None:
            following = {**{k: v[0] for k, v in values.items()}, "cursor": str(page.next)}
            link = f'<{call.root_path}/fluents?{urlencode(following)}>; rel="next"'
            headers.append((b"link", link.encode()))
        return Reply(_page(page, offer.format), offer.media_type.encode(), 200, headers)

    async def read_fluent(self, call: Call) -> Reply:
        """`GET /fluents/{name}`."""
        offer = negotiated(call.header(b"accept"), _FLUENT_OFFERS)
        as_of = parameters.as_of(call.parameters(), self._board) if call.query_string else None
        fluent = self._board.fluent(call.arguments["name"], as_of)
        headers = [etag(fluent.version), _VARY]
        if b"if-none-match" in call.headers and has_version(call, fluent.version):
            return Reply(status=304, headers=headers)
        if offer.format == YAML:
            return Reply(fluent_to_yaml(fluent).encode(), YAML.encode(), 200, headers)
        return json_reply(fluent_to_json(fluent), 200, headers)

    async def refine_fluent(self, call: Call) -> Reply:
        """`PATCH /fluents/{name}`."""
        name = call.arguments["name"]
        body_format(call, (JSON, documented.MERGE_PATCH))
        document = parsed_json(await call.body(self._limits.body_max_bytes))
        command = refinement_from_json(document, name, expected_version(call, name))
        return await self._changed(call, name, command)

    async def end_fluent(self, call: Call) -> Reply:
        """`POST /fluents/{name}/end`."""
        name = call.arguments["name"]
        body = await call.body(self._limits.body_max_bytes)
        document = {}
        if body.strip():
            body_format(call, (JSON,))
            document = parsed_json(body)
        now_s = self._board.clock.now_s()
        command = ending_from_json(document, name, expected_version(call, name), now_s)
        return await self._changed(call, name, command)

    async def correct_fluent(self, call: Call) -> Reply:
        """`PUT /fluents/{name}`."""
        name = call.arguments["name"]
        reason = parameters.text(call.parameters(), "reason") or ""
        body_format(call, (JSON,))
        document = parsed_json(await call.body(self._limits.body_max_bytes))
        fluent = fluent_from_json(document)
        if fluent.name != name:
            raise InvalidInput(
                f"the body is about {fluent.name!r}, the address about {name!r}; a fluent cannot "
                "be renamed"
            )
        command = CorrectFluent(fluent, reason, expected_version(call, name))
        return await self._changed(call, name, command)

    async def read_history(self, call: Call) -> Reply:
        """`GET /fluents/{name}/history`."""
        name = call.arguments["name"]
        commits = await asyncio.to_thread(self._board.history, name)
        entries = [entry for commit in commits for entry in commit_json(commit)]
        return json_reply({"name": name, "history": entries})

    def operations(self) -> list[Operation]:
        """The routes, documented."""
        return documented.operations(
            {
                "assertFluents": self.assert_fluents,
                "runCommands": self.run_commands,
                "listFluents": self.list_fluents,
                "readFluent": self.read_fluent,
                "refineFluent": self.refine_fluent,
                "endFluent": self.end_fluent,
                "correctFluent": self.correct_fluent,
                "readHistory": self.read_history,
            }
        )

    async def _changed(self, call: Call, name: str, command: Command) -> Reply:
        commit = await committed(self._board, call, [command])
        after = commit.events[0].after if commit.events else self._board.fluent(name)
        receipt = {
            "commit": commit.number,
            "fluent": fluent_to_json(after),
            "warnings": self._board.remarks([command]),
        }
        return json_reply(receipt, 200, [commit_header(commit.number), etag(after.version)])

    def _standing(self, commit: Commit, fluents: Sequence[Fluent]) -> list[Fluent]:
        """The asserted fluents as the board has them after the commit."""
        changed = {event.after.name: event.after for event in commit.events}
        return [changed.get(f.name) or self._board.fluent(f.name) for f in fluents]

    def _filter(self, values: parameters.Values) -> FluentFilter:
        property_value = parameters.text(values, "value")
        property_name = parameters.text(values, "property")
        if property_value is not None and property_name is None:
            raise InvalidInput("value is given without property; say whose value it is")
        return FluentFilter(
            class_name=parameters.text(values, "class"),
            at_s=parameters.time_s(values, "at", self._board.clock),
            during=parameters.window_s(values, "during"),
            certainty=parameters.certainty(values),
            property_name=property_name,
            property_value=property_value,
            is_open=parameters.flag(values, "open"),
            as_of=parameters.as_of(values, self._board),
            relation=parameters.relation(values),
        )


def _page(page: Page, form: str) -> bytes:
    if form == YAML:
        return "---\n".join(fluent_to_yaml(fluent) for fluent in page.fluents).encode()
    found = [fluent_to_json(fluent) for fluent in page.fluents]
    if form == NDJSON:
        return b"".join(orjson.dumps(f, option=orjson.OPT_APPEND_NEWLINE) for f in found)
    return orjson.dumps({"fluents": found, "next": page.next, "commit": page.commit})
