"""Bodies: what writers send, as commands."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, cast

import orjson

from fluentboard.api.exchange import Call, parsed_json, utf8_text
from fluentboard.board.commands import AssertFluent, Command, EndFluent, RefineFluent
from fluentboard.errors import InvalidInput, TooLarge, UnsupportedMediaType
from fluentboard.model.fluent import Fluent
from fluentboard.model.json_format import (
    fluent_from_json,
    interval_from_json,
    properties_from_json,
)
from fluentboard.model.yaml_format import read_fluents

JSON = "application/json"
YAML = "application/yaml"
NDJSON = "application/x-ndjson"

# What YAML and JSON Lines were called before they had a registered name.
ALIASES: Mapping[str, str] = {
    "text/yaml": YAML,
    "application/x-yaml": YAML,
    "text/x-yaml": YAML,
    "application/ndjson": NDJSON,
    "application/jsonl": NDJSON,
    "application/x-jsonlines": NDJSON,
}

# A body shorter than this is understood in less time than handing it to a thread takes away.
_LONG_BODY_BYTES = 64 * 1024

_REFINE_KEYS = frozenset({"start", "finish", "properties"})
_OPERATIONS = {
    "assert": frozenset({"op", "fluent", "merge"}),
    "refine": frozenset({"op", "name", "version", *_REFINE_KEYS}),
    "end": frozenset({"op", "name", "finish", "version"}),
}


def body_format(call: Call, accepted: Sequence[str]) -> str:
    """The media type of the body, by its proper name.

    Raises:
        UnsupportedMediaType: it is none of those accepted.
    """
    given = call.media_type
    media_type = ALIASES.get(given, given)
    if media_type not in accepted:
        raise UnsupportedMediaType(
            f"the body is {given or 'untyped'}; send it with Content-Type {' or '.join(accepted)}",
            accepted=list(accepted),
        )
    return media_type


async def fluents_of(call: Call, body_max_bytes: int, batch_max: int) -> tuple[list[Fluent], bool]:
    """The fluents in the body, and whether it was a single JSON object.

    Raises:
        InvalidInput: the body is not what its media type says, or describes no fluents.
        TooLarge: it is too long, or holds too many.
        UnsupportedMediaType: it is neither JSON, YAML nor JSON Lines.
    """
    media_type = body_format(call, (JSON, YAML, NDJSON))
    body = await call.body(body_max_bytes)
    if len(body) < _LONG_BODY_BYTES:
        return _fluents(body, media_type, batch_max)
    return await asyncio.to_thread(_fluents, body, media_type, batch_max)


def _fluents(body: bytes, media_type: str, batch_max: int) -> tuple[list[Fluent], bool]:
    if media_type == YAML:
        return _at_most(batch_max, read_fluents(utf8_text(body), "the body")), False
    if media_type == NDJSON:
        return _at_most(batch_max, json_lines(body.splitlines())), False
    document = parsed_json(body)
    if isinstance(document, dict):
        members = cast("dict[str, Any]", document)
        if "fluents" not in members:
            return [fluent_from_json(members)], True
        unknown = members.keys() - {"fluents"}
        if unknown:
            raise InvalidInput(f"the body has the unknown key {min(unknown)!r}; the key is fluents")
        document = members["fluents"]
    if not isinstance(document, list):
        raise InvalidInput(
            'the body holds no fluents; send one as an object, several as a list or as {"fluents": '
            "[...]}"
        )
    entries = cast("list[Any]", document)
    check_batch(len(entries), batch_max)
    return [
        fluent_from_json(entry, f"fluent {position}")
        for position, entry in enumerate(entries, start=1)
    ], False


def json_lines(lines: Iterable[bytes]) -> Iterator[Fluent]:
    """The fluents of JSON Lines, one after the other; empty lines are skipped.

    Raises:
        InvalidInput: a line is not JSON or not a fluent; the message names it.
    """
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            document = orjson.loads(line)
        except orjson.JSONDecodeError as problem:
            raise InvalidInput(
                f"line {number} is not JSON: {problem.msg} (column {problem.colno})",
                line=number,
                column=problem.colno,
            ) from None
        yield fluent_from_json(document, f"the fluent in line {number}")


def commands_from_json(document: Any, batch_max: int) -> list[Command]:
    """The commands of a mixed batch.

    Raises:
        InvalidInput: an entry is no command; the message names it.
        TooLarge: there are too many.
    """
    members = cast("dict[str, Any]", document) if isinstance(document, dict) else {}
    if members.keys() != {"commands"} or not isinstance(members["commands"], list):
        raise InvalidInput('the body holds no commands; send {"commands": [...]}')
    entries = cast("list[Any]", members["commands"])
    check_batch(len(entries), batch_max)
    return [_command(entry, f"command {n}") for n, entry in enumerate(entries, start=1)]


def refinement_from_json(document: Any, name: str, version: int | None) -> RefineFluent:
    """The refinement that the body of a PATCH asks for.

    Raises:
        InvalidInput: it is not an object of start, finish and properties.
    """
    members = _members(document, _REFINE_KEYS, "the refinement")
    return _refinement(members, name, version)


def ending_from_json(document: Any, name: str, version: int | None, now_s: float) -> EndFluent:
    """The ending that the body of a POST to `/end` asks for; by default now.

    Raises:
        InvalidInput: it is not an object of at most `at`.
    """
    members = _members(document, frozenset({"at"}), "the ending")
    at = members.get("at", "now")
    is_now = at == "now"
    return EndFluent(name, interval_from_json(now_s if is_now else at, "at"), version, is_now)


def check_batch(count: int, batch_max: int) -> None:
    """Refuses a batch that is too long.

    Raises:
        TooLarge: it is.
    """
    if count > batch_max:
        raise TooLarge(
            f"the batch has {count:,} entries, more than the {batch_max:,} that one commit may "
            "have; send it in parts, or use POST /import",
            limit=batch_max,
        )


def _at_most(batch_max: int, fluents: Iterable[Fluent]) -> list[Fluent]:
    found: list[Fluent] = []
    for fluent in fluents:
        found.append(fluent)
        if len(found) > batch_max:
            check_batch(len(found), batch_max)
    return found


def _command(entry: Any, where: str) -> Command:
    kind = cast("dict[str, Any]", entry).get("op") if isinstance(entry, dict) else None
    keys = _OPERATIONS.get(kind) if isinstance(kind, str) else None
    if keys is None:
        raise InvalidInput(
            f"{where} has the op {kind!r}; give an object with op assert, refine or end"
        )
    members = _members(entry, keys, where)
    if kind == "assert":
        merge = members.get("merge", False)
        if not isinstance(merge, bool):
            raise InvalidInput(f"{where} has merge {merge!r}; give true or false")
        return AssertFluent(
            fluent_from_json(members.get("fluent"), f"the fluent of {where}"), merge
        )
    name = members.get("name")
    if not isinstance(name, str):
        raise InvalidInput(f"{where} has the name {name!r}; give the name of a fluent")
    version = members.get("version")
    if version is not None and (isinstance(version, bool) or not isinstance(version, int)):
        raise InvalidInput(f"{where} has version {version!r}; give a commit number")
    if kind == "end":
        if "finish" not in members:
            raise InvalidInput(f"{where} has no finish; give [earliest, latest] or one number")
        return EndFluent(name, interval_from_json(members["finish"], f"finish of {where}"), version)
    return _refinement(members, name, version)


def _refinement(members: Mapping[str, Any], name: str, version: int | None) -> RefineFluent:
    start, finish = (
        None if members.get(key) is None else interval_from_json(members[key], f"{key} of {name!r}")
        for key in ("start", "finish")
    )
    return RefineFluent(
        name, start, finish, properties_from_json(members.get("properties", ())), version
    )


def _members(document: Any, allowed: frozenset[str], where: str) -> Mapping[str, Any]:
    if not isinstance(document, dict):
        raise InvalidInput(f"{where} is {document!r}; give a JSON object")
    members = cast("dict[str, Any]", document)
    unknown = members.keys() - allowed
    if unknown:
        raise InvalidInput(
            f"{where} has the unknown key {min(unknown)!r}; keys are {', '.join(sorted(allowed))}"
        )
    return members
