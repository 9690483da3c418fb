"""Walkthroughs: their stages, their steps one by one."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Path, Query
from fastapi.responses import FileResponse, Response

from app.errors import UnknownError
from app.resources import static_folder
from app.routes.common import Site
from app.routes.projects import attached
from app.walk_files import KINDS, MOST_FRAMES, walk_file
from app.walks import STEPS, Asked, Made, choices, document, stage_document
from segmap.walkthrough import Stage

__all__ = ["router"]

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


@router.get("/api/walk")
def overview(site: Site, asked: Annotated[Asked, Query()]) -> dict[str, Any]:
    """A walkthrough without its steps: stages, lines of the algorithms, what its pictures share."""
    subject, made = site.walks.get(asked, site.workspace)
    return document(made.walk, choices(subject))


@router.get("/api/walk/stage")
def stage(site: Site, asked: Annotated[AskedStage, Query()]) -> dict[str, Any]:
    """A stage that is made when somebody enters it, such as one candidate pair by pair."""
    return stage_document(_stage(_made(site, asked), asked.stage))


@router.get("/api/walk/steps")
def steps(site: Site, asked: Annotated[AskedSteps, Query()]) -> dict[str, Any]:
    """Steps of a stage, any of them without those before."""
    held = _stage(_made(site, asked), asked.stage)
    if asked.start >= held.count:
        raise UnknownError(f"The stage {held.id!r} has {held.count} steps; there is no step {asked.start}.")
    last = min(held.count, asked.start + asked.count)
    return {"start": asked.start, "steps": [held.step(k).to_json() for k in range(asked.start, last)]}


class AskedFile(AskedStage):
    """A walkthrough, or the pictures of one of its stages, as a file."""

    most: Annotated[int, Query(ge=1, le=400)] = MOST_FRAMES


@router.get("/api/walk/file/{kind}", response_class=Response)
def file(
    site: Site, kind: Annotated[str, Path(description=" or ".join(KINDS))], asked: Annotated[AskedFile, Query()]
) -> Response:
    """A walkthrough as one HTML file that plays offline, as numbered PNGs, or as an animated GIF."""
    made = _made(site, asked)
    found = walk_file(made.walk, kind, asked.stage, asked.most)
    return Response(found.content, media_type=found.media_type, headers=attached(made.walk.title, found.suffix))


def _made(site: Site, asked: AskedStage) -> Made:
    only = Asked(**{name: getattr(asked, name) for name in Asked.model_fields})
    return site.walks.get(only, site.workspace)[1]


def _stage(made: Made, id: str) -> Stage:
    found = made.walk.stage(id)
    if found is None:
        raise UnknownError(f"This walkthrough has no stage {id!r}.")
    return found
