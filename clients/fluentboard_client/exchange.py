"""What the board is asked over HTTP, without a network; `replies` has what it answers."""

from __future__ import annotations

import uuid
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal
from urllib.parse import quote, urlsplit

import httpx

from fluentboard.errors import BoardUnreachable, FluentboardError, InvalidInput, InvalidName
from fluentboard.model.fluent import Fluent
from fluentboard.model.interval import Interval
from fluentboard_client.commands import Command, RefineFluent, statement_json
from fluentboard_client.problems import error_from_problem

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

RESULTS_JSON = "application/sparql-results+json"
"""Media type of the results of a SELECT or ASK."""

_ANY_RESULT = f"{RESULTS_JSON}, application/n-triples"

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
class Request:
    """One request; sending it twice has the effect of sending it once.

    Attributes:
        method: of HTTP.
        path: below the address of the board.
        params: of the query string.
        json: the body, as JSON.
        form: the body, as fields of a form.
        headers: besides those that every request carries.
        pieces: the body, piece by piece; such a request cannot be sent twice, and its reply takes
            as long as it takes.
    """

    method: str
    path: str
    params: Mapping[str, str] = field(default_factory=dict[str, str])
    json: Any = None
    form: Mapping[str, str] | None = None
    headers: Mapping[str, str] = field(default_factory=dict[str, str])
    pieces: Iterator[bytes] | None = None


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


def headers(author: str, token: str | None) -> httpx.Headers:
    """What every request carries, in UTF-8.

    Raises:
        InvalidInput: the author or the token has control characters.
    """
    found = {"X-Author": author} if author else {}
    if token:
        found["Authorization"] = f"Bearer {token}"
    for header, value in found.items():
        if not value.isprintable():
            raise InvalidInput(
                f"the header {header} would have control characters; give a name or a token on one "
                "line, without a line break at its end"
            )
    return httpx.Headers(found, encoding="utf-8")


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


def importing(pieces: Iterator[bytes], format: ImportFormat, graph: str | None) -> Request:
    """Take in a document, sent piece by piece; statements outside fluents go to a graph."""
    params = {} if graph is None else {"graph": graph}
    return Request(
        "POST",
        "/import",
        params={"default": ""} if graph == DEFAULT_GRAPH else params,
        headers={"Content-Type": MEDIA_TYPES[format]},
        pieces=pieces,
    )


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


def segment(name: str) -> str:
    """A name as one part of a path.

    Raises:
        InvalidName: the path would be another one than the name says.
    """
    if name in ("", ".", "..") or "/" in name:
        raise InvalidName(
            f"nothing on a board is called {name!r}; give the name of a fluent, object or "
            "subscription as it was made"
        )
    return quote(name, safe="")


def _fluent_path(name: str) -> str:
    return "/fluents/" + segment(name)


def _key(key: str | None) -> dict[str, str]:
    return {"Idempotency-Key": key or uuid.uuid4().hex}


def _if_match(version: int | None) -> dict[str, str]:
    return {} if version is None else {"If-Match": f'"{version}"'}


def _params(**given: str | float | int | None) -> dict[str, str]:
    return {name: str(value) for name, value in given.items() if value is not None}
