"""Audit: who changed what and when, commit by commit, straight from the journal."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class AuditFilter:
    """Which commits are asked for.

    Attributes:
        after: only commits after this one.
        up_to: only commits up to this one; None for all.
        author: only commits of this author; None for all.
        name: only commits that changed this fluent; None for all.
        forced: only commits with a reason: corrections that an admin forced.
    """

    after: int = 0
    up_to: int | None = None
    author: str | None = None
    name: str | None = None
    forced: bool = False


@dataclass(slots=True)
class AuditEntry:
    """One commit.

    Attributes:
        commit: its number.
        wall_s: when it was made, in seconds since the Unix epoch.
        author: who asked for it: the name of the token, or what the client called itself.
        reason: why, where an admin forced it.
        idempotency_key: of the request, or None.
        fluents: what happened to which: event, name and class.
        statements: what changed outside fluents: graph, ontology, and how many came and went.
    """

    commit: int
    wall_s: float
    author: str
    reason: str
    idempotency_key: str | None
    fluents: list[dict[str, str]] = field(default_factory=list[dict[str, str]])
    statements: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])

    def to_json(self) -> dict[str, Any]:
        """The entry as the service sends it."""
        return {
            "commit": self.commit,
            "wall_s": self.wall_s,
            "author": self.author,
            "reason": self.reason,
            "idempotency_key": self.idempotency_key,
            "fluents": self.fluents,
            "statements": self.statements,
        }


def audit_query(wanted: AuditFilter, limit: int) -> tuple[str, list[Any]]:
    """SQL for the commits that pass a filter, with its parameters (pure)."""
    terms, values = ["number > ?"], [wanted.after]
    more: list[tuple[str, Any]] = [
        ("number <= ?", wanted.up_to),
        ("author = ?", wanted.author),
        (
            "number IN (SELECT commit_number FROM changes WHERE name = ?)",
            wanted.name,
        ),
    ]
    all_values: list[Any] = list(values)
    for term, value in more:
        if value is not None:
            terms.append(term)
            all_values.append(value)
    if wanted.forced:
        terms.append("reason <> ''")
    sql = (
        "SELECT number, wall_s, author, reason, idempotency_key FROM commits "
        f"WHERE {' AND '.join(terms)} ORDER BY number LIMIT ?"
    )
    return sql, [*all_values, limit]
