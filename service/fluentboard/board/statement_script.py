"""Statement script: many changes of a store as one update, so that readers see all or none."""

from __future__ import annotations

from collections.abc import Iterable

import pyoxigraph as ox

from fluentboard_ontology import FB

_BLANK = ox.NamedNode(FB + "blank")


class StatementScript:
    """Removals, then additions, in one transaction.

    SPARQL Update has no way to name a blank node that is in the store already. An extension
    function gives it one: what has blank nodes is removed and added by `DELETE` and `INSERT` over
    a table of names, from which the function makes the nodes.
    """

    def __init__(self) -> None:
        self._dropped: list[str] = []
        self._created: list[str] = []
        self._removed: dict[str, list[str]] = {}
        self._added: dict[str, list[str]] = {}
        self._rows: dict[tuple[str, str], list[str]] = {}
        self._nested: list[tuple[str, ox.Quad]] = []

    @property
    def is_empty(self) -> bool:
        """Nothing is to be done."""
        parts = (self._dropped, self._created, self._removed, self._added, self._rows)
        return not any(parts) and not self._nested

    def drop(self, graph: ox.NamedNode) -> None:
        """Removes a named graph and all that it says."""
        self._dropped.append(str(graph))

    def create(self, graph: ox.NamedNode) -> None:
        """Makes a named graph, if only an empty one."""
        self._created.append(str(graph))

    def remove(self, quad: ox.Quad) -> None:
        """Removes a statement."""
        self._put("DELETE", self._removed, quad)

    def add(self, quad: ox.Quad) -> None:
        """Adds a statement."""
        self._put("INSERT", self._added, quad)

    def run(self, store: ox.Store) -> None:
        """Carries everything out.

        Raises:
            OSError: the store cannot be written.
        """
        steps = [f"DROP SILENT GRAPH {graph}" for graph in self._dropped]
        steps += [f"CREATE SILENT GRAPH {graph}" for graph in self._created]
        steps += self._with_blank_nodes("DELETE")
        if self._removed:
            steps.append(f"DELETE DATA {{ {_grouped(self._removed)} }}")
        if self._added:
            steps.append(f"INSERT DATA {{ {_grouped(self._added)} }}")
        steps += self._with_blank_nodes("INSERT")
        store.update(" ;\n".join(steps), custom_functions={_BLANK: _blank_node})
        # Blank nodes inside triple terms are beyond the table; nobody is known to use them.
        for kind, quad in self._nested:
            (store.remove if kind == "DELETE" else store.add)(quad)

    def _put(self, kind: str, ground: dict[str, list[str]], quad: ox.Quad) -> None:
        graph = "" if isinstance(quad.graph_name, ox.DefaultGraph) else str(quad.graph_name)
        ends = (quad.subject, quad.object)
        if any(isinstance(end, ox.Triple) and "_:" in str(end) for end in ends):
            self._nested.append((kind, quad))
        elif any(isinstance(end, ox.BlankNode) for end in ends):
            subject, target = (_columns(end) for end in ends)
            self._rows.setdefault((kind, graph), []).append(
                f"({subject} {quad.predicate} {target})"
            )
        else:
            ground.setdefault(graph, []).append(f"{quad.triple} .\n")

    def _with_blank_nodes(self, kind: str) -> Iterable[str]:
        for (of_kind, graph), rows in self._rows.items():
            if of_kind == kind:
                template = f"GRAPH {graph} {{ ?s ?p ?o }}" if graph else "?s ?p ?o"
                yield (
                    f"{kind} {{ {template} }} WHERE {{ VALUES (?sn ?sb ?p ?on ?ob) {{ "
                    + "\n".join(rows)
                    + f" }} BIND(IF(BOUND(?sb), {_BLANK}(?sb), ?sn) AS ?s) "
                    f"BIND(IF(BOUND(?ob), {_BLANK}(?ob), ?on) AS ?o) }}"
                )


def _columns(term: object) -> str:
    """A term as two cells: the term itself, and the name of a blank node."""
    return f'UNDEF "{term.value}"' if isinstance(term, ox.BlankNode) else f"{term} UNDEF"


def _grouped(statements: dict[str, list[str]]) -> str:
    return "".join(
        f"GRAPH {graph} {{ {''.join(lines)} }}\n" if graph else "".join(lines)
        for graph, lines in statements.items()
    )


def _blank_node(name: object) -> ox.BlankNode | None:
    return ox.BlankNode(name.value) if isinstance(name, ox.Literal) else None
