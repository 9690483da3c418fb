"""What integrating two maps found: candidates, ranked, and a verdict on the best of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

from pydantic import TypeAdapter

from segmap.chains import MatchingChain
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.refinement import Uncertainty
from segmap.verdict import Findings, Verdict, judge
from segmap.visibility import Evidence

__all__ = ["Candidate", "Match"]


@dataclass(frozen=True)
class Candidate:
    """One candidate transformation and its value."""

    T_1_2: Pose2
    value: float
    """metres (III-B)"""
    angle_1: tuple[int, int]
    """the segments of map 1 whose angle it superimposes"""
    angle_2: tuple[int, int]
    """those of map 2"""
    index: int
    """place among the candidates in the order they were found, from 0"""
    score: float | None = None
    """verified: support less conflict, metres"""
    evidence: Evidence | None = None
    """verified: what lines of sight say"""
    uncertainty: Uncertainty | None = None
    """verified: how well the geometry holds the pose"""


@dataclass(frozen=True)
class Match:
    """What the first two steps of INTEGRATE found: the ranked candidates, and a verdict on the best."""

    mode: str
    heuristic: str
    segments: tuple[int, int]
    """number of segments of map 1 and map 2"""
    ranked: tuple[Candidate, ...]
    """the best candidates, best first; ties go to the one found first"""
    candidates: int
    """poses evaluated"""
    discarded: int
    """of them, discarded because long segments cross"""
    draws: int | None
    """draws of the heuristic ``random``"""
    chains: tuple[MatchingChain, ...]
    """matching chains at the best candidate"""
    verdict: Verdict
    reasons: tuple[str, ...]
    """the verdict in words"""
    milliseconds: float
    confidence: float | None = None
    """verified: calibrated probability that the best candidate is right"""
    findings: Findings | None = None
    """verified: what speaks for and against the best candidate"""

    @property
    def best(self) -> Candidate | None:
        """The best candidate; None where no transformation has a value."""
        return self.ranked[0] if self.ranked else None

    @property
    def T_1_2(self) -> Pose2 | None:
        """Pose of map 2 in the frame of map 1; None where there is none."""
        return self.ranked[0].T_1_2 if self.ranked else None

    @property
    def value(self) -> float:
        """Value of the best candidate, metres; 0 where there is none."""
        return self.ranked[0].value if self.ranked else 0.0

    @property
    def score(self) -> float:
        """What matches of one mode are ranked by: the confidence, or in paper mode the value in metres."""
        return self.value if self.confidence is None else self.confidence

    def judged(self, parameters: Parameters) -> Match:
        """The same match, with its verdict by other thresholds; nothing is searched again."""
        if not self.ranked:
            return self
        verdict, reasons = judge(self.ranked[0].value, self.findings, parameters)
        return replace(self, verdict=verdict, reasons=reasons)

    def to_json(self) -> str:
        """This match as one JSON document."""
        return _ADAPTER.dump_json(self).decode()

    @classmethod
    def from_json(cls, text: str | bytes) -> Match:
        """The match that :meth:`to_json` wrote."""
        return _ADAPTER.validate_json(text)


_ADAPTER = TypeAdapter(Match)
