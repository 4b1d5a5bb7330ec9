"""Fluents: to put them on a board, change them and read them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from fluentboard.model.fluent import Fluent, Property
from fluentboard.model.interval import Interval
from fluentboard_client import exchange, replies, trajectories
from fluentboard_client.calls import Ask, Pages, call, pages
from fluentboard_client.commands import Command, RefineFluent
from fluentboard_client.exchange import ImportFormat, Request, Time
from fluentboard_client.replies import FluentChange, Receipt
from fluentboard_client.streams import counted, file_pieces
from fluentboard_client.trajectories import Trajectory


class FluentCalls:
    """What `Client` and `AsyncClient` have for fluents."""

    @call
    def assert_fluents(
        self, fluents: Fluent | Iterable[Fluent], *, merge: bool = False, key: str | None = None
    ) -> Ask[Receipt]:
        """Puts fluents on the board, all of them or none.

        Args:
            fluents: one or several.
            merge: refine those that are there already, instead of refusing.
            key: idempotency key; by default a new one.

        Raises:
            FluentExists: one is on the board already and says something else.
            UnknownClass: no loaded ontology has its class.
        """
        several = [fluents] if isinstance(fluents, Fluent) else list(fluents)
        return Ask(exchange.assertion(several, merge, key), replies.receipt)

    @call
    def refine(
        self,
        name: str,
        *,
        start: Interval | None = None,
        finish: Interval | None = None,
        properties: Sequence[Property] = (),
        version: int | None = None,
        key: str | None = None,
    ) -> Ask[Receipt]:
        """Narrows the intervals of a fluent or adds property values to it.

        Args:
            name: of the fluent.
            start: the narrower start; None leaves it.
            finish: the narrower finish; None leaves it.
            properties: statements to add.
            version: refuse unless the fluent is at this version.
            key: idempotency key; by default a new one.

        Raises:
            UnknownFluent, NotARefinement, VersionMismatch: as their classes say.
        """
        command = RefineFluent(name, start, finish, tuple(properties), version)
        return Ask(exchange.refinement(command, key), replies.receipt)

    @call
    def end(
        self,
        name: str,
        at: float | Interval | None = None,
        *,
        version: int | None = None,
        key: str | None = None,
    ) -> Ask[Receipt]:
        """Says when a fluent ceased to hold.

        Args:
            name: of the fluent.
            at: seconds, or the interval the end lies in; None is the board's present.
            version: refuse unless the fluent is at this version.
            key: idempotency key; by default a new one.

        Raises:
            UnknownFluent, NotARefinement, VersionMismatch: as their classes say.
        """
        return Ask(exchange.ending(name, at, version, key), replies.receipt)

    @call
    def batch(self, commands: Iterable[Command], *, key: str | None = None) -> Ask[Receipt]:
        """Carries out several commands, all of them or none."""
        return Ask(exchange.batch(commands, key), replies.receipt)

    @call
    def import_fluents(
        self,
        source: Path | Iterable[bytes],
        format: ImportFormat = "yaml",
        *,
        graph: str | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> Ask[dict[str, Any]]:
        """Streams a file of fluents, or of other people's knowledge, to the board.

        Args:
            source: a file, or pieces of one.
            format: `yaml`, `jsonl`, or a format of RDF.
            graph: IRI of the graph for what RDF says that is not about fluents, or `"default"`.
            progress: called with the number of bytes sent since the last call.

        Returns:
            The board's account of what was imported.

        Raises:
            InvalidYaml: or whatever the board finds wrong with the contents.
            InvalidInput: the file cannot be read.
        """
        pieces = file_pieces(source) if isinstance(source, Path) else source
        return Ask(exchange.importing(counted(pieces, progress), format, graph), replies.json_of)

    @call
    def fluent(self, name: str, *, as_of: int | None = None) -> Ask[Fluent]:
        """The fluent of that name, as it stands or as it stood after commit `as_of`.

        Raises:
            UnknownFluent: there is none.
        """
        return Ask(exchange.fluent(name, as_of), replies.fluent_of)

    @call
    def history(self, name: str) -> Ask[list[FluentChange]]:
        """Every change of a fluent, oldest first.

        Raises:
            UnknownFluent: there is none.
        """
        return Ask(exchange.history(name), replies.changes_of)

    @pages
    def fluents(
        self,
        class_name: str | None = None,
        *,
        at: Time | None = None,
        during: tuple[float, float] | None = None,
        certainly: bool = False,
        property_name: str | None = None,
        value: str | None = None,
        is_open: bool | None = None,
        as_of: int | None = None,
        page_size: int = 500,
    ) -> Pages[Fluent]:
        """The fluents that pass a filter; pages are fetched as the iteration goes.

        Args:
            class_name: of that class or a subclass of it.
            at: holding at that time, in seconds or `"now"`.
            during: holding at some time within the window.
            certainly: certainly and not only possibly so.
            property_name: having a value of that property.
            value: the value, as text.
            is_open: holding until further notice, or not.
            as_of: as the board was after that commit.
            page_size: fluents per request.
        """

        def page(cursor: str | None) -> Request:
            return exchange.listing(
                class_name=class_name,
                at=at,
                during=during,
                certainly=certainly,
                property_name=property_name,
                value=value,
                is_open=is_open,
                as_of=as_of,
                page_size=page_size,
                cursor=cursor,
            )

        return Pages(page, replies.page_of)

    @call
    def trajectory(
        self,
        name: str,
        *,
        at: Sequence[Time] = (),
        during: tuple[float, float] | None = None,
        as_of: int | None = None,
    ) -> Ask[Trajectory]:
        """Where an object was: its poses over time, the way it travelled, what is not known.

        Args:
            name: of the object.
            at: tell its position at these times as well, in seconds or `"now"`.
            during: only poses that it may have had at some moment of this window.
            as_of: as was believed after that commit.

        Raises:
            UnknownFluent: there is no such object.
        """
        request = trajectories.trajectory(name, at, during, as_of)
        return Ask(request, trajectories.trajectory_of)
