"""What several routes need: the services, and the session a path names."""

from __future__ import annotations

from typing import Annotated, cast
from urllib.parse import quote

from fastapi import Depends, Path
from starlette.requests import HTTPConnection

from app.services import Services
from app.session import Session

__all__ = ["Opened", "Site", "page_of"]


def _services(connection: HTTPConnection) -> Services:
    return cast(Services, connection.app.state.services)


Site = Annotated[Services, Depends(_services)]


def _session(project: Annotated[str, Path(max_length=80)], site: Site) -> Session:
    """The session of a project; opened now if it is not open. Runs in a thread."""
    return site.workspace.session(project)


def page_of(project: str) -> str:
    """The address of a project's page."""
    return f"/projects/{quote(project)}"


Opened = Annotated[Session, Depends(_session)]
