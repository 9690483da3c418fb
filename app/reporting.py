"""What a report tells of a project, from its state and what was found; nothing is searched for it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import lru_cache

from app.claims import CLAIMED
from app.inputs import Facts
from app.pairs import integrations_of, kind_of
from app.posegraph import Graph
from app.review import Outcome
from segmap.events import Decision, IntegrationId
from segmap.export import LogTold, PairTold, Record
from segmap.integration import Candidate
from segmap.parameters import Parameters
from segmap.placing import judged_at
from segmap.pose import Pose2
from segmap.project import ProjectState
from segmap.scans import ScanId
from segmap.segments import SegmentMap

__all__ = ["Reporter"]

Find = Callable[[str, str], Outcome | None]
"""what was found for an integration by a heuristic; None: nothing is known"""
Extract = Callable[[ScanId, Parameters], SegmentMap]
KEPT = 20_000
"""poses whose evidence is remembered"""


class Reporter:
    """Makes records of one project; what takes time is computed once for each pose. Thread-safe."""

    def __init__(self, extract: Extract, outcome: Find, facts: Callable[[int], Facts]) -> None:
        self._extract, self._outcome, self._facts = extract, outcome, facts
        self._judged = lru_cache(KEPT)(self._judge)

    def record(self, state: ProjectState, graph: Graph, scans: Iterable[ScanId]) -> Record:
        """All a report of a state tells beside its map."""
        known = tuple(scans)
        return Record(
            state=state,
            pairs=tuple(self._pair(name, state) for name in integrations_of(state, known)),
            optimised=graph.optimised,
            strengths=tuple(one.strength for one in graph.firmness),
            logs=tuple(self._log(state, index) for index in range(len(state.logs))),
            scans=known,
            map_of=lambda scan: self._extract(scan, state.parameters),
        )

    def _log(self, state: ProjectState, index: int) -> LogTold:
        facts = self._facts(index)
        return LogTold(state.logs[index], facts.no_return, facts.problems)

    def _pair(self, name: str, state: ProjectState) -> PairTold:
        kind, decision = kind_of(IntegrationId.parse(name), state), state.decisions.get(name)
        found = self._outcome(name, (decision.heuristic if decision else "") or state.heuristic)
        if decision is None:
            return _undecided(name, kind, found, state.parameters)
        return self._decided(name, kind, decision, found, state)

    def _decided(
        self, name: str, kind: str, decision: Decision, found: Outcome | None, state: ProjectState
    ) -> PairTold:
        """With the evidence at the pose decided on, under the parameters it was decided under."""
        if decision.T_1_2 is None:
            return PairTold(name, kind, decision.verdict, decision)
        parameters = state.parameter_sets.get(decision.parameters, state.parameters)
        at = self._judged(name, decision.T_1_2, parameters)
        verdict, confidence = _program_on(decision, found, parameters)
        return PairTold(
            integration=name,
            kind=kind,
            state=decision.verdict,
            decision=decision,
            verdict=verdict,
            confidence=confidence,
            value=at.value if decision.value is None else decision.value,
            evidence=at.evidence,
            weakest=at.uncertainty.weakest if at.uncertainty else None,
        )

    def _judge(self, name: str, T_1_2: Pose2, parameters: Parameters) -> Candidate:
        first, second = IntegrationId.parse(name)
        maps = self._extract(first, parameters), self._extract(second, parameters)
        return judged_at(*maps, T_1_2, parameters, "verified", CLAIMED)


def _program_on(decision: Decision, found: Outcome | None, parameters: Parameters) -> tuple[str | None, float | None]:
    """The program's verdict and confidence on the pose decided on: as it was told then, or what is known now."""
    if decision.grounds is not None:
        return decision.grounds.verdict, decision.grounds.confidence
    if found is None or decision.T_1_2 is None or found.pose != tuple(decision.T_1_2):
        return None, None
    return str(found.verdict(parameters)), found.confidence


def _undecided(name: str, kind: str, found: Outcome | None, parameters: Parameters) -> PairTold:
    if found is None:
        return PairTold(name, kind, "matching")
    if found.failure or found.pose is None:
        return PairTold(name, kind, "failed" if found.failure else "none")
    findings = found.findings
    return PairTold(
        integration=name,
        kind=kind,
        state="pending",
        verdict=str(found.verdict(parameters)),
        confidence=found.confidence,
        value=found.value,
        evidence=findings.evidence if findings else None,
        weakest=findings.weakest if findings else None,
    )
