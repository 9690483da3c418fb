"""Following a view: who has the link sees what it shows, as it changes, and can change nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from fastapi import APIRouter
from fastapi.responses import FileResponse, Response, StreamingResponse

from app.errors import UnknownError
from app.project_schemas import Followed, Shared
from app.resources import static_folder
from app.routes.common import Site, page_of
from app.streams import Event, Subscribe
from app.views import OpenView

__all__ = ["router"]

router = APIRouter(tags=["views"])


@router.post("/api/views/{view}/share")
def share(site: Site, view: str) -> Shared:
    """The links of a view: one to steer it together, one to follow it."""
    found = site.views.share(view)
    return Shared(steer=f"{page_of(found.session.id)}?view={found.id}", follow=f"/follow/{found.follow}")


@router.get("/follow/{token}", include_in_schema=False)
def page(site: Site, token: str) -> Response:
    """The page of who follows."""
    try:
        site.views.followed(token)
    except UnknownError:  # the page itself says so
        return FileResponse(static_folder() / "follow.html", 404)
    return FileResponse(static_folder() / "follow.html")


@router.get("/follow/{token}/view")
def followed(site: Site, token: str) -> Followed:
    """What is followed, and where its scene is."""
    found = site.views.followed(token)
    return Followed(
        project=found.session.state.name, scene=f"/follow/{token}/scene/", snapshot=told(found.view.snapshot())
    )


@router.get("/follow/{token}/events", response_class=StreamingResponse)
def events(site: Site, token: str) -> StreamingResponse:
    """What the view shows, again whenever that changes; of the project nothing else."""
    found = site.views.followed(token)
    stream = site.streams.stream([_of_audience(found)], first={"type": "hello"}, holding=[site.views.watched(token)])
    headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    return StreamingResponse(stream, media_type="text/event-stream", headers=headers)


def _of_audience(found: OpenView) -> Subscribe:
    """The events of a view without its id, which would let whoever knows it steer."""

    def subscribe(callback: Callable[[Event], None]) -> Callable[[], None]:
        return found.view.subscribe(lambda event: callback({"type": "view", **told(event)}))

    return subscribe


def told(snapshot: Mapping[str, Any]) -> dict[str, Any]:
    """What those who follow are told: what is shown, not what could be done."""
    return {name: snapshot[name] for name in ("serial", "integration", "names", "stage", "theme", "messages")}
