"""Python clients of the board, synchronous and asynchronous.

from fluentboard_client import Client

with Client("http://127.0.0.1:8080") as board:
    for change in board.subscribe("SELECT ?table WHERE { ?table a furniture:Table }"):
        print(change)
"""

from fluentboard_client.async_client import AsyncClient
from fluentboard_client.client import Client
from fluentboard_client.commands import AssertFluent, Command, EndFluent, RefineFluent
from fluentboard_client.conversation import Delta, Event, Gap, Lagged, Snapshot
from fluentboard_client.frames import FrameClient, ReceivedFrame
from fluentboard_client.replies import FluentChange, Receipt
from fluentboard_client.results import BlankNode, Iri, Row, Term, row_text, term_text
from fluentboard_client.trajectories import PoseAt, PoseGap, PoseHeld, Trajectory

__all__ = [
    "AssertFluent",
    "AsyncClient",
    "BlankNode",
    "Client",
    "Command",
    "Delta",
    "EndFluent",
    "Event",
    "FluentChange",
    "FrameClient",
    "Gap",
    "Iri",
    "Lagged",
    "PoseAt",
    "PoseGap",
    "PoseHeld",
    "Receipt",
    "ReceivedFrame",
    "RefineFluent",
    "Row",
    "Snapshot",
    "Term",
    "Trajectory",
    "row_text",
    "term_text",
]
