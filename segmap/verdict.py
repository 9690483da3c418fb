"""Evidence -> accepted | review | rejected, with reasons; and the calibration of its confidence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from segmap.parameters import Parameters
from segmap.visibility import Evidence

__all__ = [
    "CALIBRATION",
    "Findings",
    "Verdict",
    "confidence",
    "confidence_terms",
    "features",
    "findings",
    "judge",
    "judge_evidence",
    "judge_value",
]


class Verdict(StrEnum):
    """What the program says of an integration; a person has the last word."""

    ACCEPTED = "accepted"
    REVIEW = "review"
    REJECTED = "rejected"


@dataclass(frozen=True)
class Findings:
    """What speaks for and against the best candidate of a pair."""

    score: float
    """metres: support less conflict"""
    gap: float
    """metres: how much less the score of the nearest distinct rival is; the score itself where there is none"""
    evidence: Evidence
    weakest: float
    """metres: standard deviation along the weakest direction"""
    unrefuted: float = 0.0
    """metres: the score of the best rival that agrees with what both maps see as well as the best candidate does"""


AS_WELL = 0.05
"""a rival agrees as well when its agreement is at most this much less"""
RIVAL_SHARE = 0.7
"""an unrefuted rival with more than this share of the score leaves the choice to a person"""
CLOSE_SHARE = 0.8
"""and so does any rival with more than this share"""


def findings(judged: Sequence[tuple[float, Evidence]], weakest: float) -> Findings:
    """What the scores and the evidence of distinct candidates, best first, say of the first."""
    (best, seen), rivals = judged[0], judged[1:]
    nearest = max((score for score, _ in rivals), default=0.0)
    as_well = seen.agreement - AS_WELL
    unrefuted = max((score for score, evidence in rivals if evidence.agreement >= as_well), default=0.0)
    return Findings(best, best - max(nearest, 0.0), seen, weakest, max(unrefuted, 0.0))


CALIBRATION: dict[str, float] = {
    "intercept": -16.821,
    "score": 0.843,
    "gap": 3.45,
    "agreement": 10.669,
    "overlap": 6.14,
}
"""Logistic weights of the confidence: ``benchmarks/calibrate.py`` of 2026-11-22, on 899 pairs of the five logs
aces, csail, fr079, fr101 and intel (the pair benchmark). Left out of the fit one at a time, no log had a wrong
pair above 0.74, and 94 % of the right ones were above 0.9."""


def confidence(findings: Findings) -> float:
    """The calibrated probability, in 0..1, that the best candidate is right within 0.25 m and 5 degrees."""
    logit = sum(confidence_terms(findings).values())
    return 1.0 / (1.0 + math.exp(-max(-60.0, min(60.0, logit))))


def confidence_terms(findings: Findings) -> dict[str, float]:
    """What each feature adds to the logit of the confidence, and the intercept they start from."""
    weighted = {name: CALIBRATION[name] * feature for name, feature in features(findings).items()}
    return {"intercept": CALIBRATION["intercept"], **weighted}


def features(findings: Findings) -> dict[str, float]:
    """What the confidence is computed from: it grows with each; metres count by their logarithm."""
    return {
        "score": math.log1p(max(0.0, findings.score)),
        "gap": math.log1p(max(0.0, findings.gap)),
        "agreement": findings.evidence.agreement,
        "overlap": findings.evidence.overlap,
    }


def judge(value: float, findings: Findings | None, parameters: Parameters) -> tuple[Verdict, tuple[str, ...]]:
    """By evidence where there is any, by value alone otherwise."""
    return judge_value(value, parameters) if findings is None else judge_evidence(value, findings, parameters)


def judge_value(value: float, parameters: Parameters) -> tuple[Verdict, tuple[str, ...]]:
    """The paper's rule: valid only above the threshold (IV-B, V-B)."""
    threshold = parameters.value_threshold
    if value > threshold:
        return Verdict.ACCEPTED, (f"The value, {value:.2f} m, is above the threshold of {threshold:.2f} m.",)
    return Verdict.REJECTED, (f"The best value, {value:.2f} m, is not above the threshold of {threshold:.2f} m.",)


def judge_evidence(value: float, findings: Findings, parameters: Parameters) -> tuple[Verdict, tuple[str, ...]]:
    """The verdict on evidence: enough confidence, no doubt of a kind that confidence cannot weigh, and a value
    above the threshold too.

    Whatever the confidence, a person decides where a rival might as well be right, and where no wall holds
    the pose along some direction, as in a corridor.
    """
    sure = confidence(findings)
    doubts = _doubts(findings, parameters)
    verdict, value_reasons = judge_value(value, parameters)
    reasons = (_certainty(sure, parameters), *doubts, _seen(findings.evidence), *value_reasons)
    if sure < parameters.confidence_review or (verdict is Verdict.REJECTED and sure < parameters.confidence_accept):
        return Verdict.REJECTED, reasons
    if sure >= parameters.confidence_accept and verdict is Verdict.ACCEPTED and not doubts:
        return Verdict.ACCEPTED, reasons
    return Verdict.REVIEW, reasons


def _certainty(sure: float, parameters: Parameters) -> str:
    if sure >= parameters.confidence_accept:
        return f"Confidence {sure:.3f}: at or above {parameters.confidence_accept:g}."
    if sure >= parameters.confidence_review:
        return f"Confidence {sure:.3f}: between {parameters.confidence_review:g} and {parameters.confidence_accept:g}."
    return f"Confidence {sure:.3f}: below {parameters.confidence_review:g}."


def _doubts(findings: Findings, parameters: Parameters) -> tuple[str, ...]:
    """What leaves the choice to a person, in words."""
    doubts = []
    if findings.score - findings.gap > max(0.0, CLOSE_SHARE * findings.score):
        doubts.append(f"A distinct rival scores only {findings.gap:.2f} m less: look at the rivals.")
    elif findings.unrefuted > max(0.0, RIVAL_SHARE * findings.score):
        less = findings.score - findings.unrefuted
        doubts.append(f"A distinct rival scores {less:.2f} m less, but nothing speaks against it: look at the rivals.")
    if findings.weakest > parameters.rival_distance / 2.0:
        doubts.append(f"Along its weakest direction the pose is known only to {findings.weakest:.2f} m.")
    return tuple(doubts)


def _seen(evidence: Evidence) -> str:
    against = evidence.contradicted + evidence.shadowed
    return (
        f"{evidence.supported:.1f} m are seen by both, {against:.1f} m contradict, {evidence.unseen:.1f} m are unseen."
    )
