"""What is told of a board as a whole: audit trail, frames, classes, health, problems."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from fluentboard.api.schemas.fluents import Schema


class AuditChange(Schema):
    """What a commit did to a fluent."""

    event: str = Field(description="added, refined, ended or corrected.")
    name: str = Field(description="Of the fluent.")
    class_name: str = Field(alias="class", description="Of the fluent.")


class AuditStatements(Schema):
    """What a commit changed outside fluents."""

    graph: str = Field(description="IRI of the named graph; empty for the default graph.")
    ontology: str = Field(description="Name of the ontology that was loaded; empty for an update.")
    added: int = Field(description="How many statements came.")
    removed: int = Field(description="How many statements went.")


class AuditCommit(Schema):
    """Who changed what and when."""

    commit: int = Field(description="Number of the commit.")
    wall_s: float = Field(description="When, in seconds since the Unix epoch.")
    author: str = Field(description="Name of the token, or what the client called itself.")
    reason: str = Field(description="Why, where an admin forced it; otherwise empty.")
    idempotency_key: str | None = Field(description="Of the request.")
    fluents: list[AuditChange]
    statements: list[AuditStatements]


class Audit(Schema):
    """A part of the audit trail."""

    commits: list[AuditCommit]
    next: int | None = Field(description="What `after` has to be for more; null at the end.")


class FrameReceipt(Schema):
    """A live frame that is kept."""

    sensor: str = Field(description="Which sent it.")
    index: int = Field(description="Its number among all frames of the sensor.")
    stamp_s: float = Field(description="When it was taken, in seconds.")
    bytes: int = Field(description="Its size.")
    dropped: int = Field(default=0, description="Older frames that made room for it.")


class SensorJson(Schema):
    """A sensor that sends frames."""

    sensor: str = Field(description="Its name.")
    frames: int = Field(description="How many are kept.")
    bytes: int = Field(description="Size of all of them.")
    oldest: int = Field(description="Number of the first one kept.")
    newest: int = Field(description="Number of the last one sent.")
    stamp_s: float = Field(description="When the newest was taken, in seconds.")


class Sensors(Schema):
    """All sensors of which frames are kept."""

    sensors: list[SensorJson]


class ClassJson(Schema):
    """A class of the loaded ontologies."""

    name: str = Field(description="Short name, as in a fluent's `class`.")
    iri: str
    label: str
    superclasses: list[str] = Field(description="Short names of all classes above it.")


class Classes(Schema):
    """All classes that a fluent may have."""

    classes: list[ClassJson]
    prefixes: dict[str, str] = Field(description="Prefixes that queries need not declare.")


class Health(Schema):
    """The process is up."""

    status: Literal["up"]
    version: str


class Readiness(Schema):
    """Whether the board takes reads and writes."""

    status: Literal["ready", "failed"]
    commit: int = Field(description="The last commit that all projections have applied.")
    fluents: int
    failure: str | None = Field(description="Why writes are refused; null if they are not.")


class ProblemJson(BaseModel):
    """An RFC 9457 problem; members beyond these are particulars of the code."""

    model_config = ConfigDict(extra="allow")

    type: str = Field(description="IRI of the kind of problem: it ends in `#` and the code.")
    title: str
    status: int
    detail: str = Field(description="What happened, with the offending value and what to do.")
    code: str = Field(description="Stable; explained in the documentation of errors.")
    message: str = Field(description="The same text as `detail`.")
