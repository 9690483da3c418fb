"""Paper mode: every candidate's value, and the best of them (Algorithms 2 or 3, then 4)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from segmap.candidates import Candidates, candidates
from segmap.evaluation import Best, search
from segmap.matches import Candidate
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.priors import PosePrior
from segmap.segments import SegmentMap
from segmap.verdict import Findings

__all__ = ["Found", "Task", "angles_of", "as_the_paper", "best_by_value", "blocks"]


@dataclass(frozen=True, eq=False)
class Task:
    """Two maps to be matched, and how."""

    map_1: SegmentMap
    map_2: SegmentMap
    parameters: Parameters
    heuristic: str
    prior: PosePrior | None
    workers: int
    check: Callable[[], None] | None


@dataclass(frozen=True)
class Found:
    """What matching found, before anything is said of it."""

    ranked: tuple[Candidate, ...]
    """best first"""
    tried: int
    """candidates"""
    discarded: int = 0
    draws: int = 0
    findings: Findings | None = None
    """verified: what speaks for and against the best"""
    elsewhere: Pose2 | None = None
    """the best pose that the prior excludes"""


def as_the_paper(task: Task) -> Found:
    """Algorithms 2 or 3, then 4: the best of all candidates by value."""
    found = Candidates.joined(list(_tried(task)))
    top = best_by_value(task, found, task.parameters.ranked_candidates)
    ranked = tuple(_candidate(found, row, value) for row, value in zip(top.rows, top.values, strict=True))
    return Found(ranked, len(found), top.discarded, found.draws)


def _tried(task: Task) -> Iterator[Candidates]:
    """The blocks of candidates; ``random`` may stop after a round that is good enough (III-A2)."""
    enough = task.parameters.good_enough
    for block in blocks(task, task.heuristic):
        if task.prior is not None:
            block = block.take(np.flatnonzero(task.prior.admits(block.poses)))
        yield block
        if block.draws and enough is not None and (best_by_value(task, block, 1).values >= enough).any():
            break


def best_by_value(task: Task, found: Candidates, count: int) -> Best:
    """The best of some candidates by value, and how many are discarded."""
    return search(task.map_1, task.map_2, found.poses, task.parameters, count, workers=task.workers, check=task.check)


def _candidate(found: Candidates, row: int, value: float) -> Candidate:
    return Candidate(Pose2(*found.poses[row]), float(value), *angles_of(found, row), index=int(row))


def angles_of(found: Candidates, row: int) -> tuple[tuple[int, int], tuple[int, int]]:
    """The segments of each map that a candidate superimposes."""
    (a, b), (c, d) = found.angles_1[row], found.angles_2[row]
    return (int(a), int(b)), (int(c), int(d))


def blocks(task: Task, heuristic: str) -> Iterator[Candidates]:
    """The blocks of candidates, with a look before each at whether to stop."""
    for block in candidates(task.map_1, task.map_2, heuristic, task.parameters):
        if task.check is not None:
            task.check()
        yield block
