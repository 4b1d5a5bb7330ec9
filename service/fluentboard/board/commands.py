"""Commands: what a writer asks the board to do, and what it would change (pure).

Imperative in name; the board answers each accepted command with an event.
"""

from __future__ import annotations

from dataclasses import dataclass

from fluentboard.board.events import Event, FluentAdded, FluentCorrected, FluentEnded, FluentRefined
from fluentboard.errors import FluentExists, InvalidInput, UnknownFluent, VersionMismatch
from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Interval


@dataclass(frozen=True, slots=True)
class AssertFluent:
    """Put a new fluent on the board.

    Asserting again what the board holds already changes nothing, so a retry is harmless.

    Attributes:
        fluent: what to assert; its version, author and created are set by the board.
        merge: refine the fluent of that name if there is one, instead of refusing (imports).
    """

    fluent: Fluent
    merge: bool = False


@dataclass(frozen=True, slots=True)
class RefineFluent:
    """Narrow the intervals of a fluent or add property values to it.

    Attributes:
        name: the fluent.
        start: the narrower start, or None to leave it.
        finish: the narrower finish, or None to leave it.
        properties: statements to add.
        expected_version: refuse unless this is the fluent's version (HTTP If-Match).
    """

    name: str
    start: Interval | None = None
    finish: Interval | None = None
    properties: tuple[Property, ...] = ()
    expected_version: int | None = None


@dataclass(frozen=True, slots=True)
class EndFluent:
    """Say when a fluent ceased to hold.

    Attributes:
        name: the fluent.
        finish: the interval that its end lies in.
        expected_version: refuse unless this is the fluent's version (HTTP If-Match).
        is_now: the finish is the moment at which this was asked; asked again, it is a later one.
    """

    name: str
    finish: Interval
    expected_version: int | None = None
    is_now: bool = False


@dataclass(frozen=True, slots=True)
class CorrectFluent:
    """Replace what the board says of a fluent, against the rules: admins only.

    Attributes:
        fluent: the fluent as it should have been; class, intervals and properties are replaced.
        reason: why; the journal keeps it.
        expected_version: refuse unless this is the fluent's version (HTTP If-Match).
    """

    fluent: Fluent
    reason: str = ""
    expected_version: int | None = None


Command = AssertFluent | RefineFluent | EndFluent | CorrectFluent


def name_of(command: Command) -> str:
    """The fluent that a command is about."""
    if isinstance(command, AssertFluent | CorrectFluent):
        return command.fluent.name
    return command.name


def decide(command: Command, current: Fluent | None) -> Event | None:
    """The event that a command leads to, or None if it changes nothing.

    Args:
        command: what is asked.
        current: the fluent of that name as it stands, or None if there is none.

    Raises:
        FluentExists, NotARefinement, IntervalReversed, UnknownFluent, VersionMismatch,
            InvalidInput: each as its class says.
    """
    if isinstance(command, AssertFluent):
        return _decide_assertion(command, current)
    if current is None:
        name = name_of(command)
        raise UnknownFluent(f"no fluent {name!r} on the board; assert it first", name=name)
    _check_version(command.expected_version, current)
    if isinstance(command, CorrectFluent):
        if not command.reason.strip():
            raise InvalidInput(f"correcting {current.name!r} needs a reason; the journal keeps it")
        if _same_statement(current, command.fluent):
            return None
        return FluentCorrected(current, command.fluent)
    if isinstance(command, EndFluent):
        after = current.ended(command.finish)
        return None if _same_statement(current, after) else FluentEnded(current, after)
    after = current.refined(command.start, command.finish, command.properties)
    return _refinement(current, after)


def _check_version(expected: int | None, current: Fluent) -> None:
    if expected is not None and expected != current.version:
        raise VersionMismatch(
            f"fluent {current.name!r} is at version {current.version}, not {expected}; read it "
            "again and repeat the change",
            name=current.name,
            version=current.version,
        )


def _decide_assertion(command: AssertFluent, current: Fluent | None) -> Event | None:
    fluent = command.fluent
    if current is None:
        return FluentAdded(fluent)
    if command.merge:
        return _refinement(current, current.merged(fluent))
    if _same_statement(current, fluent):
        return None
    raise FluentExists(
        f"fluent {fluent.name!r} is on the board already (version {current.version}) and says "
        "something else; refine or end it, or choose another name",
        name=fluent.name,
        version=current.version,
    )


def _refinement(before: Fluent, after: Fluent) -> Event | None:
    if _same_statement(before, after):
        return None
    if before.is_open and not after.is_open:
        return FluentEnded(before, after)
    return FluentRefined(before, after)


def _same_statement(one: Fluent, other: Fluent) -> bool:
    return (
        one.class_name == other.class_name
        and one.start == other.start
        and one.finish == other.finish
        and one.properties == other.properties
    )
