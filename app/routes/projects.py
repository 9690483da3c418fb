"""Projects: the list, new ones, what one holds, and its files."""

from __future__ import annotations

import shutil
import tempfile
from collections import Counter
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import quote

from fastapi import APIRouter, Depends, Query
from fastapi.exceptions import RequestValidationError
from fastapi.responses import FileResponse, Response
from pydantic import TypeAdapter, ValidationError
from starlette.background import BackgroundTask
from starlette.datastructures import UploadFile
from starlette.requests import Request

from app.creation import Source
from app.errors import UnknownError
from app.loop_schemas import GraphBody, SearchBody
from app.merged import exportable
from app.pairs import pairs_in
from app.project_schemas import NewProject
from app.routes.common import Opened, Site, page_of
from app.schemas import (
    Component,
    Counts,
    Created,
    Criterion,
    ExportChoice,
    ExportList,
    LogFacts,
    ParameterList,
    ProgressBody,
    Project,
    ProjectList,
    ProjectSummary,
    Sample,
    SampleChoice,
    SampleList,
)
from app.session import Session
from app.workspace import Summary
from segmap.export import FORMATS, RESOLUTION, export_files, in_one
from segmap.integration import MODES, heuristics
from segmap.logs import base_name
from segmap.merging import Component as MapComponent
from segmap.parameters import PRESETS, describe
from segmap.project import ProjectState

__all__ = ["attached", "router"]

router = APIRouter(prefix="/api", tags=["projects"])

FILES = 64
"""most files of one upload"""
MERGING_SECONDS = 120.0
Resolution = Annotated[float, Query(gt=0.0, le=1000.0, allow_inf_nan=False, description="Metres a cell of a grid map.")]
SVG_POLICY = "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'self'; sandbox"


# --- all projects ---------------------------------------------------------------------------------


@router.get("/projects")
def projects(site: Site) -> ProjectList:
    """All projects, the one changed last first."""
    return ProjectList(projects=[_summary(summary) for summary in site.workspace.summaries()])


def _summary(summary: Summary) -> ProjectSummary:
    state = summary.state or ProjectState(name=summary.path.stem)
    verdicts = Counter(decision.verdict for decision in state.decisions.values())
    total = pairs_in(state)
    counts = Counts(total=total, **{v: verdicts[v] for v in ("accepted", "rejected")}, pending=total - verdicts.total())
    return ProjectSummary(
        id=summary.id,
        name=state.name,
        logs=[LogFacts(name=log.name, format=log.format, scans=log.scans) for log in state.logs],
        scans=sum(log.scans for log in state.logs),
        integrations=counts,
        modified=state.modified,
        url=page_of(summary.id),
        problem=summary.problem,
    )


async def _what_to_make(request: Request) -> AsyncIterator[list[UploadFile] | SampleChoice | NewProject]:
    """Uploaded files, spooled to disk as they come in and gone afterwards; or the name of a sample, or of a project."""
    if request.headers.get("content-type", "").startswith("multipart/form-data"):
        async with request.form(max_files=FILES, max_fields=FILES) as form:
            yield [file for file in form.getlist("files") if isinstance(file, UploadFile)]
    else:
        yield _choice(await request.body())


_CHOICE: TypeAdapter[SampleChoice | NewProject] = TypeAdapter(SampleChoice | NewProject)


def _choice(body: bytes) -> SampleChoice | NewProject:
    try:
        return _CHOICE.validate_json(body)
    except ValidationError as error:
        raise RequestValidationError(error.errors()) from None


@router.post(
    "/projects",
    status_code=201,
    openapi_extra={
        "requestBody": {
            "content": {
                "multipart/form-data": {
                    "schema": {
                        "type": "object",
                        "required": ["files"],
                        "properties": {"files": {"type": "array", "items": {"type": "string", "format": "binary"}}},
                    }
                },
                "application/json": {"schema": _CHOICE.json_schema()},
            },
            "required": True,
        }
    },
)
def create(site: Site, wanted: Annotated[Any, Depends(_what_to_make)]) -> Created:
    """A project of uploaded logs, of an uploaded project file, of a sample, or without logs."""
    if isinstance(wanted, SampleChoice):
        made = site.workspace.create_sample(wanted.sample)
    elif isinstance(wanted, NewProject):
        made = site.workspace.create_empty(wanted.name)
    else:
        made = site.workspace.create([Source(upload.filename or "log", upload.file) for upload in wanted])
    return Created(id=made.id, name=made.name, url=page_of(made.id), problems=list(made.problems))


@router.get("/samples")
def samples(site: Site) -> SampleList:
    """The sample logs that come with the program."""
    return SampleList(
        samples=[
            Sample(
                name=sample.name,
                title=sample.title,
                description=sample.description,
                scans=sample.scans,
                picture=f"/api/samples/{quote(sample.name, safe='')}/picture.svg",
            )
            for sample in site.workspace.samples.all()
        ]
    )


@router.get("/samples/{sample}/picture.svg", response_class=Response)
def sample_picture(site: Site, sample: str) -> Response:
    """The walls a sample was made from."""
    found = site.workspace.samples.get(sample)
    return _svg(site.workspace.samples.picture(found))


@router.get("/parameters")
def parameter_list() -> ParameterList:
    """Every parameter with unit, bounds and help; and the presets."""
    presets = {name: parameters.model_dump(mode="json") for name, parameters in PRESETS.items()}
    return ParameterList(parameters=describe(), presets=presets)


# --- one project ----------------------------------------------------------------------------------


@router.get("/projects/{project}")
def project(session: Opened) -> Project:
    """A project: what it holds, how far it is, and the parts of its map."""
    state, parts = session.state, session.components()
    return Project(
        id=session.id,
        name=state.name,
        logs=[_log(session, index) for index in range(len(state.logs))],
        parameters=state.parameters.model_dump(mode="json"),
        threshold=session.criterion.threshold(state.parameters),
        criterion=Criterion(**session.criterion.to_json()),
        heuristic=state.heuristic,
        heuristics=list(heuristics(state.mode)),
        mode=state.mode,
        modes=list(MODES),
        revision=state.revision,
        progress=ProgressBody(**session.progress.to_json()),
        undo=state.can_undo,
        redo=state.can_redo,
        counts=Counts(**session.counts()),
        components=[_component(part) for part in parts],
        unplaced=_unplaced(session, parts),
        merging=session.merging,
        search=SearchBody(**session.loops.progress.to_json()),
        graph=GraphBody(**session.loops.graph.to_json(), optimising=session.loops.optimising),
    )


def _log(session: Session, index: int) -> LogFacts:
    info, facts = session.state.logs[index], session.log_facts(index)
    return LogFacts(
        name=info.name,
        format=info.format,
        scans=info.scans,
        no_return=facts.no_return,
        problems=list(facts.problems),
    )


def _component(part: MapComponent) -> Component:
    scans, length = [str(scan) for scan in part.scans], float(part.map.lengths.sum())
    return Component(name=part.name, scans=scans, segments=len(part.map), length=length)


def _unplaced(session: Session, parts: tuple[MapComponent, ...]) -> list[str]:
    placed = {scan for part in parts for scan in part.scans}
    return [str(scan) for scan in session.scan_ids if scan not in placed]


@router.get("/projects/{project}/map.svg", response_class=Response)
def picture(site: Site, project: str) -> Response:
    """A small picture of the merged map; 404 while nothing is accepted. Opens no project."""
    held = site.workspace.summary(project).picture
    if not held:
        raise UnknownError("This project has no merged map yet: accept an integration first.")
    return _svg(held)


def _svg(text: str) -> Response:
    """A picture that can run nothing and load nothing, even when opened by itself."""
    return Response(text, media_type="image/svg+xml", headers={"Content-Security-Policy": SVG_POLICY})


@router.get("/exports")
def exports() -> ExportList:
    """What a merged map can be saved as."""
    return ExportList(
        formats=[
            ExportChoice(name=kind.name, title=kind.title, holds=kind.holds, use=kind.use) for kind in FORMATS.values()
        ]
    )


@router.get("/projects/{project}/export/{format}", response_class=Response)
def export(session: Opened, format: str, resolution: Resolution = RESOLUTION) -> Response:
    """The merged map of everything that is accepted, as a file; a zip archive where a format takes several."""
    if format not in FORMATS:
        raise UnknownError(f"There is no export format {format[:80]!r}. Formats are: {', '.join(FORMATS)}.")
    state, merged = session.state, session.merged(MERGING_SECONDS)
    kind = FORMATS[format]
    record = session.record() if kind.needs_record else None
    stem = _plain(state.name)
    content = exportable(state, merged, lambda scan: session.scan(scan).time, stem, resolution, record)
    file = in_one(export_files(content, format), format)
    suffix, media_type = (".zip", "application/zip") if kind.several else (kind.suffix, kind.media_type)
    return Response(file, media_type=media_type, headers=attached(state.name, suffix))


@router.get("/projects/{project}/download", response_class=FileResponse)
def download(site: Site, project: str) -> FileResponse:
    """The project file: logs, decisions and parameters in one."""
    folder = Path(tempfile.mkdtemp(prefix="segmap-"))
    remove = BackgroundTask(shutil.rmtree, folder, ignore_errors=True)
    try:
        state = site.workspace.backup(project, folder / "copy.segmap")
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    headers = attached(state.name, ".segmap")
    return FileResponse(
        folder / "copy.segmap", media_type="application/vnd.sqlite3", headers=headers, background=remove
    )


def attached(name: str, suffix: str) -> dict[str, str]:
    """The header that saves an answer as a file of this name; what a name may not hold is encoded."""
    plain, full = _plain(name) + suffix, quote(base_name(name) + suffix, safe="")
    return {"Content-Disposition": f"attachment; filename=\"{plain}\"; filename*=utf-8''{full}"}


def _plain(name: str) -> str:
    """A name that every file system takes, and shows."""
    plain = "".join(c if c.isascii() and (c.isalnum() or c in " ._-") else "_" for c in base_name(name))
    return plain.lstrip(" .-_") or "map"
