"""Verified mode: the same candidates, judged by evidence beyond the paper.

With lines of sight, refinement and rivals all switched off it is paper mode, to the last bit. A prior only chooses
among what the maps say: see :mod:`segmap.priors`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from segmap.candidates import Candidates
from segmap.evaluation import matching_values
from segmap.matches import Candidate
from segmap.paper_mode import Found, Task, angles_of, as_the_paper, best_by_value, blocks
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray, Pose2
from segmap.refinement import of_covariance
from segmap.segments import Order
from segmap.verdict import Findings, clear, findings, is_loose
from segmap.verification import FINALISTS, Verified, Views, judged, verify, views
from segmap.visibility import evidence

__all__ = ["AUTOMATIC", "MOST_ANGLES", "STAGES", "verified"]

AUTOMATIC = "automatic"
"""verified mode's own choice of heuristic: cheapest first, until the evidence is clear"""
STAGES = ("extremes", "all")
"""what ``automatic`` tries in turn"""
MOST_ANGLES = 500_000
"""pairs of angles; where a partial map has more, ``automatic`` does without ``all``"""
FIRMER = 0.9
"""a prior that leaves more of the standard deviation along the weakest direction fixes nothing"""
BY_VALUE = "all"
"""what ``automatic`` is where nothing but values can rank"""


def verified(task: Task) -> Found:
    """The heuristic's candidates on the evidence; ``automatic`` goes on until the evidence is clear."""
    parameters = task.parameters
    extras = parameters.use_sights or parameters.use_refinement or parameters.use_rivals
    seen = views(task.map_1, task.map_2, parameters) if extras else None
    if seen is None:
        return _by_value(task)
    found, kept, discarded = Candidates.joined([]), _Kept(), 0
    result = Found((), 0)
    for heuristic in _stages(task):
        block = Candidates.joined([*_expected(task, found), *blocks(task, heuristic)])
        rows, crossing = _worth_judging(task, block)
        kept = kept.with_more(task, seen, block.poses[rows], len(found) + rows)
        found, discarded = Candidates.joined([found, block]), discarded + crossing
        result = _ranked(task, found, kept, seen, discarded)
        if result.findings is not None and clear(result.findings, parameters):
            break
    return result


def _by_value(task: Task) -> Found:
    """Paper mode's result; where lines of sight are asked for but unknown, the findings say so."""
    heuristic = BY_VALUE if task.heuristic == AUTOMATIC else task.heuristic
    found = as_the_paper(replace(task, heuristic=heuristic))
    if not found.ranked or not task.parameters.use_sights:
        return found
    value = found.ranked[0].value
    return replace(found, findings=Findings(value, value, None, 0.0, blind=True))


@dataclass(frozen=True, eq=False)
class _Kept:
    """The best so far of the candidates that the prior admits, and of the others."""

    admitted: Verified | None = None
    others: Verified | None = None

    def with_more(self, task: Task, seen: Views, poses: FloatArray, places: IntArray) -> _Kept:
        """With the best of more candidates, which have these places among all."""
        near = np.ones(len(poses), bool) if task.prior is None else task.prior.admits_unrefined(poses)
        return _Kept(
            _more(self.admitted, task, seen, poses[near], places[near]),
            _more(self.others, task, seen, poses[~near], places[~near]),
        )

    def all(self, parameters: Parameters) -> Verified | None:
        """The best of both."""
        if self.admitted is None or self.others is None:
            return self.admitted or self.others
        return self.admitted.joined(self.others, parameters, 2 * FINALISTS)


def _more(kept: Verified | None, task: Task, seen: Views, poses: FloatArray, places: IntArray) -> Verified | None:
    if not len(poses):
        return kept
    fresh = verify(seen, poses, task.parameters).placed(places)
    return fresh if kept is None else kept.joined(fresh, task.parameters)


def _expected(task: Task, found: Candidates) -> tuple[Candidates, ...]:
    """The mean of a narrow prior, as the first candidate of all; its angle: the two segments it matches best."""
    if task.prior is None or not task.prior.narrow or len(found):
        return ()
    pairs, values = matching_values(task.map_1, task.map_2, task.prior.mean, task.parameters)
    if not len(pairs):
        return ()
    i, j = pairs[np.argmax(values)]
    return (Candidates(np.array([tuple(task.prior.mean)]), np.array([[i, i]]), np.array([[j, j]])),)


def _stages(task: Task) -> tuple[str, ...]:
    """The heuristics to try in turn."""
    angles = math.prod(len(m) * (len(m) - 1) // 2 for m in (task.map_1, task.map_2))
    too_many = angles > MOST_ANGLES and Order.NONE in (task.map_1.order, task.map_2.order)
    automatic = STAGES[:1] if too_many else STAGES
    return automatic if task.heuristic == AUTOMATIC else (task.heuristic,)


def _worth_judging(task: Task, block: Candidates) -> tuple[IntArray, int]:
    """The rows of all candidates, or of the best by value where there are many; and how many were discarded."""
    most = task.parameters.judged_candidates
    if len(block) <= most:
        return np.arange(len(block)), 0
    top = best_by_value(task, block, most)
    return np.sort(top.rows), top.discarded


def _ranked(task: Task, found: Candidates, kept: _Kept, seen: Views, discarded: int) -> Found:
    """The refined candidates, best first, and what speaks for and against the first."""
    result = Found((), len(found), discarded, found.draws)
    best = kept.all(task.parameters)
    if best is None:
        return result
    inside = _inside(task, best)
    outside = best.take(np.flatnonzero(~inside)[:1])
    ranked = _candidates_of(task, found, _fixed(task, seen, best.take(np.flatnonzero(inside)[:FINALISTS])))
    elsewhere = Pose2(*outside.poses[0]) if len(outside.rows) else None
    excluded = float(outside.merits.max(initial=0.0))
    return replace(result, ranked=ranked, elsewhere=elsewhere, findings=_findings(ranked, excluded, task.parameters))


def _inside(task: Task, kept: Verified) -> NDArray[np.bool_]:
    """What the prior admits: near its mean, along what walls hold of a pose."""
    if task.prior is None:
        return np.ones(len(kept.rows), bool)
    loose = [np.zeros((3, 3)) if held is None else np.array(held.covariance) for held in kept.held]
    return task.prior.admits(kept.poses, np.array(loose).reshape(-1, 3, 3))


def _fixed(task: Task, seen: Views, kept: Verified) -> Verified:
    """The same, but what no wall holds along some direction lies there as the prior has it, if the prior is firmer."""
    loose = {
        k: held
        for k, held in enumerate(kept.held)
        if held is not None and task.prior is not None and is_loose(held.weakest, task.parameters)
    }
    if task.prior is None or not loose:
        return kept
    poses, firmer = kept.poses.copy(), {}
    for k, held in loose.items():
        pose, covariance = task.prior.combined(Pose2(*poses[k]), np.array(held.covariance))
        known = of_covariance(covariance)
        if known.weakest < FIRMER * held.weakest:
            poses[k], firmer[k] = tuple(pose), known
    if not firmer:
        return kept
    moved = judged(seen, kept.rows, poses, task.parameters)
    if len(moved.rows) < len(kept.rows):
        return kept  # without lines of sight, where a pose has lost its value
    return replace(moved, held=tuple(firmer.get(k, held) for k, held in enumerate(kept.held))).best(task.parameters)


def _candidates_of(task: Task, found: Candidates, kept: Verified) -> tuple[Candidate, ...]:
    sights = task.parameters.use_sights
    return tuple(
        Candidate(
            T_1_2,
            float(matching_values(task.map_1, task.map_2, T_1_2, task.parameters)[1].sum()),
            *angles_of(found, int(row)),
            index=int(row),
            score=float(merit) if sights else None,
            evidence=evidence(totals) if sights else None,
            uncertainty=held,
        )
        for row, T_1_2, totals, merit, held in zip(
            kept.rows, (Pose2(*pose) for pose in kept.poses), kept.totals, kept.merits, kept.held, strict=True
        )
    )


def _findings(ranked: tuple[Candidate, ...], excluded: float, parameters: Parameters) -> Findings | None:
    if not ranked:
        return None
    told = [(c.value if c.score is None else c.score, c.evidence) for c in ranked]
    held = ranked[0].uncertainty
    rivals = len(told) if parameters.use_rivals else 1
    return findings(told[:rivals], held.weakest if held else 0.0, excluded=excluded)
