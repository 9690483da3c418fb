"""Matches made by hand, to see what is concluded from them."""

from segmap.integration import Candidate, Match, Verdict
from segmap.pose import Pose2
from segmap.refinement import Uncertainty
from segmap.scans import ScanId
from segmap.visibility import Evidence

SHARP = Uncertainty(((1e-4, 0.0, 0.0), (0.0, 1e-4, 0.0), (0.0, 0.0, 1e-5)), 0.01, 0.01, 0.0)


def candidate(T_1_2: Pose2, score: float = 12.0, contradicted: float = 0.2, unseen: float = 8.0) -> Candidate:
    """A candidate with this evidence."""
    evidence = Evidence(score + 2.0 * contradicted, contradicted, 0.0, unseen, off_two=2.0, off_three=1.0)
    return Candidate(T_1_2, score, (0, 1), (0, 1), 0, score=score, evidence=evidence, uncertainty=SHARP)


def match(*ranked: Candidate, verdict: Verdict = Verdict.ACCEPTED, confidence: float = 0.95) -> Match:
    """A verified match with these candidates, best first."""
    return Match(
        mode="verified",
        heuristic="automatic",
        segments=(10, 10),
        ranked=ranked,
        candidates=100,
        discarded=0,
        draws=None,
        chains=(),
        verdict=verdict,
        reasons=(),
        milliseconds=1.0,
        confidence=confidence,
    )


def scans(*numbers: int, log: int = 0) -> list[ScanId]:
    """Scans of a log."""
    return [ScanId(log, number) for number in numbers]
