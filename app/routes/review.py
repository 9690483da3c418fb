"""The review queue: what was found, what is decided, and the parameters it depends on."""

from __future__ import annotations

import json
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response

from app.claims import CLAIMED, NUDGED, described
from app.errors import RequestError
from app.nudging import nudged
from app.routes.common import Opened
from app.schemas import (
    DecisionMade,
    Decisions,
    Detail,
    HeuristicResult,
    Integration,
    MatchingAction,
    NudgeAt,
    ParametersChange,
    ProgressBody,
    Queue,
    Threshold,
    Turn,
    Turned,
)
from app.session import Change, Session
from segmap.integration import Match, heuristics
from segmap.pose import Pose2

__all__ = ["detail", "made", "router"]

router = APIRouter(prefix="/api/projects/{project}", tags=["review"])


@router.get("/integrations", response_model=Queue)
def integrations(session: Opened, request: Request, since: Annotated[str, Query(max_length=80)] = "") -> Response:
    """All integrations, the one that most needs a person first; with the tag of an earlier answer, what changed."""
    text = session.queue_text(since)
    etag = f'"{text.tag}"'
    headers = {"Cache-Control": "no-store"} if since else {"ETag": etag, "Vary": "Accept-Encoding"}
    if not since and etag in request.headers.get("if-none-match", ""):
        return Response(status_code=304, headers=headers)
    if "gzip" in request.headers.get("accept-encoding", ""):
        return Response(text.packed, media_type="application/json", headers=headers | {"Content-Encoding": "gzip"})
    return Response(text.plain, media_type="application/json", headers=headers)


@router.get("/integrations/{integration}")
def integration(
    session: Opened, integration: str, heuristic: Annotated[str | None, Query(max_length=255)] = None
) -> Detail:
    """One integration in full; a match that is not known yet is looked for next."""
    session.row(integration)
    match = session.match(integration, heuristic)
    if match is None:
        session.request(integration, heuristic)
    return detail(session, integration, match)


def detail(session: Session, integration: str, match: Match | None) -> Detail:
    """An integration with a match of it."""
    return Detail(
        row=Integration.of(session.row(integration)),
        match=None if match is None else json.loads(match.to_json()),
        claimed=_rank_of(match, CLAIMED),
        nudged=_rank_of(match, NUDGED),
        told=_told(session, integration, match),
        heuristics=_heuristics(session, integration),
    )


def _rank_of(match: Match | None, index: int) -> int | None:
    """Of the candidate that was claimed, or laid by hand."""
    return next((rank for rank, c in enumerate(match.ranked) if c.index == index), None) if match else None


def _told(session: Session, integration: str, match: Match | None) -> list[str]:
    proposal = session.state.proposals.get(integration)
    said = [] if proposal is None else [described(match, proposal)]
    return [*said, *session.loops.graph.explained(integration)]


def _heuristics(session: Session, integration: str) -> list[HeuristicResult]:
    known = [session.outcome(integration, name) for name in heuristics(session.state.mode)]
    fields = HeuristicResult.model_fields
    return [
        HeuristicResult(**{name: getattr(outcome, name) for name in fields})
        for outcome in known
        if outcome is not None and not outcome.failure
    ]


@router.post("/decisions")
def decide(session: Opened, body: Decisions) -> DecisionMade:
    """Accept, reject, or make undecided again."""
    if body.verdict == "undecided":
        change = session.clear(
            body.integrations, who=body.who, reason=body.reason, expected_revision=body.expected_revision
        )
    else:
        change = session.decide(
            body.integrations,
            body.verdict,
            candidate=body.candidate,
            heuristic=body.heuristic,
            reason=body.reason,
            who=body.who,
            expected_revision=body.expected_revision,
        )
    return DecisionMade(**made(session, change))


@router.post("/nudges")
def nudge(session: Opened, body: NudgeAt) -> DecisionMade:
    """Lay the second scan of a pair by hand; where it settles it is a candidate, to be accepted or undone."""
    session.row(body.integration)
    start = None if body.pose is None else Pose2(*body.pose)
    if (start is None) == (not body.ties):
        raise RequestError("Say where the second scan is laid: either a pose, or pairs of segments.")
    laid = nudged(session, body.integration, start, body.ties)
    return DecisionMade(**made(session, session.nudge(body.integration, laid, who=body.who, reason=body.reason)))


@router.post("/undo")
def undo(session: Opened, body: Turn) -> Turned:
    """Take the last step back."""
    what = session.state.can_undo
    change = session.undo(body.who, expected_revision=body.expected_revision)
    return Turned(**made(session, change), undone=what)


@router.post("/redo")
def redo(session: Opened, body: Turn) -> Turned:
    """Bring the step undone last back into force."""
    what = session.state.can_redo
    change = session.redo(body.who, expected_revision=body.expected_revision)
    return Turned(**made(session, change), redone=what)


def made(session: Session, change: Change) -> dict[str, Any]:
    """What a step changed, as the pages get it."""
    state = change.state
    rows = [Integration.of(session.row(name)) for name in change.integrations[:200]]
    return {"revision": state.revision, "undo": state.can_undo, "redo": state.can_redo, "rows": rows}


@router.post("/parameters")
def parameters(session: Opened, body: ParametersChange) -> DecisionMade:
    """Change parameters, the heuristic, the mode; what was found under others is looked for again."""
    change = session.configure(
        body.changes, preset_name=body.preset, heuristic=body.heuristic, mode=body.mode, who=body.who
    )
    return DecisionMade(**made(session, change))


@router.get("/threshold")
def threshold(session: Opened, value: Annotated[float, Query(ge=0.0, le=100_000.0)]) -> Threshold:
    """Which undecided integrations another threshold would flip."""
    flips = session.preview_threshold(value)
    return Threshold(would_pass=list(flips.would_pass), would_fail=list(flips.would_fail))


@router.post("/matching")
def matching(session: Opened, body: MatchingAction) -> ProgressBody:
    """Stop matching in the background, or go on with it."""
    if body.action == "cancel":
        session.cancel()
    else:
        session.resume()
    return ProgressBody(**session.progress.to_json())
