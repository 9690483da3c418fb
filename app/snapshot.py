"""What a view shows, as JSON: all a page needs to mirror the panel."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from app.claims import origin
from app.content import Content, Pair
from app.drawing import STAGES, Layer, layers
from app.evidence import Evidence
from app.looks import Looks, Trial
from app.map_layers import component_colour
from app.map_looks import COLOURINGS
from app.marks import measurement
from app.palette import hexadecimal
from app.picking import explain
from app.review import Outcome
from segmap.integration import Candidate, heuristics
from segmap.pose import Pose2
from segmap.verdict import Verdict, judge_value

if TYPE_CHECKING:
    from app.session import Session

__all__ = ["snapshot"]


NOTHING = ("candidate", "value", "pose", "angles", "origin", "above", "score", "behind", "evidence", "uncertainty")
"""null where no candidate is shown"""


def snapshot(session: Session, evidence: Evidence, looks: Looks, content: Content) -> dict[str, Any]:
    """The selection, what is known of it, and what can be done; lengths in metres, angles in radians."""
    state = session.state
    return {
        "integration": looks.integration,
        "heuristic": evidence.heuristic(looks),
        "nudging": looks.nudging,
        "held": looks.held is not None,
        "laying": [asdict(pick) for pick in looks.laying],
        "reason": looks.reason,
        "trial": None if looks.trial is None else _trial(looks.trial),
        "stage": looks.stage,
        "stages": list(STAGES),
        "dimension": looks.dimension,
        "theme": looks.theme,
        "layers": [_layer(layer) for layer in layers(content)],
        "row": None if looks.integration is None else session.row(looks.integration).to_json(),
        "names": None if content.pair is None else list(content.pair.names),
        "queue": _queue(session, looks),
        **_candidate(content),
        **_verdict(content.pair),
        "criterion": session.criterion.to_json(),
        "threshold": session.criterion.threshold(state.parameters),
        "heuristics": _heuristics(session, looks, evidence.heuristic(looks)),
        "chains": _chains(content),
        "picked": explain(content),
        "map": _map(content),
        "measuring": looks.measuring,
        "measured": _measured(content),
        "undo": state.can_undo,
        "redo": state.can_redo,
        "revision": state.revision,
        "messages": [text for text in (looks.notice, _to_lay(looks), _on_trial(looks), content.message) if text],
    }


def _map(content: Content) -> dict[str, Any]:
    """How the merged map is looked at."""
    looks, other = content.map.looks, content.map.other
    return {
        "colouring": looks.colouring,
        "colourings": [{"name": name, "title": title} for name, title in COLOURINGS.items()],
        "hidden": sorted(map(str, looks.hidden)),
        "compare": looks.compare,
        "side": looks.side,
        "other": None if other is None else {"name": other.name, "title": other.title, "problem": other.problem},
        "colours": {
            str(placed.component.scans[0]): hexadecimal(component_colour(content, place))
            for place, placed in enumerate(content.placed)
        },
    }


def _measured(content: Content) -> dict[str, Any] | None:
    found = measurement(content.measured)
    return None if found is None else asdict(found)


def _trial(trial: Trial) -> dict[str, Any]:
    return {"number": trial.number, "milliseconds": trial.milliseconds, "segments": list(trial.match.segments)}


def _to_lay(looks: Looks) -> str:
    """What to do next, where the second map is being laid by hand."""
    if not looks.nudging or looks.held is not None:
        return ""
    if not looks.laying:
        return (
            "Drag the handle on the second scan, or lay it by its walls: click a segment of one scan, then the segment"
            " of the other that is the same wall, and two more."
        )
    if len(looks.laying) == PAIR:
        return "Now another wall, best one that is not parallel: click it in one scan, then in the other."
    partner = "second" if looks.laying[-1].source == "first" else "first"
    return f"Click the same wall in the {partner} scan."


def _on_trial(looks: Looks) -> str:
    return "These parameters are on trial: apply them, or put them back, to decide." if looks.trial else ""


PAIR = 2


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
    listed = session.listed
    place = listed.places.get(looks.integration or "")
    counted = {name: listed.counts[name] for name in ("total", "pending")}
    return {"place": None if place is None else place + 1, **counted}


def _candidate(content: Content) -> dict[str, Any]:
    """The candidate shown, and what speaks for and against it."""
    pair = content.pair
    candidate = None if pair is None else pair.candidate
    if pair is None or candidate is None:
        return {**dict.fromkeys(NOTHING), "candidates": 0 if pair is None else len(pair.ranked)}
    return {
        "candidate": pair.rank,
        "candidates": len(pair.ranked),
        "value": candidate.value,
        "pose": _pose(candidate.T_1_2),
        "angles": [list(candidate.angle_1), list(candidate.angle_2)],
        "origin": origin(candidate),
        "above": _above(pair, candidate),
        "score": candidate.score,
        "behind": _behind(pair, candidate),
        "evidence": _evidence(candidate),
        "uncertainty": None if candidate.uncertainty is None else asdict(candidate.uncertainty),
    }


def _above(pair: Pair, candidate: Candidate) -> bool | None:
    """Whether the candidate would be accepted; None for the rivals in verified mode, which are not judged."""
    if pair.rank == 0:
        return pair.verdict == Verdict.ACCEPTED
    if candidate.score is not None:
        return None
    return judge_value(candidate.value, pair.parameters)[0] is Verdict.ACCEPTED


def _behind(pair: Pair, candidate: Candidate) -> float | None:
    """How much less than the best a rival scores, metres; negative where one held by hand scores more."""
    best = pair.ranked[0].score if pair.ranked else None
    return None if best is None or candidate.score is None else best - candidate.score


def _evidence(candidate: Candidate) -> dict[str, float] | None:
    found = candidate.evidence
    return None if found is None else {**asdict(found), "agreement": found.agreement, "overlap": found.overlap}


def _verdict(pair: Pair | None) -> dict[str, Any]:
    """The program's verdict on the best candidate, in words and as a number."""
    if pair is None:
        return {"verdict": None, "reasons": [], "confidence": None}
    return {"verdict": pair.verdict, "reasons": list(pair.reasons), "confidence": pair.confidence}


def _pose(pose: Pose2) -> dict[str, float]:
    return {"x": pose.x, "y": pose.y, "theta": pose.theta}


def _heuristics(session: Session, looks: Looks, selected: str) -> list[dict[str, Any]]:
    """One line for each heuristic on the selected pair; most of it is null where it was not tried yet."""
    if looks.integration is None:
        return []
    outcomes = {name: session.outcome(looks.integration, name) for name in heuristics(session.state.mode)}
    return [{"heuristic": name, "selected": name == selected, **_outcome(found)} for name, found in outcomes.items()]


def _outcome(outcome: Outcome | None) -> dict[str, Any]:
    known = outcome is not None and not outcome.failure
    return {
        "tried": outcome.candidates if outcome is not None and known else None,
        "draws": outcome.draws if outcome is not None and known else None,
        "milliseconds": outcome.milliseconds if outcome is not None and known else None,
        "value": outcome.value if outcome is not None and known else None,
        "confidence": outcome.confidence if outcome is not None and known else None,
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
