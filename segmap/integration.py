"""INTEGRATE: the paper's three steps for two maps (Section III, Algorithm 1)."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from segmap.candidates import HEURISTICS, PAPER_HEURISTICS, Candidates, candidates
from segmap.chains import matching_chains
from segmap.errors import ParameterError
from segmap.evaluation import Best, matching_values, search
from segmap.fusion import Fusion, fuse
from segmap.matches import Candidate, Match
from segmap.parameters import Parameters
from segmap.pose import IntArray, Pose2
from segmap.refinement import uncertainties
from segmap.segments import Order, SegmentMap
from segmap.verdict import Findings, Verdict, confidence, findings, judge
from segmap.verification import Verified, Views, verify, views
from segmap.visibility import evidence

__all__ = [
    "AUTOMATIC",
    "DEFAULT_HEURISTIC",
    "DEFAULT_PRESET",
    "MODES",
    "Candidate",
    "Integration",
    "Match",
    "Verdict",
    "chosen_heuristic",
    "findings_of",
    "heuristics",
    "integrate",
    "match_maps",
]

MODES = ("paper", "verified")
"""``paper``: Algorithms 1 to 5 as the paper has them; ``verified``: the same, then evidence beyond the paper"""
AUTOMATIC = "automatic"
"""verified mode's own choice of heuristic: cheapest first, until the evidence is clear"""
STAGES = ("extremes", "all")
"""what ``automatic`` tries in turn"""
MOST_ANGLES = 500_000
"""pairs of angles; where a partial map has more, ``automatic`` does without ``all``"""
DEFAULT_HEURISTIC = {"paper": "all", "verified": AUTOMATIC}
"""the heuristic of each mode where none is asked for"""
DEFAULT_PRESET = {"paper": "default", "verified": "verified"}
"""the preset each mode's parameters start from"""


def heuristics(mode: str) -> tuple[str, ...]:
    """The heuristics of a mode: the paper's four, or those and what goes beyond."""
    return PAPER_HEURISTICS if mode == "paper" else (AUTOMATIC, *HEURISTICS)


def chosen_heuristic(mode: str, name: str | None = None) -> str:
    """The heuristic of this name, or the mode's default.

    Raises:
        ParameterError: there is no such mode, or no such heuristic in it.
    """
    if mode not in MODES:
        raise ParameterError(f"There is no mode {mode[:80]!r}. Modes are: {', '.join(MODES)}.")
    if name is not None and name not in heuristics(mode):
        known = ", ".join(heuristics(mode))
        raise ParameterError(f"There is no heuristic {name[:80]!r} in {mode} mode. Heuristics are: {known}.")
    return name or DEFAULT_HEURISTIC[mode]


@dataclass(frozen=True, eq=False)
class Integration:
    """INTEGRATE(S_1, S_2): the match, and the fused map where there is a transformation."""

    match: Match
    fusion: Fusion | None

    @property
    def map(self) -> SegmentMap | None:
        """S_1,2 in the frame of map 1."""
        return self.fusion.map if self.fusion else None


def integrate(
    map_1: SegmentMap,
    map_2: SegmentMap,
    parameters: Parameters | None = None,
    heuristic: str | None = None,
    mode: str = "paper",
    *,
    workers: int = 1,
    check: Callable[[], None] | None = None,
) -> Integration:
    """Integrate two maps (Algorithm 1): find and evaluate transformations, fuse under the best.

    Raises:
        ParameterError: there is no such heuristic or mode.
        CancelledError: raised by ``check``, which is called between blocks of work.
    """
    parameters = parameters or Parameters()
    match = match_maps(map_1, map_2, parameters, heuristic, mode, workers=workers, check=check)  # steps 1 and 2
    if match.T_1_2 is None:
        return Integration(match, None)
    return Integration(match, fuse(map_1, map_2, match.T_1_2, match.chains, parameters))  # step 3


def match_maps(
    map_1: SegmentMap,
    map_2: SegmentMap,
    parameters: Parameters | None = None,
    heuristic: str | None = None,
    mode: str = "paper",
    *,
    workers: int = 1,
    check: Callable[[], None] | None = None,
) -> Match:
    """The first two steps of INTEGRATE, "scan matching": candidate transformations, and the best of them.

    Without a heuristic the mode's default is taken.

    Raises: as :func:`integrate`.
    """
    task = _Task(map_1, map_2, parameters or Parameters(), chosen_heuristic(mode, heuristic), workers, check)
    started = time.perf_counter()
    found = _verified(task) if mode == "verified" else _as_the_paper(task)
    verdict, reasons = _verdict(found, task)
    known = _findings(found.ranked)
    return Match(
        mode=mode,
        heuristic=task.heuristic,
        segments=(len(map_1), len(map_2)),
        ranked=found.ranked,
        candidates=found.tried,
        discarded=found.discarded,
        draws=found.draws if task.heuristic == "random" else None,
        chains=matching_chains(map_1, map_2, found.ranked[0].T_1_2, task.parameters) if found.ranked else (),
        verdict=verdict,
        reasons=reasons,
        milliseconds=1000.0 * (time.perf_counter() - started),
        confidence=_confidence(known) if mode == "verified" else None,
        findings=known,
    )


@dataclass(frozen=True, eq=False)
class _Task:
    map_1: SegmentMap
    map_2: SegmentMap
    parameters: Parameters
    heuristic: str
    workers: int
    check: Callable[[], None] | None


@dataclass(frozen=True)
class _Found:
    ranked: tuple[Candidate, ...]
    tried: int
    discarded: int = 0
    draws: int = 0


# --- paper mode -----------------------------------------------------------------------------------


def _as_the_paper(task: _Task) -> _Found:
    """Algorithms 2 or 3, then 4: the best of all candidates by value."""
    found = Candidates.joined(list(_tried(task)))
    top = _best(task, found, task.parameters.ranked_candidates)
    ranked = tuple(_candidate(found, row, value) for row, value in zip(top.rows, top.values, strict=True))
    return _Found(ranked, len(found), top.discarded, found.draws)


def _tried(task: _Task) -> Iterator[Candidates]:
    """The blocks of candidates; ``random`` may stop after a round that is good enough (III-A2)."""
    enough = task.parameters.good_enough
    for block in _checked(candidates(task.map_1, task.map_2, task.heuristic, task.parameters), task):
        yield block
        if block.draws and enough is not None and (_best(task, block, 1).values >= enough).any():
            break


def _best(task: _Task, found: Candidates, count: int) -> Best:
    return search(task.map_1, task.map_2, found.poses, task.parameters, count, workers=task.workers, check=task.check)


def _candidate(found: Candidates, row: int, value: float) -> Candidate:
    return Candidate(Pose2(*found.poses[row]), float(value), *_angles(found, row), index=int(row))


def _angles(found: Candidates, row: int) -> tuple[tuple[int, int], tuple[int, int]]:
    (a, b), (c, d) = found.angles_1[row], found.angles_2[row]
    return (int(a), int(b)), (int(c), int(d))


# --- verified mode --------------------------------------------------------------------------------


def _verified(task: _Task) -> _Found:
    """The heuristic's candidates on the evidence; ``automatic`` goes on until the verdict is clear."""
    seen = views(task.map_1, task.map_2, task.parameters)
    if seen is None:
        return _as_the_paper(replace(task, heuristic=_by_value(task.heuristic)))
    found, kept, discarded = Candidates.joined([]), None, 0
    ranked: tuple[Candidate, ...] = ()
    for heuristic in _stages(task):
        block = Candidates.joined(list(_checked(candidates(task.map_1, task.map_2, heuristic, task.parameters), task)))
        rows, crossing = _worth_judging(task, block)
        if len(rows):
            fresh = verify(seen, block.poses[rows], task.parameters).placed(len(found) + rows)
            kept = kept.joined(fresh, task.parameters) if kept else fresh
        found, discarded = Candidates.joined([found, block]), discarded + crossing
        ranked = _ranked(task, found, kept, seen) if kept else ()
        if ranked and _judgement(ranked, task.parameters)[0] is Verdict.ACCEPTED:
            break
    return _Found(ranked, len(found), discarded, found.draws)


def _stages(task: _Task) -> tuple[str, ...]:
    """The heuristics to try in turn."""
    angles = math.prod(len(m) * (len(m) - 1) // 2 for m in (task.map_1, task.map_2))
    too_many = angles > MOST_ANGLES and Order.NONE in (task.map_1.order, task.map_2.order)
    automatic = STAGES[:1] if too_many else STAGES
    return automatic if task.heuristic == AUTOMATIC else (task.heuristic,)


def _checked(blocks: Iterable[Candidates], task: _Task) -> Iterator[Candidates]:
    """The blocks, with a look before each at whether to stop."""
    for block in blocks:
        if task.check is not None:
            task.check()
        yield block


def _by_value(heuristic: str) -> str:
    """What to try where nothing is known of lines of sight."""
    return DEFAULT_HEURISTIC["paper"] if heuristic == AUTOMATIC else heuristic


def _worth_judging(task: _Task, block: Candidates) -> tuple[IntArray, int]:
    """The rows of all candidates, or of the best by value where there are many; and how many were discarded."""
    most = task.parameters.judged_candidates
    if len(block) <= most:
        return np.arange(len(block)), 0
    top = _best(task, block, most)
    return np.sort(top.rows), top.discarded


def _ranked(task: _Task, found: Candidates, kept: Verified, seen: Views) -> tuple[Candidate, ...]:
    """The distinct refined candidates, best first."""
    map_1, map_2, parameters = task.map_1, task.map_2, task.parameters
    held = uncertainties(map_1, map_2, seen.seen_1, seen.seen_2, kept.poses, parameters)
    return tuple(
        Candidate(
            T_1_2,
            float(matching_values(map_1, map_2, T_1_2, parameters)[1].sum()),
            *_angles(found, int(row)),
            index=int(row),
            score=float(score),
            evidence=evidence(totals),
            uncertainty=how_well,
        )
        for row, T_1_2, totals, score, how_well in zip(
            kept.rows, (Pose2(*pose) for pose in kept.poses), kept.totals, kept.scores, held, strict=True
        )
    )


# --- the verdict, in words ------------------------------------------------------------------------


def _verdict(found: _Found, task: _Task) -> tuple[Verdict, tuple[str, ...]]:
    """The judgement on the best candidate; where there is none, the nearest criterion that failed."""
    if not found.ranked:
        return Verdict.REJECTED, (_why_none(found, task),)
    return _judgement(found.ranked, task.parameters)


def _judgement(ranked: tuple[Candidate, ...], parameters: Parameters) -> tuple[Verdict, tuple[str, ...]]:
    return judge(ranked[0].value, _findings(ranked), parameters)


def _findings(ranked: tuple[Candidate, ...]) -> Findings | None:
    """What speaks for and against the best candidate; None without evidence."""
    if not ranked or ranked[0].uncertainty is None:
        return None
    judged = [(c.score, c.evidence) for c in ranked if c.score is not None and c.evidence is not None]
    return findings(judged, ranked[0].uncertainty.weakest)


def findings_of(match: Match) -> Findings | None:
    """What speaks for and against the best candidate of a match; None without evidence."""
    return match.findings


def _confidence(known: Findings | None) -> float:
    return 0.0 if known is None else confidence(known)


def _why_none(found: _Found, task: _Task) -> str:
    for name, segment_map in sorted((("first", task.map_1), ("second", task.map_2)), key=lambda named: len(named[1])):
        if len(segment_map) < 2:
            count = "one segment" if len(segment_map) else "no segments"
            return f"The {name} map has {count}; an angle takes two. Try a smaller min_segment_length."
    if not found.tried:
        return (
            "No angle of one map equals an angle of the other. Try another heuristic or a larger tolerance of angles."
        )
    if found.discarded == found.tried:
        return f"All {found.tried} candidates were discarded: long segments cross. Try a larger segment_length_refuse."
    return f"None of {found.tried} candidates brings any two segments together."
