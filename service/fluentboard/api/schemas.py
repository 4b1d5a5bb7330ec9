"""Schemas: the JSON of bodies and replies, for the OpenAPI document and for clients.

They document. What a body means is decided by `fluentboard.model.json_format`, whose errors say
what to do; the tests hold the two together.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Time = Annotated[
    float | None, Field(description="Seconds on the board's time axis; null if it is not known.")
]
IntervalPair = Annotated[
    tuple[Time, Time],
    Field(description="[earliest, latest]: what is known about one point in time."),
]
IntervalLike = Annotated[
    IntervalPair | float | None,
    Field(description="[earliest, latest], or one number if it is known exactly, or null."),
]
Value = str | int | float | bool


class _Schema(BaseModel):
    model_config = ConfigDict(extra="forbid")


class PropertyJson(_Schema):
    """One statement about a fluent."""

    property: str = Field(description="Short name or IRI.", examples=["hasPassiveObject"])
    type: str = Field(
        description="`xsd:...` for a literal, else the class of the fluent that the value names.",
        examples=["Mug"],
    )
    value: Value = Field(description="The literal, or the name of the other fluent.")


PropertyLike = (
    PropertyJson
    | Annotated[tuple[str, str, Value], Field(description="The same as [property, type, value].")]
)


class FluentBody(_Schema):
    """A fluent as a writer states it."""

    name: str = Field(
        description="Unique name; letters, digits and `. : @ + ~ - _`, at most 256 characters."
    )
    class_: str = Field(
        alias="class", description="Its class: short name, prefixed name or IRI.", examples=["On"]
    )
    start: IntervalLike = None
    finish: IntervalLike = None
    properties: list[PropertyLike] = []
    version: int = Field(default=0, description="Ignored: the board sets it.")
    author: str = Field(default="", description="Ignored: the board sets it.")
    created: int = Field(default=0, description="Ignored: the board sets it.")


class FluentJson(_Schema):
    """A fluent as the board tells it."""

    name: str
    class_: str = Field(alias="class")
    start: IntervalPair
    finish: IntervalPair
    properties: list[PropertyJson]
    version: int = Field(description="Number of the commit that changed it last.")
    author: str = Field(description="Who made that commit.")
    created: int = Field(description="Number of the commit that asserted it.")


class FluentBatch(_Schema):
    """Several fluents, all of them or none."""

    fluents: list[FluentBody]


class AssertedFluent(_Schema):
    """What became of one asserted fluent."""

    name: str
    version: int = Field(description="Number of the commit that changed it last.")
    created: int = Field(description="Number of the commit that asserted it.")


class AssertReceipt(_Schema):
    """What an assertion led to."""

    commit: int = Field(
        description="Number of the commit; the last one's if the board held all of it already."
    )
    fluents: list[AssertedFluent] = Field(description="In the order in which they were sent.")
    warnings: list[str] = Field(
        description="What is allowed but perhaps not meant: undeclared properties, references to "
        "fluents that are not on the board."
    )


class AssertCommand(_Schema):
    """Puts a fluent on the board."""

    op: Literal["assert"]
    fluent: FluentBody
    merge: bool = Field(
        default=False, description="Refine the fluent of that name if there is one."
    )


class RefineCommand(_Schema):
    """Narrows intervals, adds property values."""

    op: Literal["refine"]
    name: str
    start: IntervalLike = None
    finish: IntervalLike = None
    properties: list[PropertyLike] = []
    version: int | None = Field(
        default=None, description="Refuse unless the fluent is at this version."
    )


class EndCommand(_Schema):
    """Says when a fluent ceased to hold."""

    op: Literal["end"]
    name: str
    finish: IntervalPair | float
    version: int | None = Field(
        default=None, description="Refuse unless the fluent is at this version."
    )


class CommandBatch(_Schema):
    """Several commands, all of them or none."""

    commands: list[Annotated[AssertCommand | RefineCommand | EndCommand, Field(discriminator="op")]]


EventKind = Literal["added", "refined", "ended", "corrected"]


class EventJson(_Schema):
    """What happened to one fluent."""

    event: EventKind
    fluent: FluentJson = Field(description="As it stands since then.")


class CommandsReceipt(_Schema):
    """What a batch led to."""

    commit: int
    events: list[EventJson] = Field(
        description="In the order of the commands; commands that changed nothing have none."
    )
    warnings: list[str]


class ChangeReceipt(_Schema):
    """What changing one fluent led to."""

    commit: int
    fluent: FluentJson
    warnings: list[str]


class FluentPage(_Schema):
    """A page of a listing."""

    fluents: list[FluentJson] = Field(description="In the order of their first assertion.")
    next: int | None = Field(description="`cursor` of the next page; null after the last.")
    commit: int = Field(description="All of the page is as believed after this commit.")


class HistoryEntry(EventJson):
    """One change of a fluent."""

    commit: int
    author: str
    wall_s: float = Field(description="When it was made, in seconds since the Unix epoch.")
    reason: str = Field(description="Why, where an admin forced it; else empty.")


class History(_Schema):
    """All changes of a fluent, oldest first."""

    name: str
    history: list[HistoryEntry]


class PoseJson(_Schema):
    """A pose in the map frame."""

    x: float = Field(description="Metres.")
    y: float = Field(description="Metres.")
    z: float = Field(description="Metres, upwards.")
    roll: float = Field(description="Radians about x, applied first.")
    pitch: float = Field(description="Radians about y.")
    yaw: float = Field(description="Radians about z.")
    quaternion: tuple[float, float, float, float] = Field(description="The same turn: x, y, z, w.")


class StepJson(_Schema):
    """A pose that an object had for as long as the pose fluent held."""

    fluent: str = Field(description="Name of the pose fluent.")
    start: IntervalPair
    finish: IntervalPair
    pose: PoseJson


class PositionJson(StepJson):
    """A pose that an object has at a time."""

    certainty: Literal["possible", "certain"]


class PositionsJson(_Schema):
    """Where an object is at a time."""

    at: float = Field(description="The time in seconds.")
    poses: list[PositionJson] = Field(
        description="The surest first; more than one if several are possible, none in a gap."
    )


class GapJson(_Schema):
    """A time between two poses for which none is known."""

    before: str = Field(description="The pose fluent that ended.")
    after: str = Field(description="The next one.")
    possible: IntervalPair = Field(description="From when to when there may be no pose.")
    certain: IntervalPair | None = Field(
        description="From when to when there surely is none; null if the poses may touch."
    )


class TrajectoryJson(_Schema):
    """Where an object was."""

    name: str
    poses: list[StepJson] = Field(description="In the order of their starts.")
    distance_m: float = Field(
        description="The way from pose to pose in straight lines: the least that it travelled."
    )
    gaps: list[GapJson]
    missing: list[str] = Field(
        description="References to poses that are not on the board, or are none."
    )
    positions: list[PositionsJson] | None = Field(
        default=None, description="For each time that was asked for; left out if none was."
    )
    commit: int = Field(description="All of it is as believed after this commit.")


class RefinementBody(_Schema):
    """What a refinement changes; what is left out stays."""

    start: IntervalLike = None
    finish: IntervalLike = None
    properties: list[PropertyLike] = []


class EndingBody(_Schema):
    """When a fluent ceased to hold."""

    at: IntervalPair | float | Literal["now"] = Field(
        default="now", description="A time, the interval it lies in, or `now`."
    )


class ImportReceipt(_Schema):
    """What an import led to."""

    commit: int = Field(description="Number of the last commit.")
    commits: int = Field(description="How many commits it took.")
    fluents: int = Field(description="How many fluents were read.")
    changed: int = Field(description="How many of them were new, or said something new.")
    statements: int = Field(
        default=0, description="How many statements outside fluents the board did not say before."
    )
    warnings: list[str] = Field(description="At most 100 of them.")


class AuditChange(_Schema):
    """What a commit did to a fluent."""

    event: str = Field(description="added, refined, ended or corrected.")
    name: str = Field(description="Of the fluent.")
    class_name: str = Field(alias="class", description="Of the fluent.")


class AuditStatements(_Schema):
    """What a commit changed outside fluents."""

    graph: str = Field(description="IRI of the named graph; empty for the default graph.")
    ontology: str = Field(description="Name of the ontology that was loaded; empty for an update.")
    added: int = Field(description="How many statements came.")
    removed: int = Field(description="How many statements went.")


class AuditCommit(_Schema):
    """Who changed what and when."""

    commit: int = Field(description="Number of the commit.")
    wall_s: float = Field(description="When, in seconds since the Unix epoch.")
    author: str = Field(description="Name of the token, or what the client called itself.")
    reason: str = Field(description="Why, where an admin forced it; otherwise empty.")
    idempotency_key: str | None = Field(description="Of the request.")
    fluents: list[AuditChange]
    statements: list[AuditStatements]


class Audit(_Schema):
    """A part of the audit trail."""

    commits: list[AuditCommit]
    next: int | None = Field(description="What `after` has to be for more; null at the end.")


class FrameReceipt(_Schema):
    """A live frame that is kept."""

    sensor: str = Field(description="Which sent it.")
    index: int = Field(description="Its number among all frames of the sensor.")
    stamp_s: float = Field(description="When it was taken, in seconds.")
    bytes: int = Field(description="Its size.")
    dropped: int = Field(default=0, description="Older frames that made room for it.")


class SensorJson(_Schema):
    """A sensor that sends frames."""

    sensor: str = Field(description="Its name.")
    frames: int = Field(description="How many are kept.")
    bytes: int = Field(description="Size of all of them.")
    oldest: int = Field(description="Number of the first one kept.")
    newest: int = Field(description="Number of the last one sent.")
    stamp_s: float = Field(description="When the newest was taken, in seconds.")


class Sensors(_Schema):
    """All sensors of which frames are kept."""

    sensors: list[SensorJson]


class ClassJson(_Schema):
    """A class of the loaded ontologies."""

    name: str = Field(description="Short name, as in a fluent's `class`.")
    iri: str
    label: str
    superclasses: list[str] = Field(description="Short names of all classes above it.")


class Classes(_Schema):
    """All classes that a fluent may have."""

    classes: list[ClassJson]
    prefixes: dict[str, str] = Field(description="Prefixes that queries need not declare.")


class Health(_Schema):
    """The process is up."""

    status: Literal["up"]
    version: str


class Readiness(_Schema):
    """Whether the board takes reads and writes."""

    status: Literal["ready", "failed"]
    commit: int = Field(description="The last commit that all projections have applied.")
    fluents: int
    failure: str | None = Field(description="Why writes are refused; null if they are not.")


class LiveSubscriptionJson(_Schema):
    """A subscription whose messages are being sent to a client."""

    id: str = Field(description="What the client calls it.")
    client: str = Field(description="Address of the client, if it holds a WebSocket.")
    transport: Literal["websocket", "event-stream"]
    query: str
    mode: Literal["bindings", "fluents", "both"]
    at: Literal["now"] | None = Field(description="now: it sees what holds; null: all times.")
    waiting: int = Field(description="Messages that wait to be sent.")
    evaluation: str = Field(description="How it is evaluated, and why.")


class SeenJson(_Schema):
    """What a subscriber has seen."""

    commit: int
    at: float | None = Field(default=None, description="Of a query at now: the time.")


class WebhookJson(_Schema):
    """Where messages are posted."""

    url: str
    is_paused: bool = Field(description="The address said 410; POST .../resume begins again.")
    is_delivering: bool
    secret: str | None = Field(default=None, description="Told once, when it is made.")


class DurableSubscriptionJson(_Schema):
    """A subscription with a name of its own."""

    name: str
    query: str
    mode: Literal["bindings", "fluents", "both"]
    at: Literal["now"] | None
    certainly: bool
    author: str
    created_s: float = Field(description="In seconds since the Unix epoch.")
    seen: SeenJson | None = Field(description="What its subscriber has acknowledged.")
    webhook: WebhookJson | None = None


class Subscriptions(_Schema):
    """All subscriptions."""

    subscriptions: list[LiveSubscriptionJson]
    durable: list[DurableSubscriptionJson]


class WebhookBody(_Schema):
    """Where to post messages."""

    url: str = Field(examples=["http://127.0.0.1:9000/mugs"])
    secret: str | None = Field(
        default=None, description="`whsec_` and 24 to 64 bytes in base64; made if left out."
    )


class DurableBody(_Schema):
    """A durable subscription as it is asked for."""

    name: str = Field(pattern="^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$", examples=["mugs"])
    query: str = Field(examples=["SELECT ?mug WHERE { ?mug a race:Mug }"])
    mode: Literal["bindings", "fluents", "both"] = "bindings"
    at: Literal["now"] | None = None
    certainly: bool = False
    since: int | None = Field(default=None, ge=0, description="Begin after this commit.")
    since_at: float | None = Field(default=None, description="With at: the time seen last.")
    webhook: WebhookBody | None = None


class PositionBody(_Schema):
    """How far a subscriber has come."""

    position: int | str = Field(description="A commit number, or the id of an event.")


class DeadLetterJson(_Schema):
    """A post that was given up."""

    number: int
    delivery: str = Field(description="The webhook-id that all tries had in common.")
    attempts: int
    reason: str
    failed_s: float
    body: dict[str, Any] = Field(description="What was to be posted.")


class DeadLetters(_Schema):
    """All posts that were given up, the oldest first."""

    dead_letters: list[DeadLetterJson]


class Discarded(_Schema):
    """How many dead letters were forgotten."""

    discarded: int


class RefusedTier(_Schema):
    """A cheaper way to evaluate a query, and what is against it."""

    tier: int
    reason: str


class ConditionJson(_Schema):
    """One pattern of a query, tried on a fluent."""

    pattern: str
    met: bool
    why: str = Field(description="What the fluent says instead; empty if it is met.")


class LastChangeJson(_Schema):
    """The last change of a fluent."""

    commit: int
    event: str
    touched: bool = Field(description="It touched something that the query depends on.")


class FluentExplanation(_Schema):
    """Why a fluent is, or is not, in a result."""

    name: str
    solutions: int = Field(description="Solutions that have it.")
    conditions: list[ConditionJson]
    holds: bool | None = Field(description="It holds now; null if the query sees all times.")
    last_change: LastChangeJson
    verdict: str


class Explanation(_Schema):
    """How a query is evaluated, and why."""

    tier: int = Field(ge=1, le=4)
    reason: str
    concerned_by: str
    refused: list[RefusedTier]
    shapes: list[str] = Field(description="Statements that the query is concerned by.")
    shapes_left_out: int
    changes_with_the_clock: bool
    explanation: str
    fluent: FluentExplanation | None = None


class ProblemJson(BaseModel):
    """An RFC 9457 problem; members beyond these are particulars of the code."""

    model_config = ConfigDict(extra="allow")

    type: str = Field(description="IRI of the kind of problem: it ends in `#` and the code.")
    title: str
    status: int
    detail: str = Field(description="What happened, with the offending value and what to do.")
    code: str = Field(description="Stable; explained in the documentation of errors.")
    message: str = Field(description="The same text as `detail`.")
