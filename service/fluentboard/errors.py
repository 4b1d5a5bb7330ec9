"""Every error fluentboard raises on purpose, each with a stable `code`.

A message says what happened, names the offending value and its unit, and says what to do.
`docs/errors.md` explains each code; over HTTP an error is an RFC 9457 problem document.
"""

from __future__ import annotations

from typing import Any, ClassVar


class FluentboardError(Exception):
    """Base of all errors with a stable code.

    Attributes:
        code: stable identifier, the same in Python, HTTP, the CLI and the documentation.
        http_status: the status the service answers with.
        detail: machine-readable particulars (offending value, position, name).
    """

    code: ClassVar[str] = "error"
    http_status: ClassVar[int] = 500

    def __init__(self, message: str, **detail: Any) -> None:
        super().__init__(message)
        self.message = message
        self.detail: dict[str, Any] = detail

    def __str__(self) -> str:
        return f"{self.code}: {self.message}"


class InvalidInput(FluentboardError):
    """What was given cannot be understood."""

    code = "invalid-input"
    http_status = 422


class InvalidGeometry(InvalidInput):
    """A pose, box, plane or transform is not one."""

    code = "invalid-geometry"


class InvalidTime(InvalidInput):
    """A time is NaN, infinite, not a number, or the reserved 0.0."""

    code = "invalid-time"


class IntervalReversed(InvalidInput):
    """An interval ends before it starts, or a fluent finishes before it can have started."""

    code = "interval-reversed"


class InvalidName(InvalidInput):
    """A fluent, class or property name has characters that an IRI cannot carry."""

    code = "invalid-name"


class InvalidValue(InvalidInput):
    """A property value does not fit its declared XSD type."""

    code = "invalid-value"


class UnknownClass(InvalidInput):
    """A class is not in any loaded ontology."""

    code = "unknown-class"


class InvalidYaml(InvalidInput):
    """A YAML document is not a `!Fluent`; the message names file, line and document."""

    code = "invalid-yaml"


class InvalidQuery(InvalidInput):
    """A SPARQL query or update does not parse."""

    code = "invalid-query"
    http_status = 400


class InvalidConfiguration(InvalidInput):
    """A setting is unknown or out of range."""

    code = "invalid-configuration"


class InvalidOntology(InvalidInput):
    """An ontology file does not parse or contradicts a loaded one."""

    code = "invalid-ontology"


class InvalidFrame(InvalidInput):
    """A sensor frame is missing a part, truncated, or inconsistent with its camera."""

    code = "invalid-frame"


class InvalidModel(InvalidInput):
    """A trained model is missing, damaged, or was trained for other classes than asked for."""

    code = "invalid-model"


class UnreachableView(InvalidInput):
    """A robot cannot get there: its base would collide, or a joint would leave its limits."""

    code = "unreachable-view"


class UnknownFluent(FluentboardError):
    """No fluent of that name was ever asserted."""

    code = "unknown-fluent"
    http_status = 404


class UnknownResource(FluentboardError):
    """No route, graph or subscription of that name."""

    code = "unknown-resource"
    http_status = 404


class FluentExists(FluentboardError):
    """A different fluent of that name is on the board already."""

    code = "fluent-exists"
    http_status = 409


class NotARefinement(FluentboardError):
    """A change would widen an interval, un-end a fluent, change its class or remove a value."""

    code = "not-a-refinement"
    http_status = 409


class ShapeViolation(FluentboardError):
    """A write violates a SHACL shape of the board; nothing was stored."""

    code = "shape-violation"
    http_status = 422


class VersionMismatch(FluentboardError):
    """Somebody else changed the fluent since the caller read it."""

    code = "version-mismatch"
    http_status = 412


class IdempotencyConflict(FluentboardError):
    """An idempotency key was used again with another request."""

    code = "idempotency-conflict"
    http_status = 409


class FluentsAreReadOnly(FluentboardError):
    """A SPARQL update would touch fluents, which change only by commands."""

    code = "fluents-are-read-only"
    http_status = 403


class NotAllowed(FluentboardError):
    """The caller's role does not permit this."""

    code = "not-allowed"
    http_status = 403


class NotAuthenticated(FluentboardError):
    """The caller sent no valid token."""

    code = "not-authenticated"
    http_status = 401


class NotAcceptable(FluentboardError):
    """None of the media types the caller accepts can be produced."""

    code = "not-acceptable"
    http_status = 406


class UnsupportedMediaType(FluentboardError):
    """The body's media type is not one the route reads."""

    code = "unsupported-media-type"
    http_status = 415


class TooLarge(FluentboardError):
    """A body, batch or result exceeds its configured limit."""

    code = "too-large"
    http_status = 413


class TooManySubscriptions(FluentboardError):
    """A client holds as many subscriptions as it may."""

    code = "too-many-subscriptions"
    http_status = 429


class SubscriptionExists(FluentboardError):
    """A durable subscription of that name is on the board already."""

    code = "subscription-exists"
    http_status = 409


class QueryTimeout(FluentboardError):
    """A query took longer than its limit and was stopped."""

    code = "query-timeout"
    http_status = 503


class StorageFailed(FluentboardError):
    """The journal could not be written (disk full, read-only, damaged); nothing was stored."""

    code = "storage-failed"
    http_status = 507


class UnexpectedCommit(StorageFailed):
    """Another writer appended to the journal first; nothing was stored."""

    code = "unexpected-commit"
    http_status = 409


class BoardUnreachable(FluentboardError):
    """The client cannot reach the board."""

    code = "board-unreachable"
    http_status = 503


class MissingExtra(FluentboardError):
    """A part of fluentboard is used whose extra is not installed."""

    code = "missing-extra"


class ReasonerFailed(FluentboardError):
    """The external reasoner does not start or broke down; the compiled rules need none."""

    code = "reasoner-failed"


def error_classes() -> dict[str, type[FluentboardError]]:
    """The class of each code, as far as their modules are imported."""
    found: dict[str, type[FluentboardError]] = {}
    waiting: list[type[FluentboardError]] = [FluentboardError]
    while waiting:
        kind = waiting.pop()
        found[kind.code] = kind
        waiting += kind.__subclasses__()
    return found
