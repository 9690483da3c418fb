"""The review queue: one row for each integration, the one that most needs a person first. Pure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from segmap.events import Decision, IntegrationId
from segmap.integration import Match
from segmap.project import ProjectState
from segmap.scans import ScanId

__all__ = ["Flips", "Outcome", "Row", "Rows", "counts", "flips", "queue", "row"]

STATES = ("pending", "failed", "none", "matching", "accepted", "rejected")
"""In queue order: what a person can decide, what a person should know, what is not ready, what is done."""


@dataclass(frozen=True)
class Outcome:
    """A match in short: enough for the queue, for decisions on the best candidate, and to compare heuristics."""

    heuristic: str
    value: float = 0.0
    """of the best candidate, metres"""
    pose: tuple[float, float, float] | None = None
    """of the best candidate: x, y in metres, theta in radians; None where there is no transformation"""
    candidates: int = 0
    draws: int | None = None
    milliseconds: float = 0.0
    failure: str = ""
    """why matching failed, for people; empty where it did not"""

    @classmethod
    def of(cls, match: Match) -> Outcome:
        """The outcome of a match."""
        pose = None if match.T_1_2 is None else (match.T_1_2.x, match.T_1_2.y, match.T_1_2.theta)
        return cls(match.heuristic, match.value, pose, match.candidates, match.draws, match.milliseconds)


@dataclass(frozen=True)
class Row:
    """One integration in the review queue."""

    id: str
    first: ScanId
    second: ScanId
    state: str
    """one of ``STATES``"""
    value: float | None = None
    """metres; of the decision where there is one, otherwise of the best candidate"""
    above: bool | None = None
    """whether the value is above the threshold"""
    heuristic: str = ""
    candidates: int | None = None
    milliseconds: float | None = None
    who: str = ""
    reason: str = ""

    def to_json(self) -> dict[str, Any]:
        """The row as the pages get it."""
        return {**vars(self), "first": str(self.first), "second": str(self.second)}


@dataclass(frozen=True)
class Flips:
    """Undecided integrations on the other side of another threshold."""

    would_pass: tuple[str, ...]
    would_fail: tuple[str, ...]


def row(blank: Row, heuristic: str, outcome: Outcome | None, decision: Decision | None, threshold: float) -> Row:
    """The row of an integration: its decision if there is one, on the evidence there is."""
    found = _undecided(replace(blank, heuristic=heuristic), outcome, threshold)
    return found if decision is None else _decided(found, decision, threshold)


class Rows:
    """The rows of some integrations, each made again only when what it shows has changed."""

    def __init__(self, integrations: Iterable[str]) -> None:
        self._blank = {id: Row(id, *IntegrationId.parse(id), "matching") for id in integrations}
        self._made: dict[str, tuple[Outcome | None, Decision | None, str, float, Row]] = {}

    def __contains__(self, integration: str) -> bool:
        return integration in self._blank

    def row(self, integration: str, state: ProjectState, outcome: Outcome | None) -> Row:
        """The row of an integration in a state of the project."""
        decision, threshold = state.decisions.get(integration), state.parameters.value_threshold
        held = self._made.get(integration)
        if held and held[0] is outcome and held[1] is decision and held[2:4] == (state.heuristic, threshold):
            return held[4]
        made = row(self._blank[integration], state.heuristic, outcome, decision, threshold)
        self._made[integration] = outcome, decision, state.heuristic, threshold, made
        return made


def _undecided(blank: Row, outcome: Outcome | None, threshold: float) -> Row:
    if outcome is None:
        return blank
    if outcome.failure:
        return replace(blank, state="failed", reason=outcome.failure)
    found = outcome.pose is not None
    return replace(
        blank,
        state="pending" if found else "none",
        value=outcome.value,
        above=found and outcome.value > threshold,
        candidates=outcome.candidates,
        milliseconds=outcome.milliseconds,
    )


def _decided(found: Row, decision: Decision, threshold: float) -> Row:
    value = found.value if decision.value is None else decision.value
    return replace(
        found,
        state=decision.verdict,
        value=value,
        above=None if value is None else value > threshold,
        heuristic=decision.heuristic or found.heuristic,
        who=decision.who,
        reason=decision.reason,
    )


def queue(rows: Iterable[Row], threshold: float) -> list[Row]:
    """Rows in the order of review: the closer a value is to the threshold, the more it needs a person."""
    return sorted(rows, key=lambda r: (STATES.index(r.state), _clarity(r, threshold), r.first, r.second))


def _clarity(r: Row, threshold: float) -> float:
    return abs(r.value - threshold) if r.state == "pending" and r.value is not None else 0.0


def flips(rows: Iterable[Row], threshold: float, other: float) -> Flips:
    """What another threshold would change for the undecided integrations that have a transformation."""
    undecided = [(r.id, r.value) for r in rows if r.state == "pending" and r.value is not None]
    passes = tuple(id for id, value in undecided if other < value <= threshold)
    fails = tuple(id for id, value in undecided if threshold < value <= other)
    return Flips(passes, fails)


def counts(rows: Iterable[Row]) -> Mapping[str, int]:
    """How many integrations there are, and how many in each state."""
    held = Counter(r.state for r in rows)
    return {"total": held.total(), **{state: held[state] for state in STATES}}
