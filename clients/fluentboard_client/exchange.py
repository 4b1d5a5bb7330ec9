"""What the board is asked over HTTP and what its replies mean, without a network.

`Client` and `AsyncClient` send the same requests and read the replies with the same functions.
"""

from __future__ import annotations

import uuid
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, cast
from urllib.parse import quote, urlsplit

import httpx

from fluentboard.errors import BoardUnreachable, FluentboardError, InvalidInput
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Interval
from fluentboard.model.json_format import fluent_from_json
from fluentboard_client.commands import Command, RefineFluent, statement_json
from fluentboard_client.problems import error_from_problem
from fluentboard_client.results import Row, rows

ImportFormat = Literal["yaml", "jsonl", "turtle", "ntriples", "trig", "nquads", "jsonld", "rdfxml"]
ExportFormat = Literal["yaml", "jsonl", "turtle", "ntriples", "trig", "nquads", "jsonld"]
RdfVocabulary = Literal["upper", "owl-time"]
ChangesFormat = Literal["rdf-patch", "jsonl"]
Time = float | Literal["now"]

MEDIA_TYPES: Mapping[str, str] = {
    "yaml": "application/yaml",
    "jsonl": "application/x-ndjson",
    "turtle": "text/turtle",
    "ntriples": "application/n-triples",
    "trig": "application/trig",
    "nquads": "application/n-quads",
    "jsonld": "application/ld+json",
    "rdfxml": "application/rdf+xml",
    "rdf-patch": "application/rdf-patch",
}
DEFAULT_GRAPH = "default"
"""Names the default graph where an import asks for a graph."""

_RESULTS_JSON = "application/sparql-results+json"
_ANY_RESULT = f"{_RESULTS_JSON}, application/n-triples"

_RETRIED = (
    httpx.ConnectError,
    httpx.ConnectTimeout,
    httpx.ReadError,
    httpx.WriteError,
    httpx.RemoteProtocolError,
)
_AUDIT_PAGE = 1_000
_FIRST_DELAY_S, _LONGEST_DELAY_S = 0.1, 5.0


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


@dataclass(frozen=True, slots=True)
class Request:
    """One request; sending it twice has the effect of sending it once."""

    method: str
    path: str
    params: Mapping[str, str] = field(default_factory=dict[str, str])
    json: Any = None
    form: Mapping[str, str] | None = None
    headers: Mapping[str, str] = field(default_factory=dict[str, str])


def board_address(text: str) -> str:
    """The address without a trailing slash.

    Raises:
        InvalidInput: it is not an http or https URL with a host.
    """
    parts = urlsplit(text)
    if parts.scheme not in ("http", "https") or not parts.hostname:
        raise InvalidInput(
            f"board address {text!r} is not a URL; give one such as http://127.0.0.1:8080"
        )
    return text.rstrip("/")


def is_loopback(address: str) -> bool:
    """Whether an address stays on this machine; no proxy of the environment must come between."""
    host = urlsplit(address).hostname or ""
    return host in ("localhost", "::1") or host.startswith("127.")


def headers(author: str, token: str | None) -> dict[str, str]:
    """What every request carries."""
    found = {"X-Author": author} if author else {}
    return found | ({"Authorization": f"Bearer {token}"} if token else {})


def retry_delay_s(failure: httpx.TransportError, attempt: int, retries: int) -> float | None:
    """Seconds to wait before another try, or None if the failure is final.

    Args:
        failure: why the request failed.
        attempt: how often it was tried, 1 after the first try.
        retries: how often it may be tried again.
    """
    # A read time-out is final: the board is there and busy, and asking again makes that worse.
    if attempt > retries or not isinstance(failure, _RETRIED):
        return None
    return backoff_s(attempt)


def backoff_s(attempt: int) -> float:
    """Seconds to wait before try number `attempt + 1`: doubling, at most 5 s."""
    return min(_FIRST_DELAY_S * 2.0 ** min(attempt - 1, 16), _LONGEST_DELAY_S)


def unreachable(address: str, failure: Exception, attempts: int) -> FluentboardError:
    """The error after the last failed attempt."""
    times = "" if attempts == 1 else f" ({attempts} attempts)"
    if isinstance(failure, (httpx.ReadTimeout, httpx.WriteTimeout, TimeoutError)):
        return BoardUnreachable(f"{address} did not answer in time{times}; raise timeout_s")
    return BoardUnreachable(
        f"{address} cannot be reached{times}: {failure or type(failure).__name__}; "
        "is `fluentboard serve` running there?"
    )


def wrong_form(expected: str) -> InvalidInput:
    """The error of a query that is not of the expected form."""
    return InvalidInput(f"the query is not a {expected}; call query(), which takes any form")


def assertion(fluents: Sequence[Fluent], merge: bool, key: str | None) -> Request:
    """Assert fluents, all of them or none."""
    return Request(
        "POST",
        "/fluents",
        params={"merge": "true"} if merge else {},
        json={"fluents": [statement_json(fluent) for fluent in fluents]},
        headers=_key(key),
    )


def refinement(command: RefineFluent, key: str | None) -> Request:
    """Refine one fluent."""
    return Request(
        "PATCH",
        _fluent_path(command.name),
        json=command.changes_json(),
        headers={**_key(key), **_if_match(command.version)},
    )


def ending(name: str, at: float | Interval | None, version: int | None, key: str | None) -> Request:
    """End one fluent; None is the board's present."""
    value = [at.earliest, at.latest] if isinstance(at, Interval) else at
    return Request(
        "POST",
        _fluent_path(name) + "/end",
        json={} if value is None else {"at": value},
        headers={**_key(key), **_if_match(version)},
    )


def batch(commands: Iterable[Command], key: str | None) -> Request:
    """Several commands, all of them or none."""
    return Request(
        "POST",
        "/commands",
        json={"commands": [command.to_json() for command in commands]},
        headers=_key(key),
    )


def fluent(name: str, as_of: int | None) -> Request:
    """One fluent, as it stands or as it stood after a commit."""
    return Request("GET", _fluent_path(name), params=_params(asof=as_of))


def history(name: str) -> Request:
    """Every change of one fluent."""
    return Request("GET", _fluent_path(name) + "/history")


def listing(
    *,
    class_name: str | None,
    at: Time | None,
    during: tuple[float, float] | None,
    certainly: bool,
    property_name: str | None,
    value: str | None,
    is_open: bool | None,
    as_of: int | None,
    page_size: int,
    cursor: str | None,
) -> Request:
    """One page of the fluents that pass a filter."""
    params = _params(
        **{
            "class": class_name,
            "at": at,
            "during": None if during is None else f"{during[0]!r},{during[1]!r}",
            "certainly": "true" if certainly else None,
            "property": property_name,
            "value": value,
            "open": None if is_open is None else str(is_open).lower(),
            "asof": as_of,
            "limit": page_size,
            "cursor": cursor,
        }
    )
    return Request("GET", "/fluents", params=params, headers={"Accept": "application/json"})


def sparql(
    query: str,
    *,
    at: Time | None = None,
    certainly: bool = False,
    as_of: int | None = None,
    media_types: str = _ANY_RESULT,
) -> Request:
    """A SPARQL query of any form, over all of history or over a part of it."""
    # As a form in the body, because a query may be longer than an address can be.
    return Request(
        "POST",
        "/sparql",
        form={
            "query": query,
            **_params(at=at, certainly="true" if certainly else None, asof=as_of),
        },
        headers={"Accept": media_types},
    )


def import_params(graph: str | None) -> dict[str, str]:
    """The parameters of an import whose statements outside fluents go to a graph."""
    if graph is None:
        return {}
    return {"default": ""} if graph == DEFAULT_GRAPH else {"graph": graph}


def export(
    format: ExportFormat,
    at: Time | None,
    *,
    class_name: str | None = None,
    during: tuple[float, float] | None = None,
    certainly: bool = False,
    as_of: int | None = None,
    vocabulary: RdfVocabulary | None = None,
    relations: bool = False,
) -> Request:
    """Everything on the board, or what passes a filter."""
    params = _params(
        **{
            "format": format,
            "at": at,
            "class": class_name,
            "during": None if during is None else f"{during[0]!r},{during[1]!r}",
            "certainly": "true" if certainly else None,
            "asof": as_of,
            "vocabulary": vocabulary,
            "relations": "true" if relations else None,
        }
    )
    return Request("GET", "/export", params=params)


def changes(since: int, until: int | None, follow: bool, format: ChangesFormat) -> Request:
    """What commits changed."""
    params = _params(since=since, until=until, follow="true" if follow else None)
    return Request("GET", "/changes", params=params, headers={"Accept": MEDIA_TYPES[format]})


def backup(up_to: str | None) -> Request:
    """A copy of the journal."""
    return Request("GET", "/backup", params=_params(upto=up_to))


def audit(
    author: str | None, name: str | None, after: str | None, up_to: str | None, forced: bool
) -> Request:
    """Who changed what and when."""
    params = _params(author=author, name=name, after=after, upto=up_to, limit=_AUDIT_PAGE)
    return Request("GET", "/audit", params={**params, **({"forced": "true"} if forced else {})})


def check(reply: httpx.Response, address: str) -> None:
    """Raises the error that a reply stands for, if it is one; its body must have been read."""
    if reply.is_success:
        return
    try:
        problem = reply.json()
    except ValueError:
        problem = None
    raise error_from_problem(problem, reply.status_code, address)


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
    if media_type != _RESULTS_JSON:
        return reply.text
    document = reply.json()
    if "boolean" in document:
        return bool(document["boolean"])
    return rows(document["results"]["bindings"], document["head"].get("vars", ()))


def _fluent_path(name: str) -> str:
    return "/fluents/" + quote(name, safe="")


def _key(key: str | None) -> dict[str, str]:
    return {"Idempotency-Key": key or uuid.uuid4().hex}


def _if_match(version: int | None) -> dict[str, str]:
    return {} if version is None else {"If-Match": f'"{version}"'}


def _params(**given: str | float | int | None) -> dict[str, str]:
    return {name: str(value) for name, value in given.items() if value is not None}
