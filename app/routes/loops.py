"""Loop closures: the search for them, pairs by hand or from a pose graph, and what accepting one would do."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, File, Query, UploadFile

from app.creation import Source
from app.errors import RequestError
from app.importing import proposals_of
from app.loop_schemas import ImportedBody, LoopsAction, Pairs, PreviewBody, SearchBody, ShiftBody
from app.routes.common import Opened
from app.routes.review import made
from app.schemas import DecisionMade
from segmap.events import Proposal
from segmap.graph import Preview

__all__ = ["router"]

router = APIRouter(prefix="/api/projects/{project}", tags=["loops"])

SHIFTS = 20
"""scans that are told of, those that would move most"""


@router.post("/loops")
def loops(session: Opened, body: LoopsAction) -> SearchBody:
    """Search all logs for loop closures, or stop the search; what is found is proposed, nothing is decided."""
    if body.action == "cancel":
        session.loops.cancel()
    elif len(session.scan_ids) < 2:
        raise RequestError("There is nothing to search: the project has fewer than two scans.")
    else:
        session.loops.start()
    return SearchBody(**session.loops.progress.to_json())


@router.post("/pairs")
def pairs(session: Opened, body: Pairs) -> DecisionMade:
    """Put pairs of any two scans into the queue; those that are there already stay as they are."""
    wanted = [Proposal(integration=name, kind="manual") for name in dict.fromkeys(body.integrations)]
    change = session.propose(wanted, who=body.who, reason=body.reason, again=False)
    return DecisionMade(**made(session, change))


@router.post("/graph")
def import_graph(session: Opened, file: Annotated[UploadFile, File()]) -> ImportedBody:
    """Put the loop edges of another program's pose graph into the queue: g2o, TORO, or a graph log."""
    source = Source(file.filename or "graph", file.file)
    found = proposals_of(source, [session.log(index) for index in range(len(session.state.logs))])
    change = session.propose(found.proposals, reason=f"imported from {source.name}")
    new, count = len(change.integrations), len(found.proposals)
    return ImportedBody(
        revision=change.state.revision,
        edges=found.edges,
        loops=found.loops,
        pairs=count,
        new=new,
        problems=list(found.problems),
        message=f"Of {found.edges} edges in {source.name}, {found.loops} close loops; {count} of these join scans of"
        f" this project, {new} new in the queue.",
    )


@router.get("/integrations/{integration}/preview")
def preview(
    session: Opened,
    integration: str,
    heuristic: Annotated[str | None, Query(max_length=255)] = None,
    candidate: Annotated[int, Query(ge=0, le=2**31)] = 0,
) -> PreviewBody | None:
    """What accepting a candidate would do to the pose graph; null while the pair has no candidates."""
    session.get_ready()
    found = session.loops.preview(integration, heuristic, candidate)
    return None if found is None else _body(integration, found)


def _body(integration: str, found: Preview) -> PreviewBody:
    expected, loop = found.expected, found.loop
    return PreviewBody(
        integration=integration,
        joins=found.joins,
        residual=expected.translation if expected else None,
        turn=expected.rotation if expected else None,
        chi=expected.chi if expected else None,
        silenced=found.silenced,
        moved=len(found.shifts),
        shifts=[
            ShiftBody(scan=str(s.scan), translation=s.translation, rotation=s.rotation) for s in found.shifts[:SHIFTS]
        ],
        contradicts=[residual.edge.name for residual in found.contradicts],
        loop=[str(scan) for scan in loop.scans] if loop else [],
        loop_error=loop.translation if loop else None,
        loop_turn=loop.rotation if loop else None,
        sentences=list(found.sentences()),
    )
