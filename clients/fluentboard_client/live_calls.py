"""Live queries: what `subscribe` takes, for blocking and for awaiting clients."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, Any, Concatenate, Literal, ParamSpec, overload

from fluentboard.errors import InvalidInput
from fluentboard_client.calls import Awaiting, Blocking, Method
from fluentboard_client.conversation import LiveQuery, Mode

if TYPE_CHECKING:
    from fluentboard_client.live import AsyncSubscription, Subscription

_P = ParamSpec("_P")


class LiveBlocking(Blocking):
    """Whose subscriptions are blocking iterators."""

    @abstractmethod
    def live_result(self, query: LiveQuery) -> Subscription:
        """The live result of a query."""


class LiveAwaiting(Awaiting):
    """Whose subscriptions are asynchronous iterators."""

    @abstractmethod
    def live_result(self, query: LiveQuery) -> AsyncSubscription:
        """The live result of a query."""


class live(Method[_P, LiveQuery]):
    """A subscription of the client's kind."""

    @overload
    def __get__(self, caller: None, owner: type) -> Callable[Concatenate[Any, _P], LiveQuery]: ...

    @overload
    def __get__(self, caller: LiveBlocking, owner: type) -> Callable[_P, Subscription]: ...

    @overload
    def __get__(self, caller: LiveAwaiting, owner: type) -> Callable[_P, AsyncSubscription]: ...

    def __get__(
        self, caller: LiveBlocking | LiveAwaiting | None, owner: type
    ) -> Callable[..., Any]:
        if caller is None:
            return self.asked
        asked = self.bound(caller)

        @wraps(asked)
        def subscribed(*args: _P.args, **options: _P.kwargs) -> Subscription | AsyncSubscription:
            return caller.live_result(asked(*args, **options))

        return subscribed


class LiveCalls:
    """What `Client` and `AsyncClient` have for subscriptions."""

    @live
    def subscribe(
        self,
        sparql: str = "",
        *,
        mode: Mode = "bindings",
        since: int | None = None,
        at: Literal["now"] | None = None,
        certainly: bool = False,
        since_at: float | None = None,
        from_commit: int | None = None,
        from_time: float | None = None,
        speed: float = 1.0,
        durable: str | None = None,
    ) -> LiveQuery:
        """The live result of a query: a Snapshot, then a Delta whenever it changes.

        The iterator reconnects when the board restarts and goes on with what it missed. It ends
        when its `close` is called, from any thread.

        Args:
            sparql: a SELECT, ASK or CONSTRUCT.
            mode: whether deltas carry `bindings`, whole `fluents`, or `both`.
            since: go on after this commit instead of starting with a snapshot.
            at: `now` sees only the fluents that hold, and the clock changes the result, too.
            certainly: with `at`: only what certainly holds.
            since_at: with `at` and `since`: the time heard of last, in seconds.
            from_commit: replay: begin after this commit, and go through the later ones.
            from_time: replay: begin at this time, in seconds.
            speed: of a replay: seconds of the past per second.
            durable: instead of a query: the name of a durable subscription.
        """
        options: dict[str, Any] = {}
        if durable is not None:
            options["durable"] = durable
        if at is not None:
            options["at"] = at
        if certainly:
            options["certainly"] = True
        if since_at is not None:
            options["since_at"] = since_at
        if from_commit is not None and from_time is not None:
            raise InvalidInput("a replay begins at a commit or at a time; give one of the two")
        if from_commit is not None:
            options["replay"] = {"commit": from_commit, "speed": speed}
        elif from_time is not None:
            options["replay"] = {"time": from_time, "speed": speed}
        return LiveQuery(sparql, mode, since, options)
