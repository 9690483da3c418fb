"""Evidence -> accepted | review | rejected, with reasons; and the calibration of its confidence."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from segmap.parameters import Parameters
from segmap.visibility import Evidence

__all__ = [
    "CALIBRATION",
    "Findings",
    "Verdict",
    "clear",
    "confidence",
    "confidence_terms",
    "features",
    "findings",
    "is_loose",
    "judge",
    "judge_evidence",
    "judge_value",
    "told",
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
    """metres: support less conflict; the value where lines of sight are off or unknown"""
    gap: float
    """metres: how much less the score of the nearest distinct rival is; the score itself where there is none"""
    evidence: Evidence | None
    """None where lines of sight are off or unknown"""
    weakest: float
    """metres: standard deviation along the weakest direction"""
    unrefuted: float = 0.0
    """metres: the score of the best rival that agrees with what both maps see as well as the best candidate does"""
    blind: bool = False
    """whether lines of sight are asked for, but one of the maps knows of none"""
    excluded: float = 0.0
    """metres: the score of the best pose that a prior excludes"""


MOST_DIGITS = 9
"""of a number that is told"""
AS_WELL = 0.05
"""a rival agrees as well when its agreement is at most this much less"""
RIVAL_SHARE = 0.7
"""an unrefuted rival with more than this share of the score leaves the choice to a person"""
CLOSE_SHARE = 0.8
"""and so does any rival with more than this share"""
PLAIN = 0.1
"""metres; where no more than this is supported off three walls, it might be any room with such walls,"""
PLAIN_SHARE = 0.2
"""and an unrefuted rival with more than this share of the score leaves the choice to a person"""
SURE = 0.9
"""the confidence at which ``automatic`` looks no further: fixed, so that moving a threshold never changes what is
found"""


def findings(judged: Sequence[tuple[float, Evidence | None]], weakest: float, **known: Any) -> Findings:
    """What the scores and the evidence of distinct candidates, best first, say of the first.

    ``known``: other fields of :class:`Findings`.
    """
    (best, seen), rivals = judged[0], judged[1:]
    nearest = max((score for score, _ in rivals), default=0.0)
    as_well = -1.0 if seen is None else seen.agreement - AS_WELL
    unrefuted = [score for score, other in rivals if other is not None and other.agreement >= as_well]
    return Findings(best, best - max(nearest, 0.0), seen, weakest, max([0.0, *unrefuted]), **known)


CALIBRATION: dict[str, float] = {
    "intercept": -35.404,
    "gap": 1.202,
    "consistency": 32.109,
    "overlap": 3.337,
    "detail": 2.726,
}
"""Logistic weights of the confidence: ``benchmarks/calibrate.py`` of 2026-11-22, on 899 pairs of the benchmark (logs
aces, csail, fr079, fr101 and intel) and 9,888 more drawn from the same logs. Left out of the fit one at a time, no
log had a wrong pair of the benchmark accepted, and 92.7 % of those with a common wall were accepted rightly; of the
drawn ones 1,432 were accepted rightly and 39 wrongly, 31 of them round the hub of aces, four corridors alike."""


def confidence(findings: Findings) -> float:
    """The calibrated probability, in 0..1, that the best candidate is right within 0.25 m and 5 degrees.

    0 where nothing is known of lines of sight.
    """
    if findings.evidence is None:
        return 0.0
    logit = sum(confidence_terms(findings).values())
    return 1.0 / (1.0 + math.exp(-max(-60.0, min(60.0, logit))))


def confidence_terms(findings: Findings) -> dict[str, float]:
    """What each feature adds to the logit of the confidence, and the intercept they start from."""
    weighted = {name: CALIBRATION[name] * feature for name, feature in features(findings).items()}
    return {"intercept": CALIBRATION["intercept"], **weighted}


def features(findings: Findings) -> dict[str, float]:
    """What the confidence is computed from: it grows with each; metres count by their logarithm.

    Empty where nothing is known of lines of sight.
    """
    seen = findings.evidence
    if seen is None:
        return {}
    return {
        "gap": math.log1p(max(0.0, findings.gap)),
        "consistency": seen.consistency,
        "overlap": seen.overlap,
        "detail": math.log1p(4.0 * seen.off_two),
    }


def judge(value: float, findings: Findings | None, parameters: Parameters) -> tuple[Verdict, tuple[str, ...]]:
    """By evidence where there is any, by value alone otherwise; a doubt leaves the choice to a person."""
    if findings is None:
        return judge_value(value, parameters)
    if findings.evidence is not None and parameters.use_confidence:
        return judge_evidence(value, findings, parameters)
    doubts = _doubts(findings, parameters)
    verdict, reasons = judge_value(value, parameters)
    doubtful = verdict is Verdict.ACCEPTED and bool(doubts)
    return Verdict.REVIEW if doubtful else verdict, (*doubts, *reasons)


def clear(findings: Findings, parameters: Parameters) -> bool:
    """Whether there is no need to look further, whatever the thresholds in force are: sure, and without a doubt."""
    return confidence(findings) >= SURE and not _doubts(findings, parameters)


def judge_value(value: float, parameters: Parameters) -> tuple[Verdict, tuple[str, ...]]:
    """The paper's rule: valid only above the threshold (IV-B, V-B)."""
    threshold = parameters.value_threshold
    said = told(value, threshold, 2, inclusive=False)
    if value > threshold:
        return Verdict.ACCEPTED, (f"The value, {said} m, is above the threshold of {threshold:.2f} m.",)
    return Verdict.REJECTED, (f"The best value, {said} m, is not above the threshold of {threshold:.2f} m.",)


def told(number: float, limit: float, digits: int, *, inclusive: bool = True) -> str:
    """A number rounded for reading, but never across the limit it is compared with: with more digits there.

    ``inclusive``: whether the limit itself is enough.

    >>> told(0.8999, 0.9, 2), told(0.8912, 0.9, 2), told(4.001, 4.0, 2, inclusive=False)
    ('0.8999', '0.89', '4.001')
    """
    passes = operator.ge if inclusive else operator.gt
    while digits < MOST_DIGITS and passes(round(number, digits), limit) != passes(number, limit):
        digits += 1
    return f"{number:.{digits}f}"


def judge_evidence(value: float, findings: Findings, parameters: Parameters) -> tuple[Verdict, tuple[str, ...]]:
    """The verdict on evidence: enough confidence, no doubt of a kind that confidence cannot weigh, and a value
    above the threshold too.

    Whatever the confidence, a person decides where a rival might as well be right, and where no wall holds
    the pose along some direction, as in a corridor.
    """
    sure = confidence(findings)
    doubts = _doubts(findings, parameters)
    verdict, value_reasons = judge_value(value, parameters)
    reasons = (_certainty(sure, parameters), *doubts, *_seen(findings.evidence), *value_reasons)
    if sure < parameters.confidence_review or (verdict is Verdict.REJECTED and sure < parameters.confidence_accept):
        return Verdict.REJECTED, reasons
    if sure >= parameters.confidence_accept and verdict is Verdict.ACCEPTED and not doubts:
        return Verdict.ACCEPTED, reasons
    return Verdict.REVIEW, reasons


def _certainty(sure: float, parameters: Parameters) -> str:
    if sure >= parameters.confidence_accept:
        return (
            f"Confidence {told(sure, parameters.confidence_accept, 3)}: at or above {parameters.confidence_accept:g}."
        )
    if sure >= parameters.confidence_review:
        said = told(sure, parameters.confidence_accept, 3)
        return f"Confidence {said}: between {parameters.confidence_review:g} and {parameters.confidence_accept:g}."
    return f"Confidence {told(sure, parameters.confidence_review, 3)}: below {parameters.confidence_review:g}."


def _doubts(findings: Findings, parameters: Parameters) -> tuple[str, ...]:
    """What leaves the choice to a person, in words."""
    rival = _rival(findings) if parameters.use_rivals else ""
    loose = is_loose(findings.weakest, parameters)
    return tuple(
        sentence
        for sentence, holds in (
            (f"{rival}: look at the rivals.", rival),
            (f"Along its weakest direction the pose is known only to {findings.weakest:.2f} m.", loose),
            ("One of the maps knows of no lines of sight: its value is all that speaks for it.", findings.blind),
            (_against_the_prior(findings), findings.excluded > max(0.0, findings.score)),
        )
        if holds
    )


def is_loose(weakest: float, parameters: Parameters) -> bool:
    """Whether a pose this uncertain along its weakest direction may as well be that of a rival."""
    return weakest > parameters.rival_distance / 2.0


def _rival(findings: Findings) -> str:
    """What is to be said of the rivals; empty where they are beaten."""
    score = max(0.0, findings.score)
    if findings.score - findings.gap > CLOSE_SHARE * score:
        return f"A distinct rival scores only {findings.gap:.2f} m less"
    less = findings.score - findings.unrefuted
    if findings.unrefuted > RIVAL_SHARE * score:
        return f"A distinct rival scores {less:.2f} m less, but nothing speaks against it"
    plain = findings.evidence is not None and findings.evidence.off_three <= PLAIN
    if plain and findings.unrefuted > PLAIN_SHARE * score:
        return f"Only plain walls match, and nothing speaks against a distinct rival that scores {less:.2f} m less"
    return ""


def _against_the_prior(findings: Findings) -> str:
    more = findings.excluded - findings.score
    return f"A pose that the prior excludes scores {more:.2f} m more: the prior may be wrong."


def _seen(evidence: Evidence | None) -> tuple[str, ...]:
    if evidence is None:
        return ()
    against = evidence.contradicted + evidence.shadowed
    seen, unseen = f"{evidence.supported:.1f} m are seen by both", f"{evidence.unseen:.1f} m are unseen"
    return (f"{seen}, {against:.1f} m contradict, {unseen}.",)
