"""Views: what a page looks at, and what it asks its view to do."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from app.actions import perform
from app.errors import UnknownError
from app.project_schemas import OtherMap, OtherMaps
from app.routes.common import Opened, Site
from app.routes.review import detail
from app.schemas import Action, Detail, ViewOpened

__all__ = ["router"]

router = APIRouter(prefix="/api", tags=["views"])


@router.post("/projects/{project}/views", status_code=201)
def open_view(site: Site, session: Opened) -> ViewOpened:
    """A new view of a project, with a scene of its own."""
    session.get_ready()
    opened = site.views.open(session)
    return ViewOpened(id=opened.id, scene=f"/views/{opened.id}/scene/")


@router.get("/projects/{project}/others")
def others(session: Opened) -> OtherMaps:
    """What the merged map can be compared with: earlier states, other methods."""
    return OtherMaps(options=[OtherMap(**option) for option in session.others.options()])


@router.get("/views/{view}")
def snapshot(site: Site, view: str) -> dict[str, Any]:
    """What a view shows."""
    return site.views.get(view).view.snapshot()


@router.get("/views/{view}/explanation")
def explanation(site: Site, view: str) -> dict[str, Any] | None:
    """Why the candidate shown has its value and its score, term by term; null where none is shown."""
    return site.views.get(view).view.explanation()


@router.get("/views/{view}/detail")
def view_detail(site: Site, view: str) -> Detail:
    """The integration looked at, in full: as the project has it, or as parameters on trial would."""
    found = site.views.get(view)
    integration, match = found.view.looks.integration, found.view.match()
    if integration is None:
        raise UnknownError("There is no pair to look at.")
    return detail(found.session, integration, match)


@router.post("/views/{view}")
def act(site: Site, view: str, body: Action) -> dict[str, Any]:
    """Let a view do something; the answer is what it shows then."""
    found = site.views.get(view).view
    perform(found, body.action, body.value)
    return found.snapshot()


@router.delete("/views/{view}")
def close_view(site: Site, view: str) -> dict[str, Any]:
    """Close a view and its scene."""
    site.views.close(view)
    return {}
