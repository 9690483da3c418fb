"""What happens in a project, as server-sent events: one stream for each page."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Annotated, Any

from fastapi import APIRouter, Query
from fastapi.responses import StreamingResponse

from app.routes.common import Opened, Site
from app.streams import Event, Subscribe
from app.views import OpenView

__all__ = ["of_view", "router"]

router = APIRouter(prefix="/api/projects/{project}", tags=["events"])


@router.get("/events", response_class=StreamingResponse)
def events(site: Site, session: Opened, view: Annotated[str | None, Query(max_length=80)] = None) -> StreamingResponse:
    """Everything that happens in the project, and in one view of it; the view stays open as long as the stream."""
    sources: list[Subscribe] = [session.subscribe]
    holding: list[AbstractContextManager[Any]] = []
    if view is not None:
        sources.append(of_view(site.views.get(view)))
        holding.append(site.views.watched(view))
    first = {"type": "hello", "revision": session.state.revision}
    return StreamingResponse(
        site.streams.stream(sources, first=first, holding=holding),
        media_type="text/event-stream",
        headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"},
    )


def of_view(opened: OpenView) -> Subscribe:
    """The events of a view, each with the view's id."""

    def subscribe(callback: Callable[[Event], None]) -> Callable[[], None]:
        return opened.view.subscribe(lambda event: callback({**event, "view": opened.id}))

    return subscribe
