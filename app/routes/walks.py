"""Walkthroughs: their stages, their steps one by one."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query
from fastapi.responses import FileResponse, Response

from app.errors import RequestError, UnknownError
from app.lesson import lesson_document
from app.resources import static_folder
from app.routes.common import Site
from app.routes.projects import attached
from app.walk_files import KINDS, MOST_FRAMES, walk_file
from app.walks import STEPS, Asked, Made, Subject, choices, document, stage_document, subject_of
from segmap.parameters import describe
from segmap.walkthrough import SWEPT, Stage, race, sweep

__all__ = ["AskedStage", "made_of", "router", "some_steps", "stage_of"]

router = APIRouter(tags=["walkthrough"])


class AskedStage(Asked):
    """A stage of a walkthrough."""

    stage: Annotated[str, Query(max_length=80)] = ""


class AskedSteps(AskedStage):
    """Some steps of a stage, beginning with one."""

    start: Annotated[int, Query(ge=0, le=10**9)] = 0
    count: Annotated[int, Query(ge=1, le=STEPS)] = 1


@router.get("/walk", include_in_schema=False)
def walk_page() -> FileResponse:
    """The player."""
    return FileResponse(static_folder() / "walk.html")


@router.get("/api/lesson")
def lesson() -> dict[str, Any]:
    """The stops of the guided lesson, each with the address of its view."""
    return lesson_document()


@router.get("/api/walk")
def overview(site: Site, asked: Annotated[Asked, Query()]) -> dict[str, Any]:
    """A walkthrough without its steps: stages, lines of the algorithms, what its pictures share."""
    subject, made = site.walks.get(asked, site.workspace)
    return document(made.walk, choices(subject))


@router.get("/api/walk/stage")
def stage(site: Site, asked: Annotated[AskedStage, Query()]) -> dict[str, Any]:
    """A stage that is made when somebody enters it, such as one candidate pair by pair."""
    return stage_document(stage_of(made_of(site, asked), asked.stage))


@router.get("/api/walk/steps")
def steps(site: Site, asked: Annotated[AskedSteps, Query()]) -> dict[str, Any]:
    """Steps of a stage, any of them without those before."""
    return some_steps(stage_of(made_of(site, asked), asked.stage), asked.start, asked.count)


class AskedFile(AskedStage):
    """A walkthrough, or the pictures of one of its stages, as a file."""

    most: Annotated[int, Query(ge=1, le=400)] = MOST_FRAMES


@router.get("/api/walk/file/{kind}", response_class=Response)
def file(
    site: Site, kind: Annotated[str, Path(description=" or ".join(KINDS))], asked: Annotated[AskedFile, Query()]
) -> Response:
    """A walkthrough as one HTML file that plays offline, as numbered PNGs, or as an animated GIF."""
    made = made_of(site, asked)
    found = walk_file(made.walk, kind, asked.stage, asked.most)
    return Response(found.content, media_type=found.media_type, headers=attached(made.walk.title, found.suffix))


class AskedSweep(Asked):
    """One parameter through its range."""

    parameter: Annotated[str, Query(max_length=80)] = "point_distance_tolerance"


@router.get("/api/walk/race")
def heuristic_race(site: Site, asked: Annotated[Asked, Query()]) -> dict[str, Any]:
    """Every heuristic of both modes on one pair: tries, time, value, right or wrong where the truth is known."""
    subject = _pair_of(site, asked)
    runs = race(subject.pair_under, subject.truth, subject.parameters if asked.set else None)
    return {"truth": subject.truth is not None, "runs": [asdict(run) for run in runs]}


@router.get("/api/walk/sweep")
def parameter_sweep(site: Site, asked: Annotated[AskedSweep, Query()]) -> dict[str, Any]:
    """One pair with one parameter at several values."""
    subject = _pair_of(site, asked)
    how = subject.parameters, subject.heuristic, subject.mode, asked.parameter
    runs = list(sweep(subject.pair_under, subject.truth, *how))
    (unit,) = (told["unit"] for told in describe() if told["name"] == asked.parameter)
    swept = {"parameter": asked.parameter, "unit": unit, "parameters": list(SWEPT)}
    now = getattr(subject.parameters, asked.parameter)
    return {**swept, "now": now, "truth": subject.truth is not None, "runs": [asdict(run) for run in runs]}


def _pair_of(site: Site, asked: Asked) -> Subject:
    subject = subject_of(asked, site.workspace)
    if subject.merging or subject.edges is not None:
        raise RequestError("Heuristics race, and parameters are swept, on one pair of scans.")
    return subject


def made_of(site: Site, asked: AskedStage) -> Made:
    """The walkthrough a request is about."""
    only = Asked(**{name: getattr(asked, name) for name in Asked.model_fields})
    return site.walks.get(only, site.workspace)[1]


def stage_of(made: Made, id: str) -> Stage:
    """A stage of it. Raises UnknownError where there is none."""
    found = made.walk.stage(id)
    if found is None:
        raise UnknownError(f"This walkthrough has no stage {id!r}.")
    return found


def some_steps(held: Stage, start: int, count: int) -> dict[str, Any]:
    """Steps of a stage as an answer.

    Raises:
        UnknownError: the stage has fewer.
    """
    if start >= held.count:
        raise UnknownError(f"The stage {held.id!r} has {held.count} steps; there is no step {start}.")
    last = min(held.count, start + count)
    return {"start": start, "steps": [held.step(k).to_json() for k in range(start, last)]}
