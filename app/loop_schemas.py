"""Bodies of requests and responses about loop closures and the pose graph."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, Field

from app.bodies import Body, IntegrationId, Name, Text

__all__ = ["GraphBody", "ImportedBody", "LoopsAction", "Pairs", "PreviewBody", "SearchBody"]


class LoopsAction(Body):
    """Search for loop closures, or stop the search."""

    action: Literal["start", "cancel"]


class Pairs(Body):
    """Put pairs into the queue by hand: any two scans of the project."""

    integrations: Annotated[list[IntegrationId], Field(min_length=1, max_length=1000)]
    reason: Text = ""
    who: Name = ""


class SearchBody(BaseModel):
    """How far the search for loop closures is; what came of the last one where none runs."""

    running: bool
    done: int
    total: int
    message: str


class Strength(BaseModel):
    """How firmly a component holds together."""

    first: str
    """its first scan"""
    scans: int
    edges: int
    """integrations that count"""
    bridges: list[str]
    """integrations that alone hold two parts together"""
    hanging: int
    """scans that hang on by one integration"""
    cut: list[str]
    """the fewest integrations whose loss splits it"""
    cut_off: int
    """scans that would be lost with them"""
    softest: str
    """the scan whose place is least sure"""
    deviation: float
    """metres, standard deviation of its place"""
    loop: str | None
    """the integration that closes the loop which misses itself most; None where there is none"""
    loop_scans: int
    """scans round that loop"""
    loop_error: float | None
    """metres, by which it misses itself"""
    loop_turn: float | None
    """radians, the same"""


class Silenced(BaseModel):
    """An accepted integration the optimiser does not believe."""

    id: str
    sentence: str


class GraphBody(BaseModel):
    """The pose graph of what is accepted."""

    revision: int
    edges: int
    silenced: list[Silenced]
    strengths: list[Strength]
    """by component"""
    optimising: bool


class ShiftBody(BaseModel):
    """How far a scan would move."""

    scan: str
    translation: float
    rotation: float


class PreviewBody(BaseModel):
    """What accepting a candidate would do to the pose graph."""

    integration: str
    joins: bool
    """two components, or a scan that nothing held"""
    residual: float | None
    turn: float | None
    chi: float | None
    silenced: bool
    """whether the optimiser would not believe it"""
    moved: int
    """scans that would move"""
    shifts: list[ShiftBody]
    """of the scans that would move most"""
    contradicts: list[str]
    """accepted integrations that would be silenced"""
    loop: list[str]
    """the scans of the loop it closes"""
    loop_error: float | None
    """metres, by which that loop misses itself"""
    loop_turn: float | None
    """radians, the same"""
    sentences: list[str]


class ImportedBody(BaseModel):
    """What came of a pose graph that was imported."""

    revision: int
    edges: int
    loops: int
    pairs: int
    """of scans of this project"""
    new: int
    problems: list[str]
    message: str
