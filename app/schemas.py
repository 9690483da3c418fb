"""Bodies of requests and responses."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field

from app.bodies import Body, IntegrationId, Name, Rank, Revision, Scalar, Text
from app.loop_schemas import GraphBody, SearchBody
from app.review import Row

__all__ = [
    "Action",
    "Component",
    "Counts",
    "Created",
    "Criterion",
    "DecisionMade",
    "Decisions",
    "Detail",
    "Failure",
    "HeuristicResult",
    "Integration",
    "LogFacts",
    "MatchingAction",
    "NudgeAt",
    "ParameterList",
    "ParametersChange",
    "ProgressBody",
    "Project",
    "ProjectList",
    "ProjectSummary",
    "Queue",
    "Sample",
    "SampleChoice",
    "SampleList",
    "Threshold",
    "Turn",
    "Turned",
    "ViewOpened",
]

# --- requests -------------------------------------------------------------------------------------


class SampleChoice(Body):
    """Make a project of a sample."""

    sample: Name


class Decisions(Body):
    """Decide integrations, all in one step that can be undone."""

    integrations: Annotated[list[IntegrationId], Field(min_length=1, max_length=100_000)]
    verdict: Literal["accepted", "rejected", "undecided"]
    candidate: Rank | None = None
    """rank of the candidate, 0 for the best; default: the best"""
    heuristic: Name | None = None
    """whose match; default: the project's heuristic"""
    reason: Text = ""
    who: Name = ""
    expected_revision: Revision | None = None
    """the revision the page shows: refused with 409 where somebody decided the same since"""


class NudgeAt(Body):
    """Lay the second scan of a pair by hand."""

    integration: IntegrationId
    pose: tuple[float, float, float] | None = None
    """where it is let go: x, y in metres, theta in radians, in the frame of the first scan"""
    ties: tuple[tuple[Rank, Rank], ...] = Field(default=(), max_length=100)
    """or: segments of the first and of the second scan that are the same wall"""
    reason: Text = ""
    who: Name = ""


class Turn(Body):
    """Undo or redo."""

    who: Name = ""
    expected_revision: Revision | None = None


class ParametersChange(Body):
    """Change parameters, from those in force or from a preset; change the heuristic, and the mode."""

    changes: Annotated[dict[Name, Scalar], Field(default_factory=dict, max_length=200)]
    preset: Name | None = None
    heuristic: Name | None = None
    mode: Name | None = None
    who: Name = ""


class MatchingAction(Body):
    """Stop matching in the background, or go on with it."""

    action: Literal["cancel", "resume"]


class Action(Body):
    """Something a view is asked to do."""

    action: Name
    value: bool | int | float | Text | dict[Name, Any] | list[Any] | None = None


# --- responses ------------------------------------------------------------------------------------


class Failure(BaseModel):
    """What every failure answers with."""

    class Error(BaseModel):
        message: str
        kind: str

    error: Error


class LogFacts(BaseModel):
    """A log of a project."""

    name: str
    format: str
    scans: int
    no_return: float | None = None
    """metres; the reading that stands for "nothing seen" in this log"""
    problems: list[str] = []
    """lines that were left out, and why"""


class Counts(BaseModel):
    """How many integrations there are, and how many in each state."""

    total: int
    accepted: int
    rejected: int
    pending: int
    matching: int = 0
    none: int = 0
    failed: int = 0


class ProjectSummary(BaseModel):
    """A project in the list of projects."""

    id: str
    name: str
    logs: list[LogFacts]
    scans: int
    integrations: Counts
    modified: str
    url: str
    problem: str = ""
    """why the project cannot be opened; empty where it can"""


class ProjectList(BaseModel):
    """All projects, the one changed last first."""

    projects: list[ProjectSummary]


class ExportChoice(BaseModel):
    """A format a merged map can be saved in."""

    name: str
    title: str
    """what people call the format"""
    holds: str
    """what is in such a file, for people"""
    use: str
    """what it is good for"""


class ExportList(BaseModel):
    """What a merged map can be saved as."""

    formats: list[ExportChoice]


class Created(BaseModel):
    """A new project."""

    id: str
    name: str
    url: str
    problems: list[str]
    """what was left out of its logs, and why"""


class Sample(BaseModel):
    """A sample log."""

    name: str
    title: str
    description: str
    scans: int
    picture: str


class SampleList(BaseModel):
    """All samples."""

    samples: list[Sample]


class ParameterList(BaseModel):
    """Every parameter, for forms; and the presets."""

    parameters: list[dict[str, Any]]
    presets: dict[str, dict[str, Any]]


class ProgressBody(BaseModel):
    """How far matching is."""

    done: int
    total: int
    running: int
    cancelled: bool
    message: str


class Component(BaseModel):
    """A connected part of the merged map."""

    name: str
    scans: list[str]
    segments: int
    length: float
    """metres, of all segments"""


class Criterion(BaseModel):
    """What the threshold of a mode is about."""

    parameter: str
    quantity: Literal["value", "confidence"]
    """the field of a row that it works on"""
    unit: str
    maximum: float | None
    step: float
    inclusive: bool


class Project(BaseModel):
    """A project, open."""

    id: str
    name: str
    logs: list[LogFacts]
    parameters: dict[str, Any]
    threshold: float
    criterion: Criterion
    heuristic: str
    heuristics: list[str]
    mode: str
    modes: list[str]
    revision: int
    progress: ProgressBody
    undo: str | None
    redo: str | None
    counts: Counts
    components: list[Component]
    unplaced: list[str]
    """scans without an accepted integration"""
    merging: bool
    """whether the merged map is being computed"""
    search: SearchBody
    graph: GraphBody


class Integration(BaseModel):
    """A row of the review queue."""

    id: str
    first: str
    second: str
    state: Literal["matching", "pending", "accepted", "rejected", "none", "failed"]
    value: float | None
    verdict: Literal["accepted", "review", "rejected"] | None
    above: bool | None
    confidence: float | None
    score: float | None
    supported: float | None
    """metres; the same"""
    contradicted: float | None
    heuristic: str
    candidates: int | None
    milliseconds: float | None
    who: str
    reason: str
    kind: Literal["neighbour", "closure", "imported", "manual"]
    """why the pair is in the queue"""
    residual: float | None
    """metres from where the pose graph has it"""
    turn: float | None
    """radians, the same"""
    chi: float | None
    """standard deviations, of what is accepted"""
    silenced: bool
    """accepted, and the optimiser does not believe it"""
    origin: Literal["found", "claimed", "nudged"]
    """of the pose decided on"""
    later: bool
    """undecided, and somebody skipped it"""

    @classmethod
    def of(cls, row: Row) -> Integration:
        """A row as a body."""
        return cls(**row.to_json())


class Queue(BaseModel):
    """The review queue, the integration that most needs a person first; or what changed in it."""

    tag: str
    """of this queue; asked for ``since`` it, the answer is what changed"""
    since: str | None
    """null: these are all integrations. Otherwise only those that changed since the queue of this tag: to be taken out
    of it where they stand, and put in where they stand now, from the first to the last"""
    places: list[int]
    """where each of these stands now, from 0; empty where they are all"""
    gone: list[str]
    """integrations that are not in the queue any more; the same"""
    integrations: list[Integration]


class HeuristicResult(BaseModel):
    """What a heuristic found on one pair."""

    heuristic: str
    candidates: int
    draws: int | None
    milliseconds: float
    value: float
    confidence: float | None
    pose: tuple[float, float, float] | None


class Detail(BaseModel):
    """One integration in full."""

    row: Integration
    match: dict[str, Any] | None
    claimed: int | None
    """rank of the candidate that was claimed, and not found by our match"""
    nudged: int | None
    """rank of the one that was laid by hand"""
    told: list[str]
    """what the pose graph, and whoever proposed the pair, say of it"""
    heuristics: list[HeuristicResult]


class DecisionMade(BaseModel):
    """What a decision changed."""

    revision: int
    undo: str | None
    redo: str | None
    rows: list[Integration]


class Turned(DecisionMade):
    """What undo or redo did."""

    undone: str | None = None
    redone: str | None = None


class Threshold(BaseModel):
    """What another threshold would change."""

    would_pass: list[str]
    would_fail: list[str]


class ViewOpened(BaseModel):
    """A new view, and where its scene is."""

    id: str
    scene: str
