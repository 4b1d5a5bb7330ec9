"""Webhooks: messages of durable subscriptions, signed, posted, and tried again.

Signatures follow the Standard Webhooks specification (1.0): HMAC-SHA256 over the identifier, the
time and the body.
"""

from __future__ import annotations

import asyncio
import base64
import binascii
import hashlib
import hmac
import logging
import random
import secrets
import uuid
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any
from urllib.parse import urlsplit

import httpx
import orjson

from fluentboard.api.live_request import LiveRequest, position_of
from fluentboard.board.subscriptions.durable import (
    DurableSubscription,
    DurableSubscriptions,
    Position,
)
from fluentboard.board.subscriptions.messages import Failed, Message
from fluentboard.board.subscriptions.registry import SubscriptionRegistry
from fluentboard.board.subscriptions.subscription import Subscription
from fluentboard.clock import Clock, SystemClock
from fluentboard.config import SubscriptionSettings, is_loopback
from fluentboard.errors import (
    FluentboardError,
    InvalidInput,
    NotAllowed,
    StorageFailed,
    UnknownResource,
)

logger = logging.getLogger(__name__)

SECRET_PREFIX = "whsec_"
_KEY_BYTES = (24, 64)
_GONE = 410


class Webhooks:
    """Posts the messages of all durable subscriptions that have an address.

    One task per subscription, so that an address that does not answer holds up nobody else. A
    message counts as seen when its post is answered with a status of 200 to 299, and only then is
    the position moved: a post may arrive twice, none is left out.

    Args:
        registry: evaluates the queries.
        durable: what is to be posted, and what was.
        settings: how often to try, and for how long.
        clock: gives the time stamps; the system's by default.
        transport: replaces the network, in tests.
    """

    def __init__(
        self,
        registry: SubscriptionRegistry,
        durable: DurableSubscriptions,
        settings: SubscriptionSettings,
        clock: Clock | None = None,
        transport: httpx.AsyncBaseTransport | None = None,
    ) -> None:
        self._registry = registry
        self._durable = durable
        self._settings = settings
        self._clock = clock or SystemClock()
        self._transport = transport
        self._http: httpx.AsyncClient | None = None
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self.delivered = 0
        self.failed = 0

    async def start(self) -> None:
        """Begins to post; before that, nothing is posted."""
        self._http = httpx.AsyncClient(
            timeout=self._settings.webhook_timeout_s,
            transport=self._transport,
            trust_env=False,
            follow_redirects=False,
        )
        for one in await asyncio.to_thread(self._durable.all):
            self.begin(one)

    def begin(self, one: DurableSubscription) -> None:
        """Begins to post the messages of one subscription, if it has an address."""
        if self._http is None or one.url is None or one.is_paused or one.name in self._tasks:
            return
        task = asyncio.create_task(_Delivery(self, one, self._http).run())
        self._tasks[one.name] = task
        task.add_done_callback(lambda _: self._forget(one.name, task))

    async def stop(self, name: str) -> None:
        """Stops to post the messages of one subscription; a post under way is abandoned."""
        task = self._tasks.pop(name, None)
        if task is not None:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    async def close(self) -> None:
        """Stops all posts. What was not answered is posted again after a restart."""
        for name in list(self._tasks):
            await self.stop(name)
        if self._http is not None:
            await self._http.aclose()
            self._http = None

    def is_delivering(self, name: str) -> bool:
        """The messages of that subscription are being posted."""
        return name in self._tasks

    def _forget(self, name: str, task: asyncio.Task[None]) -> None:
        if self._tasks.get(name) is task:
            del self._tasks[name]
        if not task.cancelled() and task.exception() is not None:
            logger.error("posting %s ended unexpectedly", name, exc_info=task.exception())

    # What follows is for deliveries.

    @property
    def registry(self) -> SubscriptionRegistry:
        """Evaluates the queries."""
        return self._registry

    @property
    def durable(self) -> DurableSubscriptions:
        """Where positions and dead letters are kept."""
        return self._durable

    @property
    def settings(self) -> SubscriptionSettings:
        """How often to try, and for how long."""
        return self._settings

    @property
    def clock(self) -> Clock:
        """Gives the time stamps."""
        return self._clock


class _Delivery:
    """The posts of one subscription, one after the other."""

    def __init__(
        self, webhooks: Webhooks, one: DurableSubscription, http: httpx.AsyncClient
    ) -> None:
        assert one.url is not None
        assert one.secret is not None
        self._webhooks = webhooks
        self._one = one
        self._url = one.url
        self._key = signing_key(one.secret)
        self._http = http
        self._seen = one.seen
        self._is_broken = one.is_broken

    async def run(self) -> None:
        while await self._converse():
            pass

    async def _converse(self) -> bool:
        """Posts until something was missed; False if there is nothing more to post."""
        loop = asyncio.get_running_loop()
        something = asyncio.Event()

        def mark() -> None:
            try:
                loop.call_soon_threadsafe(something.set)
            except RuntimeError:
                return  # The loop is closed: the service stops.

        one = self._one
        since = None if self._is_broken else self._seen
        sequence = 0 if self._seen is None else self._seen.sequence
        request = LiveRequest(one.query, one.mode, one.at, since)
        opening = loop.run_in_executor(None, self._open, request, mark, sequence)
        try:
            subscription = await asyncio.shield(opening)
        except asyncio.CancelledError:
            opening.add_done_callback(_close_opened)
            raise
        except FluentboardError as problem:
            logger.warning("the webhook of %s cannot be served: %s", one.name, problem)
            return False
        try:
            first: list[dict[str, Any]] = []
            if self._is_broken and self._seen is not None:
                since_commit = self._seen.commit
                first = [{"type": "gap", "id": one.name, "since": since_commit}]
            while True:
                something.clear()
                messages = subscription.poll(self._webhooks.settings.webhook_batch)
                if not messages:
                    await something.wait()
                    continue
                if not await self._post(first, messages):
                    return not self._is_paused()
                first = []
                if isinstance(messages[-1], Failed):
                    return False
        finally:
            subscription.close()

    def _open(self, request: LiveRequest, mark: Any, sequence: int) -> Subscription:
        at = None if request.at is None else "now"
        since = request.since
        registry = self._webhooks.registry
        certainty = {} if request.at is None else {"certainty": request.at}
        return registry.open(
            request.query,
            request.mode,
            None if since is None else since.commit,
            mark,
            at=at,
            since_s=None if since is None else since.at_s,
            sequence=sequence,
            **certainty,
        )

    async def _post(self, first: list[dict[str, Any]], messages: list[Message]) -> bool:
        """Posts until it is taken or given up; whether it was taken."""
        one, webhooks = self._one, self._webhooks
        content = [*first, *(message.to_json(one.name) for message in messages)]
        body = orjson.dumps({"subscription": one.name, "messages": content}, default=str)
        delivery = f"msg_{uuid.uuid4().hex}"
        settings, reason = webhooks.settings, ""
        for attempt in range(1, settings.webhook_attempts + 1):
            status, reason, wait_s = await self._attempt(delivery, body)
            if 200 <= status < 300:
                webhooks.delivered += 1
                await self._advance(messages)
                return True
            webhooks.failed += 1
            if status == _GONE:
                logger.warning("%s wants no more of %s; it is paused", self._url, one.name)
                await asyncio.to_thread(webhooks.durable.pause, one.name, is_paused=True)
                return False
            if attempt < settings.webhook_attempts:
                logger.info(
                    "post %s of %s failed (%s), try %s", delivery, one.name, reason, attempt
                )
                await asyncio.sleep(max(wait_s, backoff_s(attempt, settings)))
        logger.warning(
            "post %s of %s is given up after %s tries: %s",
            delivery,
            one.name,
            settings.webhook_attempts,
            reason,
        )
        self._is_broken = True
        tries, now_s = settings.webhook_attempts, webhooks.clock.now_s()
        bury = webhooks.durable.bury
        await self._noted(partial(bury, one.name, delivery, body, tries, reason, now_s))
        return False

    async def _attempt(self, delivery: str, body: bytes) -> tuple[int, str, float]:
        """The status (0 if there was no answer), what went wrong, and how long to wait at least."""
        headers = signed_headers(self._key, delivery, self._webhooks.clock.now_s(), body)
        try:
            reply = await self._http.post(self._url, content=body, headers=headers)
        except (httpx.HTTPError, OSError) as failure:
            return 0, f"{type(failure).__name__}: {failure}", 0.0
        asked = reply.headers.get("retry-after", "")
        limit_s = self._webhooks.settings.webhook_backoff_max_s
        wait_s = min(float(asked), limit_s) if asked.isascii() and asked.isdigit() else 0.0
        return reply.status_code, f"status {reply.status_code}", wait_s

    async def _advance(self, messages: list[Message]) -> None:
        for message in messages:
            seen = position_of(message)
            if seen is not None:
                sequence = seen.sequence
                if self._seen is not None:
                    sequence = max(sequence, self._seen.sequence)
                self._seen = Position(seen.commit, seen.at_s, sequence)
                self._is_broken = False
        if self._seen is not None:
            advance = self._webhooks.durable.advance
            await self._noted(partial(advance, self._one.name, self._seen))

    async def _noted(self, note: Callable[[], None]) -> None:
        """Notes something on the disk; without it, a restart posts again what was posted."""
        try:
            await asyncio.to_thread(note)
        except StorageFailed as problem:
            logger.warning("how far %s has come cannot be noted: %s", self._one.name, problem)

    def _is_paused(self) -> bool:
        try:
            return self._webhooks.durable.get(self._one.name).is_paused
        except UnknownResource:
            return True


def backoff_s(attempt: int, settings: SubscriptionSettings) -> float:
    """How long to wait after a failed attempt, in seconds: doubling, with a quarter of randomness.

    Args:
        attempt: 1 for the first.
        settings: the first delay and the longest.
    """
    delay_s = min(settings.webhook_backoff_s * 2.0 ** (attempt - 1), settings.webhook_backoff_max_s)
    return delay_s * random.uniform(0.75, 1.25)


def new_secret() -> str:
    """A secret to sign with, as Standard Webhooks writes it."""
    return SECRET_PREFIX + base64.b64encode(secrets.token_bytes(32)).decode()


def signing_key(secret: str) -> bytes:
    """The key in a secret.

    Raises:
        InvalidInput: it is not `whsec_` and 24 to 64 bytes in base64.
    """
    least, most = _KEY_BYTES
    try:
        key = base64.b64decode(secret.removeprefix(SECRET_PREFIX), validate=True)
    except (binascii.Error, ValueError):
        key = b""
    if not secret.startswith(SECRET_PREFIX) or not least <= len(key) <= most:
        raise InvalidInput(
            f"the secret of a webhook is {SECRET_PREFIX} and {least} to {most} bytes in base64; "
            "leave it out to have one made"
        )
    return key


def signed_headers(key: bytes, delivery: str, now_s: float, body: bytes) -> Mapping[str, str]:
    """The headers of a post: what it is, when it was made, and the proof of both."""
    stamp = str(int(now_s))
    digest = hmac.new(key, f"{delivery}.{stamp}.".encode() + body, hashlib.sha256).digest()
    return {
        "content-type": "application/json",
        "webhook-id": delivery,
        "webhook-timestamp": stamp,
        "webhook-signature": f"v1,{base64.b64encode(digest).decode()}",
    }


def check_address(url: str, settings: SubscriptionSettings) -> None:
    """Refuses an address that the board may not post to.

    Raises:
        InvalidInput: it is no http or https address.
        NotAllowed: its host is neither this machine nor listed in the settings.
    """
    try:
        parts = urlsplit(url)
        host = parts.hostname or ""
        _ = parts.port
    except ValueError:
        raise InvalidInput(f"{url!r} is not an address") from None
    if parts.scheme not in ("http", "https") or not host or parts.username is not None:
        raise InvalidInput(
            f"{url!r} is not an address to post to; give http://HOST/PATH or https://HOST/PATH"
        )
    allowed = settings.webhook_hosts
    if not is_loopback(host) and host not in allowed and "*" not in allowed:
        raise NotAllowed(
            f"the board may not post to {host!r}; add it to subscriptions.webhook_hosts",
            host=host,
        )


def _close_opened(opening: asyncio.Future[Subscription]) -> None:
    if not opening.cancelled() and opening.exception() is None:
        opening.result().close()
