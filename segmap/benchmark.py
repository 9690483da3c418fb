"""How well pairs are integrated: the pair benchmark.

A pair set names a log and pairs of its scans with the true pose of scan j in the frame of scan i.
Matching gets the two scans' ranges and nothing else. A positive pair is right within 0.25 m and
5 degrees of the truth; on a negative pair, without a common wall, the right answer is no integration.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from segmap.errors import LogError
from segmap.integration import Match, Verdict, match_maps
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.scans import LaserLog
from segmap.segments import extract

__all__ = ["KindScore", "LogScore", "Outcome", "Pair", "PairSet", "is_right", "run_pairs", "score"]

RIGHT_DISTANCE = 0.25
"""metres"""
RIGHT_ANGLE = math.radians(5.0)
NEGATIVE = "negative"


class Pair(BaseModel):
    """Two scans of a log and the true pose of the second in the frame of the first."""

    model_config = ConfigDict(frozen=True)

    kind: str
    """``consecutive``, ``wide`` or ``negative``; other names are kinds of positive pairs"""
    i: int = Field(ge=0)
    j: int = Field(ge=0)
    x: float | None = None
    """metres"""
    y: float | None = None
    """metres"""
    theta: float | None = None
    """radians"""

    @property
    def truth(self) -> Pose2 | None:
        """True ``T_i_j``; None where the scans have no common wall."""
        if self.kind == NEGATIVE or self.x is None or self.y is None or self.theta is None:
            return None
        return Pose2(self.x, self.y, self.theta)


class PairSet(BaseModel):
    """Pairs of one log."""

    model_config = ConfigDict(frozen=True)

    log: str
    """path of the log below the folder of logs"""
    pairs: tuple[Pair, ...]

    @classmethod
    def from_json(cls, text: str | bytes, name: str = "pairs") -> PairSet:
        """The pair set of a JSON document ``{"log": ..., "pairs": [{"kind", "i", "j", "x", "y", "theta"}]}``.

        Raises:
            LogError: it is no such document.
        """
        try:
            return cls.model_validate_json(text)
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(str(part) for part in first["loc"]) or "the document"
            raise LogError(f"{name} is not a set of pairs: {where}: {first['msg'].lower()}.") from None


@dataclass(frozen=True)
class Outcome:
    """What one pair gave."""

    pair: Pair
    match: Match
    right: bool
    """within 0.25 m and 5 degrees of the truth; for a negative pair: not accepted"""
    milliseconds: float
    """from ranges to verdict"""


@dataclass(frozen=True)
class KindScore:
    """Shares, in 0..1, and times of the pairs of one kind."""

    pairs: int
    success: float
    median_ms: float
    p95_ms: float
    accepted_right: float
    accepted_wrong: float
    review: float
    rejected: float


@dataclass(frozen=True)
class LogScore:
    """The scores of one log."""

    log: str
    kinds: dict[str, KindScore]
    recall_at_zero_false_accepts: float
    """share of positive pairs that are right and score above every negative pair"""


def is_right(T_1_2: Pose2 | None, truth: Pose2 | None) -> bool:
    """Whether a pose is within 0.25 m and 5 degrees of the truth; False where either is missing."""
    if T_1_2 is None or truth is None:
        return False
    distance, angle = T_1_2.distance(truth)
    return distance <= RIGHT_DISTANCE and angle <= RIGHT_ANGLE


def run_pairs(
    pair_set: PairSet,
    log: LaserLog,
    parameters: Parameters | None = None,
    heuristic: str | None = None,
    mode: str = "paper",
    *,
    progress: Callable[[int, int], None] | None = None,
) -> list[Outcome]:
    """Match every pair of a set on one thread; ``progress`` is told how many of how many are done.

    Raises:
        ScanError: the log does not hold a scan that a pair names.
    """
    outcomes = []
    for pair in pair_set.pairs:
        outcomes.append(_outcome(pair, log, parameters or Parameters(), heuristic, mode))
        if progress is not None:
            progress(len(outcomes), len(pair_set.pairs))
    return outcomes


def _outcome(pair: Pair, log: LaserLog, parameters: Parameters, heuristic: str | None, mode: str) -> Outcome:
    scan_1, scan_2 = log.scan(pair.i), log.scan(pair.j)
    started = time.perf_counter()
    match = match_maps(extract(scan_1, parameters), extract(scan_2, parameters), parameters, heuristic, mode)
    milliseconds = 1000.0 * (time.perf_counter() - started)
    refused = pair.kind == NEGATIVE and match.verdict is not Verdict.ACCEPTED
    return Outcome(pair, match, refused or is_right(match.T_1_2, pair.truth), milliseconds)


def score(name: str, outcomes: Sequence[Outcome]) -> LogScore:
    """The scores of one log's outcomes."""
    kinds: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        kinds.setdefault(outcome.pair.kind, []).append(outcome)
    return LogScore(name, {kind: _kind_score(of_kind) for kind, of_kind in kinds.items()}, _recall(outcomes))


def _kind_score(outcomes: Sequence[Outcome]) -> KindScore:
    times = [outcome.milliseconds for outcome in outcomes]
    accepted = [o.match.verdict is Verdict.ACCEPTED for o in outcomes]
    correct = [is_right(o.match.T_1_2, o.pair.truth) for o in outcomes]
    return KindScore(
        pairs=len(outcomes),
        success=_share(o.right for o in outcomes),
        median_ms=float(np.median(times)),
        p95_ms=float(np.percentile(times, 95)),
        accepted_right=_share(a and c for a, c in zip(accepted, correct, strict=True)),
        accepted_wrong=_share(a and not c for a, c in zip(accepted, correct, strict=True)),
        review=_share(o.match.verdict is Verdict.REVIEW for o in outcomes),
        rejected=_share(o.match.verdict is Verdict.REJECTED for o in outcomes),
    )


def _recall(outcomes: Sequence[Outcome]) -> float:
    worst = max((o.match.score for o in outcomes if o.pair.kind == NEGATIVE), default=0.0)
    return _share(o.right and o.match.score > worst for o in outcomes if o.pair.kind != NEGATIVE)


def _share(flags: Iterable[bool]) -> float:
    held = list(flags)
    return sum(held) / len(held) if held else 0.0
