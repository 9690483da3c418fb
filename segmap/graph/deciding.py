"""Which of several places least squares can end in is the right one."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from segmap.graph.arrays import gaps
from segmap.graph.least_squares import STEPS
from segmap.graph.reattaching import reattached
from segmap.graph.robust import FIRST_STEPS, Minimise, Problem, Round, reconsidered, settled
from segmap.pose import FloatArray

__all__ = ["decided"]

MANY = 0.05
"""of the edges that can be silenced; where more are, the poses that were given are taken for wrong"""
DOUBTFUL, TRIED = 2.0, 20
"""times the gate up to which silenced edges are tried, and how many of them"""
LOOKS = 4
"""times that is looked for edges too many metres off"""
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
    first = problem.starts[0]()
    agreed = minimise(first, every, FIRST_STEPS)
    if (problem.edges.squares(agreed) <= problem.gate**2).all():
        problem.tell(Round(problem.loss(agreed), 0, agreed))
        return _within(problem, minimise(agreed, every, STEPS), every, minimise)
    found = _both(problem, first, minimise, begin)
    bearable = MANY * len(problem.free) if problem.given else 0.0
    for start in problem.starts[1:]:
        if min(_silenced(weights) for _, weights in found) > bearable:
            found += _both(problem, start(), minimise, begin)
    poses, weights = min(found, key=lambda one: problem.cost(*one))
    return _within(problem, *_heard(problem, minimise(poses, weights, STEPS), weights, minimise), minimise)


def _heard(
    problem: Problem, poses: FloatArray, weights: FloatArray, minimise: Minimise
) -> tuple[FloatArray, FloatArray]:
    """Poses and weights with those silenced edges that would be within the gate if they counted, as all others would.

    Without them the loss may be less; but where nothing is wrong they count, and what is wrong elsewhere must
    not change that.
    """
    squared = problem.edges.squares(poses)
    near = np.flatnonzero((weights == 0.0) & (squared <= (DOUBTFUL * problem.gate) ** 2))
    for edge in near[np.argsort(squared[near], kind="stable")][:TRIED]:
        counting = weights.copy()
        counting[edge] = 1.0
        moved = minimise(poses, counting, STEPS)
        counted = problem.free[counting[problem.free] > 0.0]
        if (problem.edges.squares(moved)[counted] <= problem.gate**2).all():
            poses, weights = moved, counting
    return poses, weights


def _within(
    problem: Problem, poses: FloatArray, weights: FloatArray, minimise: Minimise
) -> tuple[FloatArray, FloatArray]:
    """Poses and weights without the edges that are too many metres off, but for those that alone hold something."""
    if math.isinf(problem.most):
        return poses, weights
    for _ in range(LOOKS):
        far = problem.free[gaps(poses, problem.edges)[problem.free] > problem.most]
        far = far[weights[far] > 0.0]
        kept = weights.copy()
        kept[far] = 0.0
        poses = reattached(problem.edges, poses, kept, problem.gate)
        if (kept == weights).all():
            break
        poses, weights = minimise(poses, kept, STEPS), kept
    return poses, weights


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
        poses = minimise(start(), every, STEPS)
        found.append(poses)
        problem.tell(Round(problem.loss(poses), 0, poses))
        if (problem.edges.squares(poses) <= FINE**2).all():
            break
    return min(found, key=problem.loss), every
