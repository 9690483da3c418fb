"""Classes that follow a walkthrough: opened and led by a teacher; who has the link looks on, without any token.

What is answered to those who follow is of the walkthrough the class is at, whatever they ask for.
"""

from __future__ import annotations

from typing import Annotated, Any
from urllib.parse import parse_qsl

from fastapi import APIRouter, Path, Query
from fastapi.responses import FileResponse
from pydantic import Field

from app.bodies import Body, Name
from app.resources import static_folder
from app.routes.common import Site
from app.routes.walks import some_steps, stage_of
from app.walks import STEPS, Asked, Made, Subject, choices, document, stage_document

__all__ = ["router"]

router = APIRouter(tags=["walkthrough"])

ClassId = Annotated[str, Path(max_length=40)]
StageId = Annotated[str, Query(max_length=80)]


class Place(Body):
    """Where a walkthrough is: its address after the question mark."""

    place: Annotated[str, Field(min_length=1, max_length=2000)]


class Led(Place):
    """Where a class is led, by whoever shared it."""

    key: Name


@router.post("/api/classes", status_code=201)
def open_class(site: Site, body: Place) -> dict[str, Any]:
    """Share a walkthrough: an id for the link of those who follow, and the key of the one who leads."""
    made = site.classes.open(body.place)
    return {"id": made.id, "key": made.key}


@router.get("/follow/walk/{id}/place")
def followed(site: Site, id: ClassId) -> dict[str, Any]:
    """Where a class is; ``serial`` grows with every move."""
    found = site.classes.get(id)
    return {"place": found.place, "serial": found.serial}


@router.post("/api/classes/{id}")
def lead(site: Site, id: ClassId, body: Led) -> dict[str, Any]:
    """Lead a class on."""
    return {"serial": site.classes.move(id, body.key, body.place).serial}


# --- for those who follow ---------------------------------------------------------------------------


@router.get("/follow/walk/{id}", include_in_schema=False)
def follow_page() -> FileResponse:
    """The player without its controls."""
    return FileResponse(static_folder() / "walk.html")


@router.get("/follow/walk/{id}/api")
def overview(site: Site, id: ClassId) -> dict[str, Any]:
    """The walkthrough a class is at, without its steps."""
    subject, made = _walked(site, id)
    return document(made.walk, choices(subject))


@router.get("/follow/walk/{id}/api/stage")
def stage(site: Site, id: ClassId, stage: StageId) -> dict[str, Any]:
    """A stage of it that is made when entered."""
    return stage_document(stage_of(_walked(site, id)[1], stage))


@router.get("/follow/walk/{id}/api/steps")
def steps(
    site: Site,
    id: ClassId,
    stage: StageId,
    start: Annotated[int, Query(ge=0, le=10**9)] = 0,
    count: Annotated[int, Query(ge=1, le=STEPS)] = 1,
) -> dict[str, Any]:
    """Steps of one of its stages."""
    return some_steps(stage_of(_walked(site, id)[1], stage), start, count)


def _walked(site: Site, id: str) -> tuple[Subject, Made]:
    """What a class is at."""
    told = parse_qsl(site.classes.get(id).place)
    held: dict[str, Any] = {name: value for name, value in told if name in Asked.model_fields and name != "set"}
    asked = Asked(**held, set=tuple(value for name, value in told if name == "set"))
    return site.walks.get(asked, site.workspace)
