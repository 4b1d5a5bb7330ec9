"""The change feed: what each commit added to the board's statements and took away from them.

Whoever holds the statements as of one commit and carries out the changes of the commits after it
holds what the board says: the same default graph and the same named graphs.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import pyoxigraph as ox

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.declarations import quads_of
from fluentboard.board.events import Commit
from fluentboard.board.statement_layers import StatementLayers, Step
from fluentboard.board.store import HIDDEN_GRAPHS, in_hidden_graph
from fluentboard.board.triples import event_lines


@dataclass(frozen=True, slots=True)
class StatementChange:
    """What one commit changed.

    Attributes:
        commit: the commit.
        removed: statements in N-Quads syntax without the final dot; they go first.
        added: likewise.
    """

    commit: Commit
    removed: tuple[str, ...]
    added: tuple[str, ...]


class ChangeFeed:
    """The changes of consecutive commits. Used by one thread at a time.

    Args:
        board: whose commits.
        after: the feed begins with the commit after this one.
    """

    def __init__(self, board: Blackboard, after: int) -> None:
        self._board = board
        self._said = ox.Store()
        self._layers = StatementLayers(lambda quad: in_hidden_graph(quad) in self._said)
        self.commit = after
        """The last commit that the feed has told of."""
        for change in board.statements(after):
            self._remember(self._layers.step([change]))

    def up_to(self, last: int) -> Iterator[StatementChange]:
        """The changes of the commits that follow, up to and including a commit."""
        for commit in self._board.commits(self.commit, last):
            removed: dict[str, None] = {}
            added: dict[str, None] = {}
            step = self._layers.step(commit.statements)
            self._remember(step)
            for change in commit.statements:
                if change.graph:
                    removed.update(_texts(quads_of(change.removed, change.graph)))
            removed.update(_texts(step.removed))
            added.update(_texts(step.added))
            for event in commit.events:
                new, old = event_lines(event, self._layers.vocabulary)
                for lines, here, there in ((old, removed, added), (new, added, removed)):
                    for line in lines:
                        text = line.removesuffix(" .\n")
                        # Several commands of a commit may be about one fluent.
                        if there.pop(text, here) is here:
                            here[text] = None
            self.commit = commit.number
            yield StatementChange(commit, tuple(removed), tuple(added))

    def _remember(self, step: Step) -> None:
        for quad in step.removed:
            if quad.graph_name in HIDDEN_GRAPHS:
                self._said.remove(quad)
        self._said.extend(quad for quad in step.added if quad.graph_name in HIDDEN_GRAPHS)


def _texts(quads: Iterable[ox.Quad]) -> dict[str, None]:
    return dict.fromkeys(str(quad) for quad in quads if quad.graph_name not in HIDDEN_GRAPHS)


def statements_said(board: Blackboard, commit: int) -> ox.Store:
    """What updates had said by a commit, in the default graph and in named graphs."""
    said = ox.Store()
    for change in board.statements(commit):
        if not change.ontology:
            for quad in quads_of(change.removed, change.graph):
                said.remove(quad)
            said.extend(quads_of(change.added, change.graph))
            if change.graph_event == "created":
                said.add_graph(ox.NamedNode(change.graph))
            elif change.graph_event == "dropped":
                said.remove_graph(ox.NamedNode(change.graph))
    return said


def patch_text(change: StatementChange) -> str:
    """The change as a transaction of RDF Patch."""
    commit = change.commit
    author = " ".join(commit.author.split())
    lines = [f"# commit {commit.number} by {author} at {commit.wall_s!r}", "TX ."]
    lines += [f"D {statement} ." for statement in change.removed]
    lines += [f"A {statement} ." for statement in change.added]
    return "\n".join([*lines, "TC .", ""])
