"""The two pages; everything on them comes from the JSON API."""

from __future__ import annotations

from fastapi import APIRouter
from fastapi.responses import FileResponse, Response

from app.errors import UnknownError
from app.resources import static_folder
from app.routes.common import Site

__all__ = ["router"]

router = APIRouter(include_in_schema=False)


@router.get("/")
def home() -> FileResponse:
    """Projects, samples, and the place to drop logs."""
    return FileResponse(static_folder() / "index.html")


@router.get("/projects/{project}")
def project_page(project: str, site: Site) -> Response:
    """The workbench on one project."""
    try:
        site.workspace.check(project)
    except UnknownError:  # the page itself says so, and leads back
        return FileResponse(static_folder() / "project.html", 404)
    return FileResponse(static_folder() / "project.html")


@router.get("/favicon.ico")
def favicon() -> FileResponse:
    """For browsers that ask without being told."""
    return FileResponse(static_folder() / "favicon.svg", media_type="image/svg+xml")
