"""Short names: what is said of a fluent, in the names that the board keeps (pure)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from fluentboard.board.commands import (
    AssertFluent,
    Command,
    CorrectFluent,
    RefineFluent,
    name_of,
)
from fluentboard.board.triples import ENDPOINTS
from fluentboard.board.vocabulary import (
    PROPER_SUB_CLASS_OF,
    RDF_TYPE,
    SUB_CLASS_OF_OR_SAME,
    Vocabulary,
)
from fluentboard.errors import InvalidName
from fluentboard.model.fluent import Property

_RESERVED = frozenset(
    {
        *(iri.rpartition("#")[2] for iri in ENDPOINTS),
        RDF_TYPE,
        PROPER_SUB_CLASS_OF,
        SUB_CLASS_OF_OR_SAME,
    }
)
"""Properties that the board derives, as `Vocabulary.property_name` names them."""


def in_short_names(command: Command, vocabulary: Vocabulary) -> Command:
    """The command in the short names that the board keeps.

    Raises:
        UnknownClass: no ontology declares a class that it names.
        InvalidName: it states a property that the board states itself.
    """
    if isinstance(command, AssertFluent | CorrectFluent):
        fluent = command.fluent
        class_name = vocabulary.class_name(fluent.class_name)
        properties = _in_short_names(fluent.properties, vocabulary)
        if class_name == fluent.class_name and properties is fluent.properties:
            return command
        return replace(
            command, fluent=replace(fluent, class_name=class_name, properties=properties)
        )
    if isinstance(command, RefineFluent) and command.properties:
        return replace(command, properties=_in_short_names(command.properties, vocabulary))
    return command


def check_property(name: str, as_written: str) -> None:
    """Refuses a property that is not a writer's to state.

    Args:
        name: as `Vocabulary.property_name` gives it.
        as_written: as the writer has it.

    Raises:
        InvalidName: the board states it itself.
    """
    if name in _RESERVED:
        raise InvalidName(
            f"{as_written!r} cannot be a property of a fluent: the board states it "
            "itself. The class and the interval of a fluent have fields of their own",
            name=as_written,
        )


def remarks_on(
    commands: Sequence[Command], vocabulary: Vocabulary, is_there: Callable[[str], bool]
) -> list[str]:
    """What is allowed but perhaps not meant: undeclared properties, dangling references.

    Args:
        commands: of one batch.
        vocabulary: what the ontologies declare.
        is_there: whether the board has a fluent of a name.
    """
    new = {name_of(command) for command in commands}
    found: dict[str, None] = {}
    for command in commands:
        for statement in _properties(command):
            if not vocabulary.declares_property(statement.name):
                found[f"property {statement.name!r} is in no loaded ontology"] = None
            target = str(statement.value)
            if statement.is_reference and target not in new and not is_there(target):
                found[f"{name_of(command)!r} refers to {target!r}, which is not on the board"] = (
                    None
                )
    return list(found)


def _properties(command: Command) -> tuple[Property, ...]:
    if isinstance(command, AssertFluent | CorrectFluent):
        return command.fluent.properties
    return command.properties if isinstance(command, RefineFluent) else ()


def _in_short_names(
    properties: tuple[Property, ...], vocabulary: Vocabulary
) -> tuple[Property, ...]:
    changed = False
    normal: list[Property] = []
    for statement in properties:
        kind = vocabulary.class_name(statement.type) if statement.is_reference else statement.type
        name = vocabulary.property_name(statement.name)
        check_property(name, statement.name)
        if kind != statement.type or name != statement.name:
            changed = True
            statement = Property(name, kind, statement.value)
        normal.append(statement)
    return tuple(normal) if changed else properties
