"""Sections: every setting with its default, its unit and its meaning."""

from __future__ import annotations

from ipaddress import ip_address
from pathlib import Path
from typing import Annotated, Literal, cast

from pydantic import BaseModel, ConfigDict, Field, SecretStr, field_validator
from pydantic.fields import FieldInfo

from fluentboard.board.frame_settings import FrameSettings
from fluentboard.board.subscriptions.settings import (
    SubscriptionSettings as StandingQuerySettings,
)

Role = Literal["read", "write", "admin"]
"""What a token permits; each role includes the ones before it."""

_Count = Annotated[int, Field(ge=1)]
_Seconds = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True)


class ServerSettings(_Section):
    """Where the service listens and how it stops."""

    host: str = Field(default="127.0.0.1", description="Address to listen on.")
    port: int = Field(default=8080, ge=0, le=65535, description="TCP port; 0 takes any free one.")
    root_path: str = Field(
        default="", description="Path under which a reverse proxy serves the board, such as /board."
    )
    shutdown_timeout_s: _Seconds = Field(
        default=10.0,
        description="How long running requests may take to finish when the service stops.",
    )
    keep_alive_s: _Count = Field(
        default=60, description="How long an idle connection is kept open for its next request."
    )
    access_log: bool = Field(default=False, description="Log one line per request.")

    @field_validator("root_path")
    @classmethod
    def _starts_with_slash(cls, value: str) -> str:
        if value and (not value.startswith("/") or value.endswith("/")):
            raise ValueError("give a path that starts with a slash and ends without one")
        return value


class StorageSettings(_Section):
    """Where the board keeps what it knows."""

    data: Path | None = Field(
        default=Path("fluentboard-data"),
        description="Folder of the journal and the RDF store; null keeps everything in memory.",
    )
    store: str | None = Field(
        default=None,
        description="Address of a SPARQL 1.1 endpoint that holds the RDF store; null keeps the "
        "store in the data folder.",
    )
    store_update: str | None = Field(
        default=None,
        description="Where the endpoint takes updates; null for where it takes queries, or for "
        "/update if `store` has no path.",
    )
    durability: Literal["disk", "process"] = Field(
        default="disk",
        description="disk: a write is on the disk before it is acknowledged; "
        "process: it survives a crash of the service, not of the machine.",
    )
    ontologies: tuple[Path, ...] = Field(
        default=(), description="Turtle or RDF/XML files to load on top of the built-in ontologies."
    )
    shapes: tuple[Path, ...] = Field(
        default=(),
        description="Files of SHACL shapes; a write that violates one is refused.",
    )
    builtin_ontologies: bool = Field(
        default=True, description="Load the ontologies upper, race and furniture."
    )


class LimitSettings(_Section):
    """What one request may ask for."""

    body_max_bytes: _Count = Field(
        default=16 * 2**20, description="Longest body of a request other than an import."
    )
    import_max_bytes: _Count = Field(default=512 * 2**20, description="Longest body of an import.")
    batch_max: _Count = Field(default=10_000, description="Most commands or fluents in one batch.")
    import_batch: _Count = Field(default=1_000, description="Fluents per commit of an import.")
    page_max: _Count = Field(default=10_000, description="Most fluents on one page of a listing.")
    query_timeout_s: _Seconds = Field(default=30.0, description="Longest that a query may take.")
    queries_at_once: _Count = Field(
        default=4,
        description="Queries evaluated side by side, each in a process of its own; more wait for "
        "their turn.",
    )
    query_memory_max_bytes: _Count = Field(
        default=2 * 2**30, description="Memory that one query may take (on Linux)."
    )
    result_rows_max: _Count = Field(
        default=1_000_000, description="Most solutions in the result of one query."
    )
    result_max_bytes: _Count = Field(
        default=256 * 2**20, description="Longest result of one query."
    )
    result_cache_bytes: int = Field(
        default=32 * 2**20,
        ge=0,
        description="Memory for results that are given again until the next commit; 0 for none.",
    )
    result_memory_max_bytes: _Count = Field(
        default=4 * 2**20,
        description="Results longer than this wait in a temporary file to be sent.",
    )


class SubscriptionSettings(StandingQuerySettings):
    """What live queries may cost."""

    per_client_max: _Count = Field(default=100, description="Most subscriptions on one connection.")
    message_max_bytes: _Count = Field(
        default=2**20, description="Longest message that a client may send."
    )
    heartbeat_s: _Seconds = Field(
        default=20.0,
        description="How often a WebSocket is pinged; no answer for as long again closes it. "
        "Event streams get a comment as often.",
    )
    retry_s: _Seconds = Field(
        default=1.0, description="How soon a client of a lost event stream should come back."
    )
    connections_max: _Count = Field(default=1_000, description="Most WebSockets open at once.")
    streams_max: _Count = Field(default=1_000, description="Most event streams open at once.")
    durable_max: _Count = Field(default=1_000, description="Most durable subscriptions.")
    webhook_hosts: tuple[str, ...] = Field(
        default=(),
        description="Hosts that webhooks may post to besides this machine; * for any.",
    )
    webhook_timeout_s: _Seconds = Field(
        default=10.0, description="How long a post may take to be answered."
    )
    webhook_batch: _Count = Field(default=100, description="Most messages in one post.")
    webhook_attempts: _Count = Field(
        default=8, description="How often a post is tried before it becomes a dead letter."
    )
    webhook_backoff_s: _Seconds = Field(
        default=1.0, description="Wait after the first failed post; it doubles with each."
    )
    webhook_backoff_max_s: _Seconds = Field(
        default=300.0, description="Longest wait between two tries of a post."
    )
    dead_letters_max: _Count = Field(
        default=1_000, description="Dead letters kept per subscription; the oldest go first."
    )


class Token(_Section):
    """A bearer token and what it permits."""

    name: str = Field(min_length=1, description="Author of the commits made with it.")
    role: Role = Field(description="read, write or admin; each includes the one before.")
    token: SecretStr = Field(min_length=16, description="The secret; at least 16 characters.")


class SecuritySettings(_Section):
    """Who may do what."""

    tokens: tuple[Token, ...] = Field(
        default=(), description="Who may call the board; with none, everybody who reaches it may."
    )
    allow_open: bool = Field(
        default=False,
        description="Listen without tokens on an address that other machines can reach.",
    )
    allowed_hosts: tuple[str, ...] = Field(
        default=(),
        description="Host names by which browsers may reach a board without tokens, besides "
        "localhost, names without a dot and IP addresses.",
    )
    service_endpoints: tuple[str, ...] = Field(
        default=(), description="IRIs of the SPARQL endpoints that queries may ask with SERVICE."
    )
    load_hosts: tuple[str, ...] = Field(
        default=(),
        description="Hosts from which the SPARQL operation LOAD may fetch documents.",
    )
    cors_origins: tuple[str, ...] = Field(
        default=(),
        description="Web origins whose pages may use the board, such as https://example.org.",
    )

    @field_validator("tokens")
    @classmethod
    def _distinct(cls, tokens: tuple[Token, ...]) -> tuple[Token, ...]:
        names = [token.name for token in tokens]
        secrets = [token.token.get_secret_value() for token in tokens]
        if len(set(names)) != len(names) or len(set(secrets)) != len(secrets):
            raise ValueError("two tokens have the same name or the same secret")
        return tokens


class LogSettings(_Section):
    """What is logged."""

    level: Literal["debug", "info", "warning", "error"] = Field(
        default="info", description="Least severe message that is logged."
    )


class Settings(_Section):
    """All settings of a board service.

    Example:
        >>> Settings().limits.query_timeout_s
        30.0
    """

    server: ServerSettings = ServerSettings()
    storage: StorageSettings = StorageSettings()
    limits: LimitSettings = LimitSettings()
    subscriptions: SubscriptionSettings = SubscriptionSettings()
    frames: FrameSettings = FrameSettings()
    security: SecuritySettings = SecuritySettings()
    log: LogSettings = LogSettings()

    @property
    def is_loopback(self) -> bool:
        """The service is reachable from this machine only."""
        return is_loopback(self.server.host)


def setting_sections() -> list[tuple[str, type[BaseModel]]]:
    """Name and model of every section, in order; the documentation is checked against them."""
    return [(name, _model(field)) for name, field in Settings.model_fields.items()]


def is_loopback(host: str) -> bool:
    """Whether an address or host name stays on this machine."""
    if host == "localhost" or host.endswith(".localhost"):
        return True
    try:
        return ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def _model(field: FieldInfo) -> type[BaseModel]:
    return cast("type[BaseModel]", field.annotation)
