"""What the parameters of the RDF4J protocol stand for: terms, contexts, namespaces (pure)."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import pyoxigraph as ox

from fluentboard.api import parameters
from fluentboard.api.exchange import Call
from fluentboard.board.update_operations import Graph, Term
from fluentboard.errors import InvalidInput, UnknownResource

REPOSITORY = "fluentboard"
"""Identifier of the one repository."""

_CONTEXT = re.compile(r"\s*(?:(null)|<([^<>\s]*)>)\s*(?:,|$)")
_NODE = "urn:x-fluentboard:node"
_DEFAULT = ox.DefaultGraph()

Values = Mapping[str, Sequence[str]]


def check_repository(call: Call) -> None:
    """Refuses a repository that is not there.

    Raises:
        UnknownResource: there is none of that name.
    """
    name = call.arguments["repository"]
    if name != REPOSITORY:
        raise UnknownResource(
            f"there is no repository {name!r}; the board is {REPOSITORY!r}", repository=name
        )


def term(values: Values, name: str) -> Term | None:
    """The term that a parameter gives in Turtle syntax; None if it is not there.

    Raises:
        InvalidInput: it is no term.
    """
    text = parameters.text(values, name)
    if text is None:
        return None
    document = f"<{_NODE}> <{_NODE}> {text} ."
    try:
        quads = list(ox.parse(document, format=ox.RdfFormat.TURTLE))
    except (SyntaxError, ValueError):
        quads = []
    if len(quads) != 1 or quads[0].subject != ox.NamedNode(_NODE):
        raise InvalidInput(
            f'the parameter {name} is {text!r}; give one term such as <urn:a> or "text"@en',
            parameter=name,
        )
    return quads[0].object


def subject(values: Values) -> ox.NamedNode | ox.BlankNode | None:
    """The value of `subj`.

    Raises:
        InvalidInput: it is no IRI and no blank node.
    """
    found = term(values, "subj")
    if found is None or isinstance(found, ox.NamedNode | ox.BlankNode):
        return found
    raise InvalidInput(f"the parameter subj is {found}; give an IRI", parameter="subj")


def predicate(values: Values) -> ox.NamedNode | None:
    """The value of `pred`.

    Raises:
        InvalidInput: it is no IRI.
    """
    found = term(values, "pred")
    if found is None or isinstance(found, ox.NamedNode):
        return found
    raise InvalidInput(f"the parameter pred is {found}; give an IRI", parameter="pred")


def contexts(values: Values) -> tuple[Graph, ...]:
    """The graphs that `context` names; `null` is the default graph, and none of them all.

    Raises:
        InvalidInput: one is no IRI.
    """
    found: list[Graph] = []
    for text in values.get("context", ()):
        here = 0
        while here < len(text):
            match = _CONTEXT.match(text, here)
            if match is None:
                raise InvalidInput(
                    f"the context is {text!r}; give null or an IRI in angle brackets",
                    parameter="context",
                )
            found.append(_DEFAULT if match[1] else _named(match[2]))
            here = match.end()
    return tuple(dict.fromkeys(found))


def base_iri(values: Values, otherwise: str) -> str:
    """What relative IRIs in a body are relative to.

    Raises:
        InvalidInput: `baseURI` is no IRI.
    """
    text = parameters.text(values, "baseURI")
    return otherwise if text is None else _named(text.strip().strip("<>")).value


def _named(iri: str) -> ox.NamedNode:
    try:
        return ox.NamedNode(iri)
    except ValueError as problem:
        raise InvalidInput(f"{iri!r} is no IRI: {problem}") from None
