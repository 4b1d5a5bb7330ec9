"""Calls: what is asked of a board is written once, and blocks or is awaited as its client does.

A method says what to send and how to read the reply, and one of the decorators here makes a call of
it: on a `Blocking` object it gives the answer, on an `Awaiting` one an awaitable of it. Type
checkers know both, with the parameters of the method.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator, Sequence
from contextlib import AbstractAsyncContextManager, AbstractContextManager
from dataclasses import dataclass
from functools import wraps
from typing import Any, Concatenate, Generic, ParamSpec, TypeVar, overload

import httpx

from fluentboard_client.exchange import Request

_P = ParamSpec("_P")
_T = TypeVar("_T")
_A = TypeVar("_A")


class Blocking(ABC):
    """Whose calls return when the board has replied."""

    @abstractmethod
    def send(self, request: Request) -> httpx.Response:
        """The reply to a request; raises the error that it stands for."""


class BlockingStreams(Blocking):
    """The same, and long replies are read piece by piece."""

    @abstractmethod
    def streamed(self, request: Request) -> AbstractContextManager[httpx.Response]:
        """The reply to a request, whose body is still to be read."""


class Awaiting(ABC):
    """Whose calls are to be awaited."""

    @abstractmethod
    async def send(self, request: Request) -> httpx.Response:
        """The reply to a request; raises the error that it stands for."""


class AwaitingStreams(Awaiting):
    """The same, and long replies are read piece by piece."""

    @abstractmethod
    def streamed(self, request: Request) -> AbstractAsyncContextManager[httpx.Response]:
        """The reply to a request, whose body is still to be read."""


@dataclass(frozen=True, slots=True)
class Ask(Generic[_T]):
    """One request, and what its reply means: a call of it gives `T`, or an awaitable of `T`.

    Attributes:
        request: what is sent.
        read: makes the answer of the reply.
    """

    request: Request
    read: Callable[[httpx.Response], _T]


@dataclass(frozen=True, slots=True)
class Pages(Generic[_T]):
    """A long answer that the board gives page by page.

    Attributes:
        request: what is sent for the first page (None) and for those after it (their cursor).
        read: what is on a page, and the cursor of the next one if there is one.
    """

    request: Callable[[str | None], Request]
    read: Callable[[httpx.Response], tuple[Sequence[_T], str | None]]


class Method(Generic[_P, _A]):
    """A method of a class whose objects are blocking or awaiting.

    Args:
        asked: the method as it is written: its arguments in, what to ask the board out.
    """

    def __init__(self, asked: Callable[Concatenate[Any, _P], _A]) -> None:
        self.asked = asked
        self.__doc__ = asked.__doc__

    def bound(self, caller: object) -> Callable[_P, _A]:
        """The method of one object."""
        return self.asked.__get__(caller)


class call(Method[_P, Ask[_T]]):
    """One request and its answer."""

    @overload
    def __get__(self, caller: None, owner: type) -> Callable[Concatenate[Any, _P], Ask[_T]]: ...

    @overload
    def __get__(self, caller: Blocking, owner: type) -> Callable[_P, _T]: ...

    @overload
    def __get__(self, caller: Awaiting, owner: type) -> Callable[_P, Coroutine[Any, Any, _T]]: ...

    def __get__(self, caller: Blocking | Awaiting | None, owner: type) -> Callable[..., Any]:
        if caller is None:
            return self.asked
        asked = self.bound(caller)
        if isinstance(caller, Blocking):

            @wraps(asked)
            def answered(*args: _P.args, **options: _P.kwargs) -> _T:
                ask = asked(*args, **options)
                return ask.read(caller.send(ask.request))

            return answered

        @wraps(asked)
        async def awaited(*args: _P.args, **options: _P.kwargs) -> _T:
            ask = asked(*args, **options)
            return ask.read(await caller.send(ask.request))

        return awaited


class pages(Method[_P, Pages[_T]]):
    """An iterator over what is on all pages; each is asked for when it is needed."""

    @overload
    def __get__(self, caller: None, owner: type) -> Callable[Concatenate[Any, _P], Pages[_T]]: ...

    @overload
    def __get__(self, caller: Blocking, owner: type) -> Callable[_P, Iterator[_T]]: ...

    @overload
    def __get__(self, caller: Awaiting, owner: type) -> Callable[_P, AsyncIterator[_T]]: ...

    def __get__(self, caller: Blocking | Awaiting | None, owner: type) -> Callable[..., Any]:
        if caller is None:
            return self.asked
        asked = self.bound(caller)
        if isinstance(caller, Blocking):

            @wraps(asked)
            def turned(*args: _P.args, **options: _P.kwargs) -> Iterator[_T]:
                of_pages = asked(*args, **options)
                page, cursor = of_pages.read(caller.send(of_pages.request(None)))
                yield from page
                while cursor is not None:
                    page, cursor = of_pages.read(caller.send(of_pages.request(cursor)))
                    yield from page

            return turned

        @wraps(asked)
        async def turned_async(*args: _P.args, **options: _P.kwargs) -> AsyncIterator[_T]:
            of_pages = asked(*args, **options)
            page, cursor = of_pages.read(await caller.send(of_pages.request(None)))
            for entry in page:
                yield entry
            while cursor is not None:
                page, cursor = of_pages.read(await caller.send(of_pages.request(cursor)))
                for entry in page:
                    yield entry

        return turned_async


class pieces(Method[_P, Request]):
    """An iterator over the body of a reply, in pieces as they arrive."""

    @overload
    def __get__(self, caller: None, owner: type) -> Callable[Concatenate[Any, _P], Request]: ...

    @overload
    def __get__(self, caller: BlockingStreams, owner: type) -> Callable[_P, Iterator[bytes]]: ...

    @overload
    def __get__(
        self, caller: AwaitingStreams, owner: type
    ) -> Callable[_P, AsyncIterator[bytes]]: ...

    def __get__(
        self, caller: BlockingStreams | AwaitingStreams | None, owner: type
    ) -> Callable[..., Any]:
        if caller is None:
            return self.asked
        asked = self.bound(caller)
        if isinstance(caller, BlockingStreams):

            @wraps(asked)
            def received(*args: _P.args, **options: _P.kwargs) -> Iterator[bytes]:
                with caller.streamed(asked(*args, **options)) as reply:
                    yield from reply.iter_bytes()

            return received

        @wraps(asked)
        async def received_async(*args: _P.args, **options: _P.kwargs) -> AsyncIterator[bytes]:
            async with caller.streamed(asked(*args, **options)) as reply:
                async for piece in reply.aiter_bytes():
                    yield piece

        return received_async
