"""Security: who calls, what their role permits, and which web pages may call at all."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from ipaddress import ip_address
from urllib.parse import urlsplit

from fluentboard.config import Role, Settings
from fluentboard.errors import InvalidConfiguration, NotAllowed, NotAuthenticated

_RANK: Mapping[Role, int] = {"read": 0, "write": 1, "admin": 2}
_KNOWN_HOSTS_MAX = 1_000

Headers = Mapping[bytes, bytes]


@dataclass(frozen=True, slots=True)
class Principal:
    """Who calls.

    Attributes:
        name: of the token, or None where the board is open.
        role: what the caller may do.
    """

    name: str | None
    role: Role


ANYONE = Principal(None, "admin")
"""Whoever reaches an open board."""


class Guard:
    """Admits or refuses requests.

    With tokens, every request to a protected route needs one. Without, the board is open to whoever
    reaches it, but not to web pages of other origins: the browser of a user on this machine reaches
    the loopback address too, on behalf of any page.

    Args:
        settings: of the service.
    """

    def __init__(self, settings: Settings) -> None:
        security = settings.security
        # Looked up by digest, so the time taken tells nothing about the secret.
        self._principals = {
            _digest(token.token.get_secret_value().encode()): Principal(token.name, token.role)
            for token in security.tokens
        }
        self._origins = frozenset(origin.encode() for origin in security.cors_origins)
        self._allowed_hosts = frozenset(host.lower() for host in security.allowed_hosts)
        self._checks_hosts = settings.is_loopback and not security.tokens
        self._known_hosts: set[bytes] = set()

    @property
    def is_open(self) -> bool:
        """No token is needed."""
        return not self._principals

    def admit(self, headers: Headers, role: Role, *, changes: bool) -> Principal:
        """Who sent a request, if they may do what it asks for.

        Args:
            headers: of the request.
            role: what the route asks for.
            changes: the request changes something, or opens a connection that a page can read.

        Raises:
            NotAuthenticated: a token is needed, and there is none or a wrong one.
            NotAllowed: the token's role, or the page that sends the request, may not do this.
        """
        if self._principals:
            principal = self._authenticated(headers)
            if _RANK[principal.role] < _RANK[role]:
                raise NotAllowed(
                    f"token {principal.name!r} has the role {principal.role}; this needs {role}",
                    role=principal.role,
                    needed=role,
                )
            return principal
        host = headers.get(b"host", b"")
        if self._checks_hosts and host not in self._known_hosts:
            self._check_host(host)
        if changes and b"origin" in headers:
            self._check_origin(headers[b"origin"], host)
        return ANYONE

    def allows_origin(self, origin: bytes) -> bool:
        """Pages of that origin may read replies (CORS)."""
        return origin in self._origins or b"*" in self._origins

    def _authenticated(self, headers: Headers) -> Principal:
        scheme, _, secret = headers.get(b"authorization", b"").partition(b" ")
        if scheme.lower() != b"bearer" or not secret.strip():
            raise NotAuthenticated(
                "this board needs a token; send it as `Authorization: Bearer TOKEN`"
            )
        principal = self._principals.get(_digest(secret.strip()))
        if principal is None:
            raise NotAuthenticated("the token is not one of this board's; ask its operator")
        return principal

    def _check_host(self, host: bytes) -> None:
        # DNS rebinding: a page of evil.example makes that name point to 127.0.0.1 and is then of
        # the same origin as the board. Only the Host header still tells.
        name = _host_name(host.decode("latin-1"))
        is_foreign = "." in name and not name.endswith(".localhost") and not _is_address(name)
        if is_foreign and name not in self._allowed_hosts:
            raise NotAllowed(
                f"an open board does not answer to the host name {name!r}; add it to "
                "security.allowed_hosts, or configure tokens",
                host=name,
            )
        if len(self._known_hosts) < _KNOWN_HOSTS_MAX:
            self._known_hosts.add(host)

    def _check_origin(self, origin: bytes, host: bytes) -> None:
        if self.allows_origin(origin):
            return
        page = urlsplit(origin.decode("latin-1")).netloc.lower()
        if page != host.decode("latin-1").lower():
            raise NotAllowed(
                f"pages of {origin.decode('latin-1')!r} may not change this board; add the origin "
                "to security.cors_origins to let them",
                origin=origin.decode("latin-1"),
            )


def check_exposure(settings: Settings) -> None:
    """Refuses settings that would let other machines write without a token.

    Raises:
        InvalidConfiguration: the address is not loopback and there is no token.
    """
    security = settings.security
    if settings.is_loopback or security.tokens or security.allow_open:
        return
    raise InvalidConfiguration(
        f"listening on {settings.server.host} would let every machine that reaches it read and "
        "write without a token; configure security.tokens, listen on 127.0.0.1, or set "
        "security.allow_open if the network is trusted",
        host=settings.server.host,
    )


def _digest(secret: bytes) -> bytes:
    return hashlib.sha256(secret).digest()


def _host_name(host: str) -> str:
    """The name or address without the port."""
    try:
        return (urlsplit(f"//{host}").hostname or "").rstrip(".")
    except ValueError:
        return host.lower()


def _is_address(name: str) -> bool:
    try:
        ip_address(name)
    except ValueError:
        return False
    return True
