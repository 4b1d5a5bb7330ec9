"""What is said of fluents, in bodies and replies; the types that all schemas are made of."""

from __future__ import annotations

from typing import Annotated, Literal

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


class Schema(BaseModel):
    """An object whose members are all known."""

    model_config = ConfigDict(extra="forbid")


class PropertyJson(Schema):
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


class FluentBody(Schema):
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


class FluentJson(Schema):
    """A fluent as the board tells it."""

    name: str
    class_: str = Field(alias="class")
    start: IntervalPair
    finish: IntervalPair
    properties: list[PropertyJson]
    version: int = Field(description="Number of the commit that changed it last.")
    author: str = Field(description="Who made that commit.")
    created: int = Field(description="Number of the commit that asserted it.")


class FluentBatch(Schema):
    """Several fluents, all of them or none."""

    fluents: list[FluentBody]


class AssertedFluent(Schema):
    """What became of one asserted fluent."""

    name: str
    version: int = Field(description="Number of the commit that changed it last.")
    created: int = Field(description="Number of the commit that asserted it.")


class AssertReceipt(Schema):
    """What an assertion led to."""

    commit: int = Field(
        description="Number of the commit; the last one's if the board held all of it already."
    )
    fluents: list[AssertedFluent] = Field(description="In the order in which they were sent.")
    warnings: list[str] = Field(
        description="What is allowed but perhaps not meant: undeclared properties, references to "
        "fluents that are not on the board."
    )


class AssertCommand(Schema):
    """Puts a fluent on the board."""

    op: Literal["assert"]
    fluent: FluentBody
    merge: bool = Field(
        default=False, description="Refine the fluent of that name if there is one."
    )


class RefineCommand(Schema):
    """Narrows intervals, adds property values."""

    op: Literal["refine"]
    name: str
    start: IntervalLike = None
    finish: IntervalLike = None
    properties: list[PropertyLike] = []
    version: int | None = Field(
        default=None, description="Refuse unless the fluent is at this version."
    )


class EndCommand(Schema):
    """Says when a fluent ceased to hold."""

    op: Literal["end"]
    name: str
    finish: IntervalPair | float
    version: int | None = Field(
        default=None, description="Refuse unless the fluent is at this version."
    )


class CommandBatch(Schema):
    """Several commands, all of them or none."""

    commands: list[Annotated[AssertCommand | RefineCommand | EndCommand, Field(discriminator="op")]]


EventKind = Literal["added", "refined", "ended", "corrected"]


class EventJson(Schema):
    """What happened to one fluent."""

    event: EventKind
    fluent: FluentJson = Field(description="As it stands since then.")


class CommandsReceipt(Schema):
    """What a batch led to."""

    commit: int
    events: list[EventJson] = Field(
        description="In the order of the commands; commands that changed nothing have none."
    )
    warnings: list[str]


class ChangeReceipt(Schema):
    """What changing one fluent led to."""

    commit: int
    fluent: FluentJson
    warnings: list[str]


class FluentPage(Schema):
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


class History(Schema):
    """All changes of a fluent, oldest first."""

    name: str
    history: list[HistoryEntry]


class RefinementBody(Schema):
    """What a refinement changes; what is left out stays."""

    start: IntervalLike = None
    finish: IntervalLike = None
    properties: list[PropertyLike] = []


class EndingBody(Schema):
    """When a fluent ceased to hold."""

    at: IntervalPair | float | Literal["now"] = Field(
        default="now", description="A time, the interval it lies in, or `now`."
    )


class ImportReceipt(Schema):
    """What an import led to."""

    commit: int = Field(description="Number of the last commit.")
    commits: int = Field(description="How many commits it took.")
    fluents: int = Field(description="How many fluents were read.")
    changed: int = Field(description="How many of them were new, or said something new.")
    statements: int = Field(
        default=0, description="How many statements outside fluents the board did not say before."
    )
    warnings: list[str] = Field(description="At most 100 of them.")
