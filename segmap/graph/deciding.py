"""Which of several places least squares can end in is the right one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from segmap.graph.least_squares import STEPS
from segmap.graph.robust import FIRST_STEPS, Minimise, Problem, Round, reconsidered, settled
from segmap.pose import FloatArray

__all__ = ["decided"]

MANY = 0.05
"""of the edges that can be silenced; where more are, the poses that were given are taken for wrong"""
FINE = 5.0
"""standard deviations; where no edge is farther off, no better place is looked for"""


def decided(
    problem: Problem, minimise: Minimise, begin: Callable[[FloatArray], FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Poses (n, 3) and weights (m,): the best of what is found on two roads, if all edges do not agree anyway.

    From a start whose errors are those of a chain, hearing silenced edges again, the surest first, finds the
    best place; where wrong edges went into the start, the rounds of graduated non-convexity do, ``begin``.
    Poses that were given are relied on unless much is silenced from there; those along the surest edges only
    where nothing is: an edge that claims to be surer than all others may be wrong.
    """
    if not len(problem.free):
        return _plain(problem, minimise)
    every = np.ones(len(problem.edges))
    agreed = minimise(problem.starts[0], every, FIRST_STEPS)
    if (problem.edges.squares(agreed) <= problem.gate**2).all():
        problem.tell(Round(problem.loss(agreed), 0, agreed))
        return minimise(agreed, every, STEPS), every
    found = _both(problem, problem.starts[0], minimise, begin)
    bearable = MANY * len(problem.free) if problem.given else 0.0
    for start in problem.starts[1:]:
        if min(_silenced(weights) for _, weights in found) > bearable:
            found += _both(problem, start, minimise, begin)
    poses, weights = min(found, key=lambda one: problem.loss(one[0]))
    return minimise(poses, weights, STEPS), weights


def _both(
    problem: Problem, start: FloatArray, minimise: Minimise, begin: Callable[[FloatArray], FloatArray]
) -> list[tuple[FloatArray, FloatArray]]:
    """What the two roads find from a start."""
    return [_from(problem, poses, minimise) for poses in (start, begin(start))]


def _from(problem: Problem, poses: FloatArray, minimise: Minimise) -> tuple[FloatArray, FloatArray]:
    return reconsidered(problem, *settled(problem, poses, minimise), minimise)


def _silenced(weights: FloatArray) -> int:
    return int((weights == 0.0).sum())


def _plain(problem: Problem, minimise: Minimise) -> tuple[FloatArray, FloatArray]:
    """Where every edge counts."""
    every, found = np.ones(len(problem.edges)), []
    for start in problem.starts:
        poses = minimise(start, every, STEPS)
        found.append(poses)
        problem.tell(Round(problem.loss(poses), 0, poses))
        if (problem.edges.squares(poses) <= FINE**2).all():
            break
    return min(found, key=problem.loss), every
