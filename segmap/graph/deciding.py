"""Which of several places least squares can end in is the right one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from segmap.graph.least_squares import STEPS
from segmap.graph.robust import Minimise, Problem, Round, reconsidered, settled
from segmap.pose import FloatArray

__all__ = ["decided"]

MANY = 0.05
"""of the edges that can be silenced; where more are, another road is tried"""
FINE = 5.0
"""standard deviations; where no edge is farther off, no better place is looked for"""


def decided(
    problem: Problem, minimise: Minimise, begin: Callable[[FloatArray], FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Poses (n, 3) and weights (m,): the best of what is found from each start.

    ``begin`` is graduated non-convexity from some poses. It can end in a place that is worse than the one it
    began from, where that was good or much is wrong: both are settled, and the smaller loss wins.
    """
    if not len(problem.free):
        return _plain(problem, minimise)
    found = []
    for place, start in enumerate(problem.starts):
        known = place < len(problem.starts) - 1
        found.append(settled(problem, start if known else begin(start), minimise))
        if found[-1][1].all():
            break  # nothing contradicts anything
        if known or (found[-1][1] == 0.0).sum() > MANY * len(problem.free):
            found.append(settled(problem, begin(start) if known else start, minimise))
    poses, weights = reconsidered(problem, *min(found, key=lambda one: problem.loss(one[0])), minimise)
    return minimise(poses, weights, STEPS), weights


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
