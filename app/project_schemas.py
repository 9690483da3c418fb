"""Bodies of requests and responses about keeping projects: names, copies, deletions, more logs."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, Field, StringConstraints

from app.bodies import Body, Name

__all__ = [
    "Copying",
    "DeletedList",
    "DeletedProject",
    "Followed",
    "LogsAdded",
    "NewProject",
    "OtherMap",
    "OtherMaps",
    "Renaming",
    "Shared",
]

Title = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=200)]


class NewProject(Body):
    """Make a project without logs."""

    name: Title


class Renaming(Body):
    """Give a project another name."""

    name: Title
    who: Name = ""


class Copying(Body):
    """Make a copy of a project."""

    name: Annotated[str, Field(max_length=200)] = ""
    """of the copy; default: the name of the original, marked as a copy"""
    who: Name = ""


class DeletedProject(BaseModel):
    """A project that was deleted and can be had back."""

    id: str
    name: str
    modified: str
    problem: str = ""


class DeletedList(BaseModel):
    """The deleted projects."""

    projects: list[DeletedProject]


class OtherMap(BaseModel):
    """A map the merged one can be compared with."""

    name: str
    title: str


class OtherMaps(BaseModel):
    """What the merged map can be compared with."""

    options: list[OtherMap]


class Shared(BaseModel):
    """The addresses of a shared view."""

    steer: str
    """who has it sees the same and may change it"""
    follow: str
    """who has it sees the same"""


class Followed(BaseModel):
    """A view that is followed."""

    project: str
    """its name"""
    scene: str
    snapshot: dict[str, Any]


class LogsAdded(BaseModel):
    """What was added to a project."""

    revision: int
    logs: list[str]
    """names of the logs that were added"""
    scans: int
    problems: list[str]
    """files and lines that were left out, and why"""
