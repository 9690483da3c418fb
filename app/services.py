"""What the routes work with: one of each for a server."""

from __future__ import annotations

from dataclasses import dataclass, field

from app.classes import Classes
from app.jobs import WarmUp
from app.streams import Streams
from app.views import Views
from app.walks import Walks
from app.workspace import Workspace

__all__ = ["Services"]


@dataclass(frozen=True)
class Services:
    """The projects, the open views, the event streams, the walkthroughs, the classes, and the kernels' compilation."""

    workspace: Workspace
    views: Views = field(default_factory=Views)
    streams: Streams = field(default_factory=Streams)
    walks: Walks = field(default_factory=Walks)
    classes: Classes = field(default_factory=Classes)
    warm_up: WarmUp | None = None

    def start(self) -> None:
        """Begin what must not wait for the first page."""
        if self.warm_up is not None:
            self.warm_up.start()

    def delete(self, project: str) -> None:
        """Close the views of a project and set it aside. Raises UnknownError where there is none."""
        session = self.workspace.open_session(project)
        if session is not None:
            self.views.close_of(session)
        self.workspace.delete(project)

    def tend(self) -> None:
        """What is to be done every few seconds: let go what nobody uses, hear what other programs wrote."""
        self.views.reap()
        self.workspace.tend()

    def close(self) -> None:
        """Close scenes, sessions and processes."""
        if self.warm_up is not None:
            self.warm_up.close()
        self.views.close_all()
        self.workspace.close()
