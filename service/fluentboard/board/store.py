"""The RDF store, a projection: SPARQL over fluents, ontologies and other statements.

The embedded store is Oxigraph on RocksDB. One process owns its folder; everybody else speaks HTTP.
"""

from __future__ import annotations

import logging
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import pyoxigraph as ox

from fluentboard.board.oxigraph_query import GraphName as GraphName
from fluentboard.board.oxigraph_query import QueryResults as QueryResults
from fluentboard.board.oxigraph_query import ask
from fluentboard.board.rdf_store import RdfStore
from fluentboard.board.statement_script import StatementScript
from fluentboard.errors import StorageFailed
from fluentboard_ontology import FB

META = ox.NamedNode(FB + "meta")
"""Hidden graph: which commit the store is at."""
SAID = ox.NamedNode(FB + "said")
"""Hidden graph: what updates have said in the default graph, besides what ontologies say."""
HIDDEN_GRAPHS = frozenset({META, SAID})
"""The board's own notes; no query sees them unless it names them."""
_APPLIED = ox.NamedNode(FB + "appliedCommit")
_STATE = ox.NamedNode(FB + "state")
_INTEGER = ox.NamedNode("http://www.w3.org/2001/XMLSchema#integer")


# Without as much room on its disk, a store that could not be written is not opened again.
_ROOM_BYTES = 8 * 2**20

logger = logging.getLogger(__name__)


def in_hidden_graph(quad: ox.Quad) -> ox.Quad:
    """A statement of the default graph as the hidden graph has it."""
    return ox.Quad(quad.subject, quad.predicate, quad.object, SAID)


class EmbeddedStore(RdfStore):
    """Oxigraph in this process.

    Reads see whole groups of commits: each `apply` is one transaction, and every query runs on the
    snapshot taken when it starts.

    Args:
        folder: where RocksDB keeps its files, or None for memory.
        applied: a commit that the store has at least, where that is known better than it is noted.

    Raises:
        StorageFailed: the folder is in use by another process, or damaged.
    """

    def __init__(self, folder: Path | None, *, applied: int | None = None) -> None:
        super().__init__()
        self._folder = folder
        self._database: ox.Store | None = _opened(folder)
        self._is_broken = False
        self._applied = self._marked() if applied is None else applied

    @property
    def _store(self) -> ox.Store:
        if self._database is None:
            raise StorageFailed(
                "the RDF store is closed, because its disk was full or broken; it is opened again "
                "as soon as that can be done"
            )
        return self._database

    @property
    def may_be_ahead(self) -> bool:
        """A process that did not fsync its journal stopped without closing the store.

        After a loss of power the store may then hold statements that the journal has lost.
        """
        marks = [q.object for q in self._store.quads_for_pattern(None, _STATE, None, META)]
        return any(isinstance(mark, ox.Literal) and mark.value == "process" for mark in marks)

    def __len__(self) -> int:
        return len(self._store)

    def apply(self, added: str, removed: str, commit: int) -> None:
        """Adds and removes statements of the default graph in one transaction.

        Args:
            added: N-Triples text without blank nodes.
            removed: N-Triples text without blank nodes.
            commit: number of the last commit that this brings the store to.

        Raises:
            StorageFailed: the disk is full or broken; the transaction left no trace.
        """
        with self._applying:
            self._sequence += 1
            try:
                self._revive()
                if removed:
                    self._store.update(f"DELETE DATA {{ {removed} }} ; INSERT DATA {{ {added} }}")
                elif added:
                    self._store.load(added.encode(), format=ox.RdfFormat.N_TRIPLES)
                self._applied = commit
            except OSError as problem:
                self._is_broken = True
                raise StorageFailed(f"the RDF store cannot be written: {problem}") from None
            finally:
                self._sequence += 1

    def apply_statements(
        self,
        added: Iterable[ox.Quad],
        removed: Iterable[ox.Quad],
        commit: int,
        *,
        created: Iterable[ox.NamedNode] = (),
        dropped: Iterable[ox.NamedNode] = (),
    ) -> None:
        """Removes and then adds quads; unlike `apply` it keeps the names of blank nodes.

        Args:
            added: statements.
            removed: statements.
            commit: number of the last commit that this brings the store to.
            created: named graphs that are there afterwards, even if they are empty.
            dropped: named graphs that go, with their statements.

        Raises:
            StorageFailed: the disk is full or broken; the transaction left no trace.
        """
        added, script = list(added), StatementScript()
        for graph in dropped:
            script.drop(graph)
        for quad in removed:
            script.remove(quad)
        is_plain = script.is_empty
        for graph in created:
            script.create(graph)
            is_plain = False
        with self._applying:
            self._sequence += 1
            try:
                self._revive()
                if is_plain:
                    self._store.extend(added)
                else:
                    for quad in added:
                        script.add(quad)
                    script.run(self._store)
                self._applied = commit
            except OSError as problem:
                self._is_broken = True
                raise StorageFailed(f"the RDF store cannot be written: {problem}") from None
            finally:
                self._sequence += 1

    def bulk_load(self, lines: Sequence[str]) -> None:
        """Adds many N-Triples lines to the default graph, fast and without a transaction."""
        self._store.bulk_load("".join(lines).encode(), format=ox.RdfFormat.N_TRIPLES)

    def clear(self) -> None:
        """Removes everything; used before a rebuild."""
        self._store.clear()
        self._applied = 0

    def mark(self, *, state: str) -> None:
        """Notes durably which commit the store is at.

        Args:
            state: durability of the journal while a process writes, "closed" after it stopped.
        """
        old = list(self._store.quads_for_pattern(None, None, None, META))
        mark = [
            ox.Quad(META, _APPLIED, ox.Literal(str(self._applied), datatype=_INTEGER), META),
            ox.Quad(META, _STATE, ox.Literal(state), META),
        ]
        # First add, then remove: a crash in between leaves two marks, and the lower one counts.
        self._store.extend(mark)
        for quad in old:
            if quad not in mark:
                self._store.remove(quad)

    def query(
        self,
        sparql: str,
        default_graphs: Sequence[GraphName] | None = None,
        named_graphs: Sequence[ox.NamedNode | ox.BlankNode] | None = None,
        **extra: Any,
    ) -> QueryResults:
        """The results of a query on the snapshot of this moment.

        Args:
            sparql: SPARQL 1.1 text; well-known prefixes need no declaration.
            default_graphs: merged into the default graph; by default the store's own.
            named_graphs: what `GRAPH` sees; by default all but the board's own notes.
            extra: passed to Oxigraph (substitutions, custom_functions).

        Raises:
            InvalidQuery: it does not parse, or cannot be evaluated.
        """
        return ask(self._store, sparql, default_graphs, named_graphs, self.named_graphs, **extra)

    def point_query(
        self, sparql: str, prefixes: Mapping[str, str]
    ) -> tuple[int, QueryResults] | None:
        """The results of a query that needs no repair, with the commit that they are exact at.

        None if it does not parse, or a commit came in between.

        Args:
            sparql: patterns about one constant subject, and nothing else.
            prefixes: that it may use without a declaration.
        """
        sequence, commit = self._sequence, self._applied
        if sequence % 2:
            return None
        try:
            results = self._store.query(sparql, prefixes=dict(prefixes))
        except (SyntaxError, ValueError, OSError, RuntimeError):
            return None
        return (commit, results) if self._sequence == sequence else None

    def subjects(
        self, predicate: str, value: ox.NamedNode | ox.Literal | None = None, *, limit: int
    ) -> list[str]:
        """IRIs of at most `limit` subjects with that value, or any, in the default graph."""
        pattern = (None, ox.NamedNode(predicate), value, ox.DefaultGraph())
        return [
            quad.subject.value
            for quad in islice(self._store.quads_for_pattern(*pattern), limit)
            if isinstance(quad.subject, ox.NamedNode)
        ]

    def named_graphs(self) -> list[ox.NamedNode]:
        """The named graphs, the board's own notes left out."""
        return [
            graph
            for graph in self._store.named_graphs()
            if isinstance(graph, ox.NamedNode) and graph not in HIDDEN_GRAPHS
        ]

    def has_graph(self, graph: ox.NamedNode) -> bool:
        """There is a named graph of that name, if only an empty one."""
        return self._store.contains_named_graph(graph)

    def __contains__(self, quad: ox.Quad) -> bool:
        return quad in self._store

    def says(self, quad: ox.Quad) -> bool:
        """An update has said this statement of the default graph, and none has unsaid it."""
        return in_hidden_graph(quad) in self._store

    def matching(
        self,
        subject: ox.NamedNode | ox.BlankNode | None,
        predicate: ox.NamedNode | None,
        target: ox.NamedNode | ox.BlankNode | ox.Literal | ox.Triple | None,
        graph: GraphName | None,
    ) -> Iterator[ox.Quad]:
        """The statements that match, as they are at this moment; None matches any term."""
        return self._store.quads_for_pattern(subject, predicate, target, graph)

    def about(self, iri: str) -> list[ox.Quad]:
        """All statements of the default graph with that subject, at this moment."""
        pattern = (ox.NamedNode(iri), None, None, ox.DefaultGraph())
        return list(self._store.quads_for_pattern(*pattern))

    def bulk_extend(self, quads: Iterable[ox.Quad]) -> None:
        """Adds many quads, fast and without a transaction."""
        self._store.bulk_extend(quads)

    def checkpoint(self, folder: Path) -> int:
        """Makes a store of its own in a folder, with what this one has now.

        RocksDB's files never change once written, so they are linked rather than copied where the
        folder is on the same file system: it takes a fraction of a second whatever the size.

        Args:
            folder: must not exist.

        Returns:
            Number of a commit that the copy surely has; to apply later ones again does no harm.

        Raises:
            StorageFailed: the disk is full or broken.
        """
        applied = self._applied
        try:
            folder.parent.mkdir(parents=True, exist_ok=True)
            self._store.backup(str(folder))
        except OSError as problem:
            raise StorageFailed(
                f"cannot make a checkpoint of the RDF store in {folder}: {problem}"
            ) from None
        return applied

    def everything(self) -> Iterator[ox.Quad]:
        """All statements of all graphs, the board's own notes too, at this moment."""
        return iter(self._store)

    def compact(self) -> None:
        """Rewrites the files without what was removed; takes a while."""
        self._store.optimize()

    def flush(self) -> None:
        """Writes memory tables to disk."""
        self._store.flush()

    def let_go(self) -> None:
        """Lets go of the files without leaving a mark."""
        self._store.flush()
        self._database = None

    def close(self) -> None:
        """Marks the store as closed in order and lets go of its files."""
        try:
            self.mark(state="closed")
            self._store.flush()
        except (OSError, StorageFailed) as problem:
            logger.warning("the RDF store is not closed in order: %s", problem)
        self._database = None

    def _revive(self) -> None:
        """Opens the files anew once they could not be written: RocksDB does not go on by itself."""
        if not self._is_broken or self._folder is None:
            return
        if shutil.disk_usage(self._folder).free < _ROOM_BYTES:
            raise OSError(f"less than {_ROOM_BYTES:,} bytes are free in {self._folder}")
        # Results that somebody still reads keep them open; then the next attempt succeeds.
        self._database = None
        self._database = _opened(self._folder)
        self._is_broken = False

    def _marked(self) -> int:
        marks = [
            int(quad.object.value)
            for quad in self._store.quads_for_pattern(None, _APPLIED, None, META)
            if isinstance(quad.object, ox.Literal)
        ]
        return min(marks, default=0)


def _opened(folder: Path | None) -> ox.Store:
    try:
        return ox.Store() if folder is None else ox.Store(str(folder))
    except OSError as problem:
        raise StorageFailed(
            f"cannot open the RDF store in {folder}: {problem}. If another fluentboard uses it, "
            "stop that one; if the files are damaged, delete the folder and start again: it is "
            "rebuilt from the journal"
        ) from None
