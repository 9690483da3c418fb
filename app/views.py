"""The views that are open: capped in number, closed when no page has looked at them for a while."""

from __future__ import annotations

import secrets
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from app.errors import BusyError, UnknownError

if TYPE_CHECKING:
    from app.scene import Scene
    from app.session import Session
    from app.workbench import View

__all__ = ["OpenView", "Views", "open_audience", "open_scene"]

LIMIT = 24
IDLE_SECONDS = 60.0


@dataclass(eq=False)
class OpenView:
    """A view, the scene that shows it, and the pages that listen to it."""

    id: str
    session: Session
    view: View
    scene: Scene
    touched: float
    pages: int = field(default=0)
    follow: str = ""
    """what the view is known by to those who may only look; empty: nobody may"""
    audience: Scene | None = None
    """the scene that shows them what the view shows"""


def open_scene(session: Session) -> tuple[View, Scene]:
    """A view of a session and its scene; viser is imported only here, when the first page needs it."""
    from app.scene import Scene
    from app.workbench import View

    view = View(session)
    return view, Scene(view)


def open_audience(opened: OpenView) -> Scene:
    """A second scene of a view that takes no orders, and looks where the first one looks."""
    from app.scene import Scene

    audience = Scene(opened.view, audience=True)
    opened.scene.lead(audience)
    return audience


class Views:
    """All open views by id. Ids are not guessable: who knows one may steer the view."""

    def __init__(
        self,
        make: Callable[[Session], tuple[View, Scene]] = open_scene,
        *,
        make_audience: Callable[[OpenView], Scene] = open_audience,
        limit: int = LIMIT,
        idle_seconds: float = IDLE_SECONDS,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._make, self._limit, self._idle_seconds, self._clock = make, limit, idle_seconds, clock
        self._make_audience = make_audience
        self._lock, self._opening_audience = threading.Lock(), threading.Lock()
        self._views: dict[str, OpenView] = {}
        self._opening = 0

    def __len__(self) -> int:
        return len(self._views)

    def open(self, session: Session) -> OpenView:
        """A new view of a session.

        Raises:
            BusyError: too many are open, and a page looks at each of them.
        """
        self._make_room()
        try:
            view, scene = self._make(session)
            opened = OpenView(secrets.token_urlsafe(12), session, view, scene, self._clock())
            with self._lock:
                self._views[opened.id] = opened
            return opened
        finally:
            with self._lock:
                self._opening -= 1

    def get(self, id: str) -> OpenView:
        """The view of an id.

        Raises:
            UnknownError: there is none (any more).
        """
        with self._lock:
            found = self._views.get(id)
            if found is None:
                raise UnknownError("This view is closed: load the page again.")
            found.touched = self._clock()
            return found

    def share(self, id: str) -> OpenView:
        """Let others follow a view: it has a name for them from now on. Raises UnknownError where there is none."""
        found = self.get(id)
        with self._lock:
            found.follow = found.follow or secrets.token_urlsafe(16)
        return found

    def followed(self, token: str) -> OpenView:
        """The view that is followed by this name.

        Raises:
            UnknownError: there is none (any more).
        """
        with self._lock:
            found = next((one for one in self._views.values() if one.follow and one.follow == token), None)
            if found is None:
                raise UnknownError("The view you follow has ended: ask for a new link.")
            found.touched = self._clock()
            return found

    def audience_of(self, token: str) -> Scene:
        """The scene of those who follow a view; made when the first of them comes. Raises UnknownError."""
        found = self.followed(token)
        with self._opening_audience:
            if found.audience is None:
                found.audience = self._make_audience(found)
            return found.audience

    @contextmanager
    def watched(self, id: str) -> Iterator[OpenView]:
        """Keep a view open while a page listens to it; ``id`` may be the name it is followed by."""
        found = self.get(id) if id in self._views else self.followed(id)
        with self._lock:
            found.pages += 1
        try:
            yield found
        finally:
            with self._lock:
                found.pages -= 1
                found.touched = self._clock()

    def close(self, id: str) -> None:
        """Close a view and its scene; one that is closed already stays so."""
        with self._lock:
            found = self._views.pop(id, None)
        if found is not None:
            _close(found)

    def close_all(self) -> None:
        """Close every view."""
        for id in list(self._views):
            self.close(id)

    def close_of(self, session: Session) -> None:
        """Close every view of a session."""
        for found in list(self._views.values()):
            if found.session is session:
                self.close(found.id)

    def reap(self) -> None:
        """Close the views no page has listened to or asked for lately."""
        before = self._clock() - self._idle_seconds
        for found in self._unwatched():
            if found.touched <= before:
                self.close(found.id)

    def _unwatched(self) -> list[OpenView]:
        """Views without a page, the one left longest first."""
        with self._lock:
            return sorted((v for v in self._views.values() if v.pages == 0), key=lambda v: v.touched)

    def _make_room(self) -> None:
        """Take a place, by closing the view left longest if none is free."""
        while True:
            with self._lock:
                if len(self._views) + self._opening < self._limit:
                    self._opening += 1
                    return
            unwatched = self._unwatched()
            if not unwatched:
                raise BusyError(f"{self._limit} views are open, as many as this server keeps: close a page first.")
            self.close(unwatched[0].id)


def _close(opened: OpenView) -> None:
    """The scenes first: they listen to the view."""
    if opened.audience is not None:
        opened.audience.close()
    opened.scene.close()
    close = getattr(opened.view, "close", None)
    if close is not None:
        close()
