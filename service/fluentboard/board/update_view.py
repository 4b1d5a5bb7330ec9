"""What a query sees in the middle of an update: the store with what is pending on top.

Oxigraph has no transactions for Python to hold open. The part of the store that the query can
depend on is copied into memory, and changed there; mostly this is little. For a query that may look
at everything, everything is copied.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import islice

import pyoxigraph as ox

from fluentboard.board.pending_statements import PendingStatements
from fluentboard.board.query_reach import Reach
from fluentboard.board.rdf_store import RdfStore
from fluentboard.board.store import GraphName
from fluentboard.board.update_operations import Modify

_FEW = 20_000
_EVERYTHING = Reach(frozenset({(None, None, None)}), looks_outside_graphs=True, names_dataset=False)


def view_for(
    operation: Modify,
    store: RdfStore,
    pending: PendingStatements,
    is_said_otherwise: Callable[[ox.Quad], bool],
) -> ox.Store:
    """A store in which the operation's query has the answer that it would have by now.

    Args:
        operation: what is to be evaluated.
        store: what is committed.
        pending: the changes on top of it.
        is_said_otherwise: whether an ontology, too, says a statement of the default graph.
    """
    reach = operation.reach or _EVERYTHING
    view = ox.Store()
    for graph in _graphs(operation, reach, pending):
        for pattern in reach.patterns:
            _copy(store.matching(*pattern, graph), view)
    for quad in pending.removed:
        is_default = isinstance(quad.graph_name, ox.DefaultGraph)
        if not (is_default and is_said_otherwise(quad)):
            view.remove(quad)
    view.extend(pending.added)
    for graph in pending.named_graphs():
        view.add_graph(graph)
    return view


def _copy(quads: Iterator[ox.Quad], view: ox.Store) -> None:
    few = list(islice(quads, _FEW))
    view.extend(few)
    if len(few) == _FEW:
        # Quicker from here on, but it takes 200 MB of address space whatever it loads.
        view.bulk_extend(quads)


def _graphs(operation: Modify, reach: Reach, pending: PendingStatements) -> Iterator[GraphName]:
    """The stored graphs that the query can look at."""
    yield from pending.named_graphs()
    replaces_default = operation.default_graphs is not None or reach.names_dataset
    if reach.looks_outside_graphs and not replaces_default:
        yield ox.DefaultGraph()
