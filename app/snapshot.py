"""What a view shows, as JSON: all a page needs to mirror the panel."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from app.content import Content
from app.drawing import STAGES, Layer, layers
from app.evidence import Evidence
from app.looks import Looks
from app.palette import hexadecimal
from app.picking import explain
from app.review import Outcome
from segmap.candidates import HEURISTICS
from segmap.pose import Pose2

if TYPE_CHECKING:
    from app.session import Session

__all__ = ["snapshot"]


def snapshot(session: Session, evidence: Evidence, looks: Looks, content: Content) -> dict[str, Any]:
    """The selection, what is known of it, and what can be done; lengths in metres, angles in radians."""
    state = session.state
    return {
        "integration": looks.integration,
        "heuristic": evidence.heuristic(looks),
        "stage": looks.stage,
        "stages": list(STAGES),
        "dimension": looks.dimension,
        "theme": looks.theme,
        "layers": [_layer(layer) for layer in layers(content)],
        "row": None if looks.integration is None else session.row(looks.integration).to_json(),
        "names": None if content.pair is None else list(content.pair.names),
        "queue": _queue(session, looks),
        **_candidate(content, state.parameters.value_threshold),
        "heuristics": _heuristics(session, looks, evidence.heuristic(looks)),
        "chains": _chains(content),
        "picked": explain(content),
        "undo": state.can_undo,
        "redo": state.can_redo,
        "revision": state.revision,
        "messages": [text for text in (looks.notice, content.message) if text],
    }


def _layer(layer: Layer) -> dict[str, Any]:
    return {
        "name": layer.name,
        "title": layer.title,
        "caption": layer.caption,
        "unit": layer.unit,
        "colours": [hexadecimal(colour) for colour in layer.colours],
        "visible": layer.visible,
    }


def _queue(session: Session, looks: Looks) -> dict[str, Any]:
    """Where the selection stands in the review queue, from 1, and how many still wait for a person."""
    rows = session.rows()
    place = next((place for place, row in enumerate(rows, 1) if row.id == looks.integration), None)
    return {"place": place, "total": len(rows), "pending": sum(row.state == "pending" for row in rows)}


def _candidate(content: Content, threshold: float) -> dict[str, Any]:
    pair = content.pair
    candidate = None if pair is None else pair.candidate
    return {
        "candidate": None if pair is None or candidate is None else pair.ranked.index(candidate),
        "candidates": 0 if pair is None else len(pair.ranked),
        "value": None if candidate is None else candidate.value,
        "pose": None if candidate is None else _pose(candidate.T_1_2),
        "angles": None if candidate is None else [list(candidate.angle_1), list(candidate.angle_2)],
        "threshold": threshold,
        "above": None if candidate is None else candidate.value > threshold,
    }


def _pose(pose: Pose2) -> dict[str, float]:
    return {"x": pose.x, "y": pose.y, "theta": pose.theta}


def _heuristics(session: Session, looks: Looks, selected: str) -> list[dict[str, Any]]:
    """One line for each heuristic on the selected pair; most of it is null where it was not tried yet."""
    if looks.integration is None:
        return []
    outcomes = {name: session.outcome(looks.integration, name) for name in HEURISTICS}
    return [{"heuristic": name, "selected": name == selected, **_outcome(outcomes[name])} for name in HEURISTICS]


def _outcome(outcome: Outcome | None) -> dict[str, Any]:
    known = outcome is not None and not outcome.failure
    return {
        "tried": outcome.candidates if outcome is not None and known else None,
        "draws": outcome.draws if outcome is not None and known else None,
        "milliseconds": outcome.milliseconds if outcome is not None and known else None,
        "value": outcome.value if outcome is not None and known else None,
        "pose": _pose(Pose2(*outcome.pose)) if outcome is not None and known and outcome.pose else None,
        "failure": outcome.failure if outcome is not None else "",
    }


def _chains(content: Content) -> list[dict[str, Any]]:
    """The matching chains, the one that adds most first, with the colours they are drawn in."""
    pair = content.pair
    if pair is None:
        return []
    return [
        {
            "number": place + 1,
            "value": pair.chains[k].value,
            "colour": hexadecimal(content.palette.chain(place)),
            "pairs": [list(pairing) for pairing in pair.chains[k].pairs],
        }
        for place, k in enumerate(pair.by_value)
    ]
