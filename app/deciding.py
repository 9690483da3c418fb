"""From what a person says to the choices that are recorded, with the evidence they were made on. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, cast

from app.errors import RequestError, UnknownError
from app.review import Outcome
from segmap.errors import ProjectError
from segmap.events import Choice
from segmap.integration import Match
from segmap.pose import Pose2
from segmap.project import ProjectState

__all__ = ["Evidence", "choose", "in_force"]


@dataclass(frozen=True)
class Evidence:
    """A candidate: where it lies, what it is worth, and its rank."""

    T_1_2: Pose2
    value: float
    rank: int

    @classmethod
    def of(cls, integration: str, rank: int, outcome: Outcome | None, match: Match | None) -> Evidence | None:
        """The candidate of a rank; None where there is no transformation (yet).

        Raises:
            UnknownError: there are fewer candidates.
        """
        if rank == 0:
            return None if outcome is None or outcome.pose is None else cls(Pose2(*outcome.pose), outcome.value, 0)
        if match is None or rank >= len(match.ranked):
            raise UnknownError(f"{integration} has no candidate of rank {rank}: look at its candidates again.")
        return cls(match.ranked[rank].T_1_2, match.ranked[rank].value, rank)


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
    evidence = Evidence.of(integration, rank, outcome, match)
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
