"""The review queue: one row for each integration, the one that most needs a person first. Pure."""

from __future__ import annotations

import operator
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol, TypeAlias

from app.criterion import CRITERIA, Criterion
from app.pairs import kind_of
from segmap.events import Covariance, Decision, IntegrationId, Proposal
from segmap.integration import Match, Verdict, findings_of
from segmap.links import covariance_of
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.project import ProjectState
from segmap.scans import ScanId
from segmap.verdict import Findings, judge

__all__ = ["Fate", "Fates", "Flips", "Key", "Outcome", "Row", "Rows", "counts", "flips", "order", "queue", "row"]

STATES = ("pending", "failed", "none", "matching", "accepted", "rejected")
"""In queue order: what a person can decide, what a person should know, what is not ready, what is done."""
THRESHOLDS = ("value_threshold", "confidence_accept", "confidence_review")
"""the parameters a verdict depends on"""


EVIDENCE = ("score", "supported", "contradicted")


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
    confidence: float | None = None
    """verified mode"""
    findings: Findings | None = None
    """verified mode: what speaks for and against the best candidate"""
    covariance: Covariance | None = None
    """verified mode: how well the best candidate is known"""

    @classmethod
    def of(cls, match: Match) -> Outcome:
        """The outcome of a match."""
        pose = None if match.T_1_2 is None else (match.T_1_2.x, match.T_1_2.y, match.T_1_2.theta)
        best = match.best
        known = None if best is None or best.uncertainty is None else covariance_of(best)
        found = match.confidence, findings_of(match), known
        return cls(match.heuristic, match.value, pose, match.candidates, match.draws, match.milliseconds, "", *found)

    def verdict(self, parameters: Parameters) -> Verdict:
        """What the program says under these thresholds."""
        if self.pose is None:
            return Verdict.REJECTED
        return judge(self.value, self.findings, parameters)[0]


@dataclass(frozen=True)
class Fate:
    """How far a pose of an integration is from where the graph of all accepted ones has it."""

    translation: float
    """metres"""
    rotation: float
    """radians, in [0, pi]"""
    chi: float | None = None
    """of what is accepted: the same in standard deviations"""
    silenced: bool = False
    """accepted, and the optimiser does not believe it"""


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
    verdict: str | None = None
    """what the program says: accepted, review or rejected; None: of this pose nothing (yet)"""
    above: bool | None = None
    """whether that is accepted"""
    confidence: float | None = None
    """verified mode: probability, in 0..1, that the pose is right"""
    score: float | None = None
    """verified mode: support less conflict, metres"""
    supported: float | None = None
    """verified mode: metres that both scans see"""
    contradicted: float | None = None
    """verified mode: metres that one scan sees and the other's lines of sight deny"""
    heuristic: str = ""
    candidates: int | None = None
    milliseconds: float | None = None
    who: str = ""
    reason: str = ""
    kind: str = "neighbour"
    """why the pair is here, one of ``pairs.KINDS``"""
    residual: float | None = None
    """metres; how far its pose is from where the graph has it, once that is known"""
    turn: float | None = None
    """radians; the same for its heading"""
    chi: float | None = None
    """standard deviations; the same, of what is accepted"""
    silenced: bool = False
    """accepted, and the optimiser does not believe it"""
    origin: str = "found"
    """of the pose decided on: found, claimed or nudged"""
    later: bool = False
    """undecided, and somebody skipped it"""

    def to_json(self) -> dict[str, Any]:
        """The row as the pages get it."""
        return {**vars(self), "first": str(self.first), "second": str(self.second)}


@dataclass(frozen=True)
class Flips:
    """Undecided integrations on the other side of another threshold."""

    would_pass: tuple[str, ...]
    would_fail: tuple[str, ...]


def row(blank: Row, heuristic: str, outcome: Outcome | None, decision: Decision | None, parameters: Parameters) -> Row:
    """The row of an integration: its decision if there is one, on the evidence there is."""
    found = _undecided(replace(blank, heuristic=heuristic), outcome, parameters)
    if decision is None:
        return found
    return _decided(found, decision, outcome is not None and _same(decision.T_1_2, outcome.pose))


class Fates(Protocol):
    """What knows how far an integration is from where the graph has it."""

    def part(self, first: ScanId, second: ScanId) -> object:
        """What that depends on; the same object as long as it is the same."""

    def fate(self, integration: str, T_1_2: Pose2 | None) -> Fate | None: ...


Key: TypeAlias = tuple[int, bool, bool, float, ScanId, ScanId]
"""of a row in the order of review"""
_Grounds: TypeAlias = tuple[Outcome | None, Decision | None, Proposal | None, tuple[Any, ...], object, bool]


def _identical(held: _Grounds, now: _Grounds) -> bool:
    return all(map(operator.is_, held, now))


class Rows:
    """The rows of some integrations, each made again only when what it shows has changed."""

    def __init__(self, integrations: Iterable[str]) -> None:
        self._blank: dict[str, Row] = {}
        self._made: dict[str, tuple[_Grounds, Row]] = {}
        self._settings: tuple[Any, ...] = ()
        self.add(integrations)

    def add(self, integrations: Iterable[str]) -> None:
        """Know these too; what was known once stays known, as somebody may still look at it."""
        for id in integrations:
            if id not in self._blank:
                self._blank[id] = Row(id, *IntegrationId.parse(id), "matching")

    def __contains__(self, integration: str) -> bool:
        return integration in self._blank

    def row(
        self,
        integration: str,
        state: ProjectState,
        outcome: Outcome | None,
        graph: Fates | None = None,
        later: bool = False,
    ) -> Row:
        """The row of an integration in a state of the project; one that shows the same is the same object."""
        decision, proposal = state.decisions.get(integration), state.proposals.get(integration)
        blank = self._blank[integration]
        part = None if graph is None else graph.part(blank.first, blank.second)
        grounds = outcome, decision, proposal, self._current(state), part, later
        held = self._made.get(integration)
        if held and _identical(held[0], grounds):
            return held[1]
        made = self.tried(integration, state, outcome, state.parameters)
        made = replace(made, later=later and decision is None)
        if graph is not None:
            found = None if outcome is None or outcome.pose is None else Pose2(*outcome.pose)
            made = _fated(made, graph.fate(integration, decision.T_1_2 if decision else found))
        if held and held[1] == made:
            made = held[1]
        self._made[integration] = grounds, made
        return made

    def _current(self, state: ProjectState) -> tuple[Any, ...]:
        """What rows show of a project's settings; the same object as long as it is the same."""
        found = state.heuristic, *(getattr(state.parameters, name) for name in THRESHOLDS)
        if found != self._settings:
            self._settings = found
        return self._settings

    def tried(self, integration: str, state: ProjectState, outcome: Outcome | None, parameters: Parameters) -> Row:
        """The row as it would be under other thresholds; nothing is kept."""
        blank = self._blank[integration]
        blank = replace(blank, kind=kind_of(IntegrationId(blank.first, blank.second), state))
        found = row(blank, state.heuristic, outcome, state.decisions.get(integration), parameters)
        return replace(found, **_LEFT_TO_A_PERSON) if _proposed_elsewhere(found, state, outcome) else found

    def moved(self, held: Row, state: ProjectState, outcome: Outcome | None, parameters: Parameters) -> Row:
        """A pending row as far as the program's word goes under other thresholds."""
        passes = outcome is not None and outcome.verdict(parameters) is Verdict.ACCEPTED
        above = passes and not _proposed_elsewhere(held, state, outcome)
        return held if above == held.above else replace(held, above=above)


_LEFT_TO_A_PERSON: Mapping[str, Any] = {"verdict": str(Verdict.REVIEW), "above": False}


def _proposed_elsewhere(found: Row, state: ProjectState, outcome: Outcome | None) -> bool:
    """Whether our own search proposes another candidate than the best: what is said of that one is not said of it."""
    proposal = state.proposals.get(found.id)
    if found.state != "pending" or outcome is None or proposal is None or proposal.kind != "closure":
        return False
    return proposal.T_1_2 is not None and not _same(proposal.T_1_2, outcome.pose)


def _fated(found: Row, fate: Fate | None) -> Row:
    if fate is None:
        return found
    return replace(found, residual=fate.translation, turn=fate.rotation, chi=fate.chi, silenced=fate.silenced)


def _undecided(blank: Row, outcome: Outcome | None, parameters: Parameters) -> Row:
    if outcome is None:
        return blank
    if outcome.failure:
        return replace(blank, state="failed", reason=outcome.failure)
    verdict, found = outcome.verdict(parameters), outcome.findings
    seen = found.evidence if found else None
    return replace(
        blank,
        state="none" if outcome.pose is None else "pending",
        value=outcome.value,
        verdict=str(verdict),
        above=verdict is Verdict.ACCEPTED,
        confidence=outcome.confidence,
        score=found.score if found else None,
        supported=seen.supported if seen else None,
        contradicted=seen.contradicted if seen else None,
        candidates=outcome.candidates,
        milliseconds=outcome.milliseconds,
    )


def _decided(found: Row, decision: Decision, judged: bool) -> Row:
    """A decided row; what the program says is only shown where it is ``judged``: said of the pose decided on."""
    known = (
        {} if decision.grounds is None else decision.grounds.model_dump(include={"supported", "contradicted", "score"})
    )
    unsaid: dict[str, Any] = {**dict.fromkeys(("verdict", "above", "confidence", *EVIDENCE)), **known}
    silent = {} if judged else unsaid
    return replace(
        found,
        state=decision.verdict,
        value=found.value if decision.value is None else decision.value,
        heuristic=decision.heuristic or found.heuristic,
        who=decision.who,
        reason=decision.reason,
        origin=decision.origin,
        **silent,
    )


def _same(pose: Pose2 | None, other: tuple[float, float, float] | None) -> bool:
    return (None if pose is None else tuple(pose)) == other


def queue(rows: Iterable[Row], mode: str, parameters: Parameters) -> list[Row]:
    """Rows in the order of review: first what the program leaves to a person, and the closest to the threshold."""
    return sorted(rows, key=order(mode, parameters))


def order(mode: str, parameters: Parameters) -> Callable[[Row], Key]:
    """The key of that order: another one for every row."""
    criterion = CRITERIA[mode]
    threshold = criterion.threshold(parameters)
    return lambda r: (*_need(r), _clarity(r, criterion, threshold), r.first, r.second)


def _need(r: Row) -> tuple[int, bool, bool]:
    return STATES.index(r.state), r.later, r.verdict != Verdict.REVIEW


def _clarity(r: Row, criterion: Criterion, threshold: float) -> float:
    quantity = criterion.of(r)
    return abs(quantity - threshold) if r.state == "pending" and quantity is not None else 0.0


def flips(before: Iterable[Row], after: Iterable[Row]) -> Flips:
    """The undecided integrations with a transformation that are accepted before or after, not both."""
    pairs = [(old, new) for old, new in zip(before, after, strict=True) if old.state == "pending"]
    passes = tuple(old.id for old, new in pairs if new.above and not old.above)
    return Flips(passes, tuple(old.id for old, new in pairs if old.above and not new.above))


def counts(rows: Iterable[Row]) -> Mapping[str, int]:
    """How many integrations there are, and how many in each state."""
    held = Counter(r.state for r in rows)
    return {"total": held.total(), **{state: held[state] for state in STATES}}
