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
from typing import TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from segmap.candidates import Candidates, candidates
from segmap.errors import LogError
from segmap.evaluation import evaluate
from segmap.integration import Candidate, Match, Verdict, match_maps
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.refinement import distinct, refined
from segmap.scans import LaserLog
from segmap.segments import SegmentMap, extract
from segmap.visibility import look, sighting
from segmap.visibility import score as sight_score

__all__ = [
    "NEGATIVE",
    "RIVALS",
    "KindScore",
    "LogScore",
    "Outcome",
    "Pair",
    "PairSet",
    "brute_force",
    "first_rivals",
    "is_right",
    "run_pairs",
    "score",
]

_T = TypeVar("_T")

RIGHT_DISTANCE = 0.25
"""metres"""
RIGHT_ANGLE = math.radians(5.0)
NEGATIVE = "negative"
RIVALS = 3
"""so many distinct poses a person is expected to look at"""
EXHAUSTIVE_STEPS, EXHAUSTIVE_GATE = 10, 0.1
"""steps of refinement of the brute-force twin, and the gate in metres that it ends with"""


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
    overlap: float | None = None
    """share of what one scan sees that the other sees too, in 0..1, where it is known"""

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
    """from ranges to verdict; of several repeats the median"""
    cpu_milliseconds: float
    """processor time of the same, which other programs on the machine hardly change"""
    rivals: tuple[Candidate, ...]
    """the first three distinct candidates, best first"""
    brute_milliseconds: float | None = None
    """processor time of the brute-force twin, where it was asked for"""
    brute_right: bool | None = None
    """whether the brute-force twin's best pose is right; None where it was not asked for, or there is no right one"""

    @property
    def among_first(self) -> bool:
        """Whether the right pose is one of the first three distinct ones."""
        return any(is_right(rival.T_1_2, self.pair.truth) for rival in self.rivals)

    @property
    def fault(self) -> str:
        """What went wrong with this pair, in words; empty where nothing did."""
        accepted = self.match.verdict is Verdict.ACCEPTED
        if self.pair.kind == NEGATIVE:
            return "accepted without a common wall" if accepted else ""
        if not self.right:
            told = "accepted and wrong" if accepted else f"wrong, {self.match.verdict.value}"
            return told if self.among_first else f"{told}, not among the first {RIVALS}"
        return "right, but rejected" if self.match.verdict is Verdict.REJECTED else ""


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
    among_first_three: float | None
    """share whose right pose is one of the first three distinct ones; None for pairs without one"""
    median_cpu_ms: float
    p95_cpu_ms: float
    brute_force_ratio: float | None
    """processor time of the brute-force twin over ours, median of the pairs it was asked for"""
    brute_force_success: float | None
    """share of those pairs on which the twin's best pose is right; None for pairs without one"""


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


def first_rivals(match: Match, parameters: Parameters, most: int = RIVALS) -> tuple[Candidate, ...]:
    """The first distinct candidates of a match, best first: what a person would be shown."""
    poses = np.array([(*candidate.T_1_2,) for candidate in match.ranked]).reshape(-1, 3)
    rows = distinct(poses, np.arange(len(poses)), parameters.rival_distance, parameters.rival_angle, most)
    return tuple(match.ranked[int(row)] for row in rows)


def brute_force(
    map_1: SegmentMap, map_2: SegmentMap, parameters: Parameters | None = None, mode: str = "paper"
) -> Pose2 | None:
    """The best pose with nothing skipped: the twin that shows what the search saves.

    Every candidate of `all` gets its value; in verified mode every one is refined against every return and
    judged by every return instead. No index, no bound, no shortlist, no thinning.
    """
    parameters = parameters or Parameters()
    poses = Candidates.joined(list(candidates(map_1, map_2, "all", parameters))).poses
    seen_1, seen_2 = sighting(map_1), sighting(map_2)
    if mode == "verified" and seen_1 is not None and seen_2 is not None:
        poses = refined(seen_1, seen_2, poses, EXHAUSTIVE_STEPS, parameters.refine_gate, EXHAUSTIVE_GATE)
        values = sight_score(look(seen_1, seen_2, poses, parameters), parameters)
    else:
        values = np.nan_to_num(evaluate(map_1, map_2, poses, parameters), nan=-np.inf)
    return Pose2(*poses[int(values.argmax())]) if len(poses) else None


def run_pairs(
    pair_set: PairSet,
    log: LaserLog,
    parameters: Parameters | None = None,
    heuristic: str | None = None,
    mode: str = "paper",
    *,
    repeats: int = 1,
    brute: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> list[Outcome]:
    """Match every pair of a set on one thread.

    Of ``repeats`` runs of a pair the median time counts. The brute-force twin runs once on ``brute`` pairs of
    each kind, evenly spread. ``progress`` is told how many of how many are done.

    Raises:
        ScanError: the log does not hold a scan that a pair names.
    """
    run = _Run(log, parameters or Parameters(), heuristic, mode, max(1, repeats))
    chosen = _evenly(pair_set.pairs, brute)
    outcomes = []
    for number, pair in enumerate(pair_set.pairs):
        outcomes.append(run.outcome(pair, brute=number in chosen))
        if progress is not None:
            progress(len(outcomes), len(pair_set.pairs))
    return outcomes


def _evenly(pairs: Sequence[Pair], count: int) -> set[int]:
    """The places of at most ``count`` pairs of each kind, evenly spread."""
    kinds: dict[str, list[int]] = {}
    for number, pair in enumerate(pairs):
        kinds.setdefault(pair.kind, []).append(number)
    places = [np.linspace(0, len(held) - 1, min(count, len(held))).astype(int) for held in kinds.values()]
    return {held[k] for held, chosen in zip(kinds.values(), places, strict=True) for k in chosen}


@dataclass(frozen=True, eq=False)
class _Run:
    log: LaserLog
    parameters: Parameters
    heuristic: str | None
    mode: str
    repeats: int

    def outcome(self, pair: Pair, brute: bool) -> Outcome:
        match, milliseconds, cpu = self._timed(pair, self._match, self.repeats)
        refused = pair.kind == NEGATIVE and match.verdict is not Verdict.ACCEPTED
        right = refused or is_right(match.T_1_2, pair.truth)
        rivals = first_rivals(match, self.parameters)
        if not brute:
            return Outcome(pair, match, right, milliseconds, cpu, rivals)
        best, _, twin = self._timed(pair, self._brute, 1)
        found = None if pair.kind == NEGATIVE else is_right(best, pair.truth)
        return Outcome(pair, match, right, milliseconds, cpu, rivals, twin, found)

    def _timed(self, pair: Pair, run: Callable[[SegmentMap, SegmentMap], _T], repeats: int) -> tuple[_T, float, float]:
        """What a run from ranges gives, and its milliseconds by the clock and of the processor."""
        scan_1, scan_2 = self.log.scan(pair.i), self.log.scan(pair.j)
        times = []
        for _ in range(repeats):
            started = time.perf_counter(), time.thread_time()
            given = run(extract(scan_1, self.parameters), extract(scan_2, self.parameters))
            times.append((time.perf_counter() - started[0], time.thread_time() - started[1]))
        wall, cpu = 1000.0 * np.median(times, axis=0)
        return given, float(wall), float(cpu)

    def _match(self, map_1: SegmentMap, map_2: SegmentMap) -> Match:
        return match_maps(map_1, map_2, self.parameters, self.heuristic, self.mode)

    def _brute(self, map_1: SegmentMap, map_2: SegmentMap) -> Pose2 | None:
        return brute_force(map_1, map_2, self.parameters, self.mode)


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
    cpu_times = [outcome.cpu_milliseconds for outcome in outcomes]
    return KindScore(
        pairs=len(outcomes),
        success=_share(o.right for o in outcomes),
        median_ms=float(np.median(times)),
        p95_ms=float(np.percentile(times, 95)),
        accepted_right=_share(a and c for a, c in zip(accepted, correct, strict=True)),
        accepted_wrong=_share(a and not c for a, c in zip(accepted, correct, strict=True)),
        review=_share(o.match.verdict is Verdict.REVIEW for o in outcomes),
        rejected=_share(o.match.verdict is Verdict.REJECTED for o in outcomes),
        among_first_three=_known_share(None if o.pair.kind == NEGATIVE else o.among_first for o in outcomes),
        median_cpu_ms=float(np.median(cpu_times)),
        p95_cpu_ms=float(np.percentile(cpu_times, 95)),
        brute_force_ratio=_ratio(outcomes),
        brute_force_success=_known_share(o.brute_right for o in outcomes),
    )


def _ratio(outcomes: Sequence[Outcome]) -> float | None:
    ratios = [o.brute_milliseconds / o.cpu_milliseconds for o in outcomes if o.brute_milliseconds is not None]
    return float(np.median(ratios)) if ratios else None


def _recall(outcomes: Sequence[Outcome]) -> float:
    worst = max((o.match.score for o in outcomes if o.pair.kind == NEGATIVE), default=0.0)
    return _share(o.right and o.match.score > worst for o in outcomes if o.pair.kind != NEGATIVE)


def _share(flags: Iterable[bool]) -> float:
    held = list(flags)
    return sum(held) / len(held) if held else 0.0


def _known_share(flags: Iterable[bool | None]) -> float | None:
    """The share of those that are known; None where none is."""
    held = [flag for flag in flags if flag is not None]
    return _share(held) if held else None
