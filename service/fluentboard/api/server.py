"""Server: opens the board, listens, and stops in order when asked to."""

from __future__ import annotations

import asyncio
import gc
import logging
import signal
import socket
import sys
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager

import uvicorn

from fluentboard.api.app import BoardApp, create_app
from fluentboard.api.at_once import AtOnceProtocol
from fluentboard.api.security import check_exposure
from fluentboard.board.blackboard import Blackboard
from fluentboard.board.endpoint import Endpoint
from fluentboard.config import ServerSettings, Settings
from fluentboard.errors import InvalidConfiguration

logger = logging.getLogger(__name__)

# The event loop shares the interpreter with the writer and the queries. By default a thread that
# computes is left alone for 5 ms, as long as fifty requests take.
_SWITCH_INTERVAL_S = 0.0005

# What a board keeps in memory is no garbage, and there is much of it: looking through it every few
# hundred allocations would hold up requests.
_GARBAGE_THRESHOLDS = (50_000, 20, 100)

_STOPPING_SIGNALS = (signal.SIGINT, signal.SIGTERM)


def serve(settings: Settings, announce: Callable[[str], None] | None = None) -> None:
    """Serves a board until SIGTERM or SIGINT; everything is closed in order when this returns.

    Args:
        settings: of the service, including where the board keeps its data.
        announce: called with the address, such as `http://127.0.0.1:8080`, once requests are
            answered. With port 0 this is how to learn the port.

    Raises:
        InvalidConfiguration: the address is taken, or may not be listened on without a token.
        StorageFailed: the data folder is in use, damaged or not writable.
        InvalidOntology: an ontology does not load.
    """
    check_exposure(settings)
    # First the address: opening a large board takes a while, and would be in vain.
    listener = listening_socket(settings.server)
    try:
        storage = settings.storage
        endpoint = None
        if storage.store is not None:
            timeout_s = settings.limits.query_timeout_s
            endpoint = Endpoint(storage.store, storage.store_update, timeout_s)
        with Blackboard.open(
            storage.data,
            durability=storage.durability,
            ontologies=storage.ontologies,
            builtin_ontologies=storage.builtin_ontologies,
            endpoint=endpoint,
            shapes=storage.shapes,
        ) as board:
            run(board, settings, listener, announce)
    finally:
        listener.close()


def run(
    board: Blackboard,
    settings: Settings,
    listener: socket.socket,
    announce: Callable[[str], None] | None = None,
) -> None:
    """Serves an open board on an open socket until SIGTERM or SIGINT; closes neither."""
    app = create_app(board, settings)
    server = Server(app, settings, lambda: announce and announce(address(listener)))
    interval_s = sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    thresholds = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(*_GARBAGE_THRESHOLDS)
    try:
        with _signals_seen_once():
            server.run(sockets=[listener])
    finally:
        sys.setswitchinterval(interval_s)
        gc.set_threshold(*thresholds)
        gc.unfreeze()


def listening_socket(settings: ServerSettings) -> socket.socket:
    """A socket bound to the address of the settings; with port 0 to any free port.

    Raises:
        InvalidConfiguration: the address is not one of this machine, or is taken.
    """
    try:
        found = socket.getaddrinfo(
            settings.host, settings.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )
        family, kind, protocol, _, bind_address = found[0]
        listener = socket.socket(family, kind, protocol)
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind(bind_address)
        except OSError:
            listener.close()
            raise
    except OSError as problem:
        raise InvalidConfiguration(
            f"cannot listen on {settings.host} port {settings.port}: {problem.strerror}; choose "
            "another with --host and --port (0 takes any free port)",
            host=settings.host,
            port=settings.port,
        ) from None
    return listener


def address(listener: socket.socket) -> str:
    """The address of a listening socket as clients on this machine write it."""
    host, port = listener.getsockname()[:2]
    reachable = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, str(host))
    return f"http://[{reachable}]:{port}" if ":" in reachable else f"http://{reachable}:{port}"


@contextmanager
def _signals_seen_once() -> Generator[None]:
    """Lets the process live on after an orderly stop.

    uvicorn raises the signal that stopped it once more when it is done; by default that would end
    the process before the board is closed.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, _ignored) for number in _STOPPING_SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _ignored(number: int, frame: object) -> None:
    logger.info("stopped by %s", signal.Signals(number).name)


class Server(uvicorn.Server):
    """uvicorn, with word when it answers, and a proper farewell to WebSockets.

    Args:
        app: what is served.
        settings: of the service.
        on_ready: called in the event loop once requests are answered.
    """

    def __init__(self, app: BoardApp, settings: Settings, on_ready: Callable[[], object]) -> None:
        server, live = settings.server, settings.subscriptions
        super().__init__(
            uvicorn.Config(
                app,
                loop="auto",
                http=AtOnceProtocol,
                ws="auto",
                ws_max_size=live.message_max_bytes,
                ws_ping_interval=live.heartbeat_s,
                ws_ping_timeout=live.heartbeat_s,
                log_config=None,
                access_log=server.access_log,
                server_header=False,
                proxy_headers=False,
                root_path=server.root_path,
                timeout_keep_alive=server.keep_alive_s,
                timeout_graceful_shutdown=max(1, round(server.shutdown_timeout_s)),
                backlog=1024,
            )
        )
        self._app = app
        self._on_ready = on_ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Starts to listen, then says so."""
        await super().startup(sockets)
        if self.started:
            self._on_ready()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Says farewell to WebSockets, then stops."""
        self._app.frames.wake()
        self._app.changes.wake()
        try:
            async with asyncio.timeout(self.config.timeout_graceful_shutdown):
                await self._app.live.close()
        except TimeoutError:
            logger.warning("some WebSockets did not close in time and are cut")
        await super().shutdown(sockets)
