"""From what a person says to the choices that are recorded, with the evidence they were made on. Pure."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Literal, cast

from app.claims import CLAIMED, origin
from app.errors import RequestError, UnknownError
from app.review import Outcome
from segmap.errors import ProjectError
from segmap.events import Choice, Covariance, Grounds
from segmap.integration import Candidate, Match
from segmap.links import covariance_of
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.project import ProjectState, Proposal

__all__ = ["Evidence", "choose", "covariance_at", "in_force"]


@dataclass(frozen=True)
class Evidence:
    """A candidate: where it lies, what it is worth, its rank, and what speaks for and against it."""

    T_1_2: Pose2
    value: float
    rank: int | None
    """None: not one of those our search found, but a pose that was claimed, or laid by hand"""
    covariance: Covariance | None = None
    origin: str = "found"
    grounds: Grounds | None = None

    @classmethod
    def of(
        cls,
        integration: str,
        rank: int,
        outcome: Outcome | None,
        match: Match | None,
        parameters: Parameters,
        claim: Proposal | None = None,
    ) -> Evidence | None:
        """The candidate of a rank; None where there is no transformation (yet).

        Raises:
            UnknownError: there are fewer candidates.
        """
        if rank == 0 and outcome is not None and outcome.pose is not None:
            grounds = _grounds_of_best(outcome, parameters)
            return cls(Pose2(*outcome.pose), outcome.value, 0, outcome.covariance, grounds=grounds)
        if match is None or rank >= len(match.ranked):
            if rank == 0:
                return None
            raise UnknownError(f"{integration} has no candidate of rank {rank}: look at its candidates again.")
        candidate = match.ranked[rank]
        found, covariance = origin(candidate), covariance_at(candidate, claim)
        place, grounds = rank if found == "found" else None, _grounds(candidate, match)
        return cls(candidate.T_1_2, candidate.value, place, covariance, found, grounds)


def _grounds_of_best(outcome: Outcome, parameters: Parameters) -> Grounds:
    found = outcome.findings
    seen = asdict(found.evidence) if found and found.evidence else {}
    return Grounds(
        verdict=str(outcome.verdict(parameters)),
        confidence=outcome.confidence,
        score=found.score if found else None,
        **seen,
        candidates=outcome.candidates,
    )


def _grounds(candidate: Candidate, match: Match) -> Grounds:
    """Of any other candidate: the program's verdict and confidence are about the best alone."""
    seen = asdict(candidate.evidence) if candidate.evidence else {}
    return Grounds(score=candidate.score, **seen, candidates=match.candidates)


def covariance_at(candidate: Candidate, claim: Proposal | None) -> Covariance | None:
    """How well a candidate is known: as its match says, or as whoever claims it does; None: nobody says."""
    if candidate.index == CLAIMED and claim is not None and claim.covariance is not None:
        return claim.covariance
    return None if candidate.uncertainty is None else covariance_of(candidate)


def choose(
    integration: str,
    verdict: str,
    heuristic: str,
    state: ProjectState,
    outcome: Outcome | None,
    match: Match | None,
    rank: int,
) -> Choice:
    """What is recorded of a verdict on a candidate.

    Raises:
        ProjectError: it is to be accepted, and there is no transformation (yet).
        UnknownError: there is no such candidate.
    """
    if verdict not in ("accepted", "rejected"):
        raise RequestError(f"{verdict!r} is no verdict: say accepted or rejected.")
    evidence = Evidence.of(integration, rank, outcome, match, state.parameters, state.proposals.get(integration))
    if evidence is None and verdict == "accepted":
        raise ProjectError(_why_not(integration, heuristic, outcome))
    return Choice(
        integration=integration,
        verdict=cast(Literal["accepted", "rejected"], verdict),
        parameters=state.fingerprint,
        heuristic=heuristic,
        mode=state.mode,
        T_1_2=evidence.T_1_2 if evidence else None,
        value=evidence.value if evidence else None,
        candidate=evidence.rank if evidence else None,
        covariance=evidence.covariance if evidence else None,
        origin=cast(Literal["found", "claimed", "nudged"], evidence.origin if evidence else "found"),
        grounds=evidence.grounds if evidence else None,
    )


def _why_not(integration: str, heuristic: str, outcome: Outcome | None) -> str:
    if outcome is None:
        return f"{integration} has not been matched by {heuristic} yet: wait until it is, then decide."
    if outcome.failure:
        return f"{integration} cannot be accepted: {outcome.failure}"
    return (
        f"{integration} cannot be accepted: {heuristic} found no transformation. Reject it, or try another heuristic."
    )


def in_force(choice: Choice, state: ProjectState) -> bool:
    """Whether an integration is decided this way already: a second click, or a second person, changes nothing."""
    made = state.decisions.get(choice.integration)
    return made is not None and (made.verdict, made.T_1_2, made.value) == (choice.verdict, choice.T_1_2, choice.value)
