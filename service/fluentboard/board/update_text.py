"""Update requests as text: cut into operations, and checked by Oxigraph's parser."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import pyoxigraph as ox

from fluentboard.board.sparql_tokens import Token, tokens_of
from fluentboard.errors import InvalidQuery
from fluentboard_ontology import PREFIXES

_NOTHING = "urn:x-fluentboard:nothing"
_PREFIXES = dict(PREFIXES)
_POSITION = re.compile(r"error at (\d+):(\d+)")


@dataclass(frozen=True, slots=True)
class OperationText:
    """One operation of a request.

    Attributes:
        prologue: the declarations that hold for it.
        tokens: of the operation itself.
    """

    prologue: str
    tokens: tuple[Token, ...]


def operations_in(text: str, base_iri: str | None) -> list[OperationText]:
    """The operations of a request, in order.

    Raises:
        InvalidQuery: it does not parse; the message says where.
    """
    found: list[OperationText] = []
    declared: list[Token] = []
    later: list[Token] = []
    for segment in _segments(tokens_of(text)):
        prologue, operation = _without_prologue(segment)
        later += prologue if found else ()
        declared += prologue
        found.append(OperationText(_declarations(text, declared), tuple(operation)))
    if _is_consistent(declared, later):
        first = found[0].tokens
        begin = first[0].start if first else len(text)
        _check(text, begin, later, base_iri)
    else:
        for part in found:
            _check_alone(text, part, base_iri)
    return [part for part in found if part.tokens]


def _segments(tokens: Sequence[Token]) -> list[list[Token]]:
    """What stands between the semicolons that separate operations."""
    found: list[list[Token]] = [[]]
    depth = 0
    for token in tokens:
        if token.text == ";" and depth == 0:
            found.append([])
            continue
        depth += {"{": 1, "}": -1}.get(token.text, 0)
        found[-1].append(token)
    return found


def _without_prologue(segment: list[Token]) -> tuple[list[Token], list[Token]]:
    here = 0
    while here < len(segment) and segment[here].is_word("PREFIX", "BASE", "VERSION"):
        here += 3 if segment[here].is_word("PREFIX") else 2
    return segment[:here], segment[here:]


def _declarations(text: str, tokens: Sequence[Token]) -> str:
    return "".join(f"{text[token.start : token.end]} " for token in tokens)


def _is_consistent(declared: list[Token], later: list[Token]) -> bool:
    """All declarations can stand together at the front, as Oxigraph's parser wants them."""
    if any(token.is_word("BASE", "VERSION") for token in later):
        return False
    meaning: dict[str, str] = {}
    for word, name, target in zip(declared, declared[1:], declared[2:], strict=False):
        if word.is_word("PREFIX") and meaning.setdefault(name.text, target.text) != target.text:
            return not later
    return True


def _check(text: str, begin: int, hoisted: Sequence[Token], base_iri: str | None) -> None:
    """Has Oxigraph parse a request without carrying any of it out.

    Args:
        text: the request.
        begin: where its first operation begins.
        hoisted: declarations further back, which its parser does not understand there.
        base_iri: what relative IRIs are relative to.
    """
    rest = list(text[begin:])
    for token in hoisted:
        for place in range(token.start - begin, token.end - begin):
            if rest[place] not in "\r\n":
                rest[place] = " "
    _parse(text[:begin], _declarations(text, hoisted), "".join(rest), base_iri)


def _check_alone(text: str, part: OperationText, base_iri: str | None) -> None:
    """Has Oxigraph parse one operation, with the lines and columns of the whole request."""
    begin = part.tokens[0].start if part.tokens else len(text)
    end = part.tokens[-1].end if part.tokens else len(text)
    before = re.sub(r"[^\r\n]", " ", text[:begin])
    _parse(before, part.prologue, text[begin:end], base_iri)


def _parse(before: str, inserted: str, after: str, base_iri: str | None) -> None:
    if not after:
        before += "\n"  # it may end in a comment, which must not swallow the guard
    # Parsed as a whole first; then the first operation fails, and nothing else is done.
    guard = f"{inserted}DROP GRAPH <{_NOTHING}> ;\n"
    try:
        ox.Store().update(before + guard + after, base_iri=base_iri, prefixes=_PREFIXES)
    except SyntaxError as problem:
        line = before.count("\n") + 1
        column = len(before) - (before.rfind("\n") + 1) + 1

        def as_sent(match: re.Match[str]) -> str:
            at_line, at_column = int(match[1]), int(match[2])
            if at_line == line and at_column >= column:
                at_column = column
            elif at_line > line:
                at_line -= 1
                at_column += column - 1 if at_line == line else 0
            return f"error at {at_line}:{at_column}"

        message = _POSITION.sub(as_sent, str(problem))
        raise InvalidQuery(f"the update does not parse: {message}") from None
    except (RuntimeError, OSError):
        return
    except ValueError as problem:
        raise InvalidQuery(f"the update does not parse: {problem}") from None
    raise AssertionError("an update that drops a graph that is not there went through")
