"""Keeping projects: other names, copies, deletions that can be undone, and more logs."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, File, UploadFile

from app.creation import Source
from app.project_schemas import Copying, DeletedList, DeletedProject, LogsAdded, Renaming
from app.routes.common import Opened, Site, page_of
from app.schemas import Created

__all__ = ["router"]

router = APIRouter(prefix="/api", tags=["projects"])


@router.patch("/projects/{project}")
def rename(site: Site, project: str, body: Renaming) -> Created:
    """Give a project another name."""
    site.workspace.rename(project, body.name, body.who)
    return Created(id=project, name=body.name, url=page_of(project), problems=[])


@router.post("/projects/{project}/duplicate", status_code=201)
def duplicate(site: Site, project: str, body: Copying) -> Created:
    """A copy of a project as it is now: logs, decisions and history."""
    made = site.workspace.duplicate(project, body.name.strip(), body.who)
    return Created(id=made.id, name=made.name, url=page_of(made.id), problems=[])


@router.delete("/projects/{project}")
def delete(site: Site, project: str) -> DeletedList:
    """Set a project aside; it can be had back. Whoever looks at it is told."""
    site.delete(project)
    return deleted(site)


@router.get("/deleted")
def deleted(site: Site) -> DeletedList:
    """The projects that were deleted and can be had back."""
    return DeletedList(
        projects=[
            DeletedProject(
                id=held.id,
                name=held.state.name if held.state else held.path.stem,
                modified=held.state.modified if held.state else "",
                problem=held.problem,
            )
            for held in site.workspace.deleted()
        ]
    )


@router.post("/deleted/{project}/restore")
def restore(site: Site, project: str) -> Created:
    """Undo the deletion of a project."""
    site.workspace.restore(project)
    held = site.workspace.summary(project)
    name = held.state.name if held.state else held.path.stem
    return Created(id=project, name=name, url=page_of(project), problems=[])


@router.delete("/deleted/{project}")
def remove(site: Site, project: str) -> DeletedList:
    """Remove a deleted project for good."""
    site.workspace.remove(project)
    return deleted(site)


@router.post("/projects/{project}/logs")
def add_logs(session: Opened, files: Annotated[list[UploadFile], File(max_length=64)]) -> LogsAdded:
    """Put more logs into a project; what is decided stays as it is."""
    sources = [Source(upload.filename or "log", upload.file) for upload in files]
    added = session.add_logs(sources)
    return LogsAdded(
        revision=session.state.revision,
        logs=[log.name for log in added.logs.values()],
        scans=sum(len(log) for log in added.logs.values()),
        problems=list(added.problems),
    )
