"""What the board's replies mean, without a network."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import httpx

from fluentboard.errors import InvalidInput
from fluentboard.model.fluent import Fluent
from fluentboard.model.json_format import fluent_from_json
from fluentboard_client.exchange import RESULTS_JSON
from fluentboard_client.results import Row, rows


@dataclass(frozen=True, slots=True)
class FluentChange:
    """What a commit did to one fluent.

    Attributes:
        kind: `added`, `refined`, `ended` or `corrected`.
        fluent: as it stands since then.
        commit: number of the commit.
        author: who made the commit.
        wall_s: when it was made, in seconds since the Unix epoch; None where not said.
        reason: why, where an admin forced it.
    """

    kind: str
    fluent: Fluent
    commit: int
    author: str = ""
    wall_s: float | None = None
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Receipt:
    """What a write led to.

    Attributes:
        commit: the number of the commit that holds it; the current one if nothing changed.
        warnings: what the board noticed, such as references to fluents that do not exist yet.
    """

    commit: int
    warnings: tuple[str, ...] = ()


def receipt(reply: httpx.Response) -> Receipt:
    """The receipt of a write."""
    body: Any = reply.json() if reply.content else {}
    members = cast("dict[str, Any]", body) if isinstance(body, dict) else {}
    commit = reply.headers.get("X-Commit") or members.get("commit", 0)
    return Receipt(int(commit), tuple(str(w) for w in members.get("warnings", ())))


def fluent_of(reply: httpx.Response) -> Fluent:
    """The fluent that a reply describes."""
    return fluent_from_json(reply.json(), "the board's reply")


def page_of(reply: httpx.Response) -> tuple[list[Fluent], str | None]:
    """The fluents of a page, and the cursor of the next one if there is one."""
    body = reply.json()
    following = body.get("next")
    return (
        [fluent_from_json(entry, "the board's reply") for entry in body["fluents"]],
        None if following is None else str(following),
    )


def changes_of(reply: httpx.Response) -> list[FluentChange]:
    """The changes in a reply about a fluent's history, oldest first."""
    body = reply.json()
    entries = cast("list[dict[str, Any]]", body if isinstance(body, list) else body["history"])
    return [change_from_json(entry) for entry in entries]


def change_from_json(entry: Mapping[str, Any]) -> FluentChange:
    """A change as the history and the live messages describe it."""
    return FluentChange(
        str(entry["event"]),
        fluent_from_json(entry["fluent"], "the board's reply"),
        int(entry["commit"]),
        str(entry.get("author", "")),
        entry.get("wall_s"),
        str(entry.get("reason", "")),
    )


def result_of(reply: httpx.Response) -> list[Row] | bool | str:
    """Rows of a SELECT, truth of an ASK, N-Triples text of a CONSTRUCT or DESCRIBE."""
    media_type = reply.headers.get("Content-Type", "").partition(";")[0].strip()
    if media_type != RESULTS_JSON:
        return reply.text
    document = reply.json()
    if "boolean" in document:
        return bool(document["boolean"])
    return rows(document["results"]["bindings"], document["head"].get("vars", ()))


def rows_of(reply: httpx.Response) -> list[Row]:
    """Rows of a SELECT.

    Raises:
        InvalidInput: the query was of another form.
    """
    result = result_of(reply)
    if not isinstance(result, list):
        raise _wrong_form("SELECT")
    return result


def truth_of(reply: httpx.Response) -> bool:
    """Truth of an ASK.

    Raises:
        InvalidInput: the query was of another form.
    """
    result = result_of(reply)
    if not isinstance(result, bool):
        raise _wrong_form("ASK")
    return result


def triples_of(reply: httpx.Response) -> str:
    """N-Triples text of a CONSTRUCT or DESCRIBE.

    Raises:
        InvalidInput: the query was of another form.
    """
    result = result_of(reply)
    if not isinstance(result, str):
        raise _wrong_form("CONSTRUCT or DESCRIBE")
    return result


def commits_of(reply: httpx.Response) -> tuple[list[dict[str, Any]], str | None]:
    """The commits on a page of the audit, and where the next page begins if there is one."""
    body = json_of(reply)
    following = body["next"]
    return body["commits"], None if following is None else str(following)


def json_of(reply: httpx.Response) -> dict[str, Any]:
    """The JSON object in a reply."""
    return cast("dict[str, Any]", reply.json())


def bytes_of(reply: httpx.Response) -> bytes:
    """The body of a reply, as it is."""
    return reply.content


def nothing_of(_: httpx.Response) -> None:
    """What a reply says that only confirms."""


def _wrong_form(expected: str) -> InvalidInput:
    return InvalidInput(f"the query is not a {expected}; call query(), which takes any form")
