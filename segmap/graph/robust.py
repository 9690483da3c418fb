"""Graduated non-convexity: least squares in which an edge that contradicts the others is silenced.

Yang, Antonante, Tzoumas, Carlone, "Graduated Non-Convexity for Robust Spatial Perception" (RA-L 2020), with
the truncated least squares loss: an edge farther than ``gate`` standard deviations costs ``gate**2`` and no
more. The loss begins convex and is bent to its true form in rounds of weighted least squares; what comes
out is then settled, so that weights are 0 or 1 and every part of the graph still hangs on something.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from segmap import tracing
from segmap.graph.arrays import EdgeArrays
from segmap.graph.marginals import Marginals
from segmap.graph.reattaching import reattached
from segmap.pose import FloatArray, IntArray

__all__ = ["Minimise", "Problem", "Round", "Start", "graduated", "reconsidered", "settled"]

SHARPENING = 2.0
"""how much closer to its true form the loss comes each round; Yang et al. take 1.4, and more rounds, to the same end"""
ROUNDS = 100
FIRST_STEPS = 5
"""of least squares with every edge; the rounds go on from there with one step each"""
SETTLING = 20
STEPS = 2
"""of least squares after each change of mind when settling"""
DECIDED = 0.1
"""weights nearer to 0 or 1 than this are; settling does the rest"""
HEARINGS = 40
"""times silenced edges are asked"""
HEARD = 1000
"""silenced edges, the nearest to the gate, that are asked each time"""
MOST_EFFORT = 300_000_000
"""multiplications that asking may take; where it would take more, fewer edges are asked"""

Minimise: TypeAlias = Callable[[FloatArray, FloatArray, int], FloatArray]
"""Poses, weights of the edges and a number of steps -> poses nearer to the minimum of the weighted squares."""
Start: TypeAlias = Callable[[], FloatArray]
"""Gives poses (n, 3) to begin from; called where it comes to that."""


@dataclass(frozen=True, eq=False)
class Round:
    """The state after one round of weighted least squares."""

    error: float
    """the truncated sum of squares"""
    silenced: int
    """edges with a weight below 0.5"""
    poses: FloatArray
    """(n, 3)"""


@dataclass(frozen=True, eq=False)
class Problem:
    """One component to be optimised."""

    edges: EdgeArrays
    count: int
    """n, of the poses"""
    starts: Sequence[Start]
    """where to begin: at poses that were given, along the surest edges, along the edges nearest in the logs"""
    given: bool
    """whether the first were"""
    reliance: FloatArray
    """(m,), 0..1; how much less likely an edge is wrong than others: the nearer its scans in their log, the more"""
    free: IntArray
    """the edges that can be silenced"""
    gate: float
    """standard deviations"""
    most: float
    """metres; an edge that can be silenced and is farther off says nothing"""
    tell: Callable[[Round], None]
    """is told of every round"""

    def loss(self, poses: FloatArray) -> float:
        """The sum of the squares of all edges, those of free ones cut at the gate."""
        squared = self.edges.squares(poses)
        squared[self.free] = np.minimum(squared[self.free], self.gate**2)
        return float(squared.sum())

    def cost(self, poses: FloatArray, weights: FloatArray) -> float:
        """The loss, and what it takes to take reliable edges for wrong: of two that contradict each other, the
        one that joins scans near each other in their log is right.
        """
        return self.loss(poses) + self.gate**2 * float(self.reliance[weights == 0.0].sum())


def graduated(problem: Problem, poses: FloatArray, minimise: Minimise) -> FloatArray:
    """Poses (n, 3) after the rounds, begun at some poses."""
    edges, free, gate = problem.edges, problem.free, problem.gate
    weights = np.ones(len(edges))
    poses = minimise(poses, weights, FIRST_STEPS)
    squared = edges.squares(poses)
    convexity = _first_convexity(float(squared[free].max(initial=0.0)), gate)
    for _ in range(ROUNDS):
        weights[free] = _weights(squared[free], gate, convexity)
        poses = minimise(poses, weights, 1)
        squared = edges.squares(poses)
        tracing.tell("optimised", edges=edges, poses=poses, weights=weights, squares=squared)
        problem.tell(Round(problem.loss(poses), int((weights < 0.5).sum()), poses))
        if (np.minimum(weights, 1.0 - weights) <= DECIDED).all():
            break
        convexity *= SHARPENING
    return poses


def _first_convexity(worst: float, gate: float) -> float:
    """mu at which the loss is convex for residuals up to the worst (Remark 5); large where none is beyond the gate."""
    return gate**2 / (2.0 * worst - gate**2) if 2.0 * worst > gate**2 else 100.0


def _weights(squared: FloatArray, gate: float, convexity: float) -> FloatArray:
    """Equation 14 of Yang et al.: 1 well inside the gate, 0 well beyond it, between the two in between."""
    inner = convexity / (convexity + 1.0) * gate**2
    outer = (convexity + 1.0) / convexity * gate**2
    between = gate * np.sqrt(convexity * (convexity + 1.0) / np.maximum(squared, inner)) - convexity
    return np.where(squared <= inner, 1.0, np.where(squared >= outer, 0.0, between))


def settled(problem: Problem, poses: FloatArray, minimise: Minimise) -> tuple[FloatArray, FloatArray]:
    """Poses and weights of 0 or 1 at which every free edge counts exactly if it is within the gate.

    Where silencing would cut a part off, an edge across the cut counts all the same.
    """
    edges, free, gate = problem.edges, problem.free, problem.gate
    weights, best = np.full(len(edges), -1.0), np.inf
    result = poses, weights
    for _ in range(SETTLING):
        squared = edges.squares(poses)
        new = np.ones(len(edges))
        new[free] = squared[free] <= gate**2
        poses = reattached(edges, poses, new, gate)
        if (new == weights).all():
            break
        weights, poses = new, minimise(poses, new, STEPS)
        loss = problem.loss(poses)
        tracing.tell("optimised", edges=edges, poses=poses, weights=new, squares=squared)
        problem.tell(Round(loss, int((new < 0.5).sum()), poses))
        if loss < best:
            best, result = loss, (poses, new)
    return result


def reconsidered(
    problem: Problem, poses: FloatArray, weights: FloatArray, minimise: Minimise
) -> tuple[FloatArray, FloatArray]:
    """Poses and weights after silenced edges got a second hearing.

    An edge can be beyond the gate only because the graph went without it. What it costs to let it count is
    its squared distance with the uncertainty of both, graph and edge: where that is within the gate it may
    count. Those of which the graph is surest are tried first, half of them at a time, as they cannot be right
    by chance; what follows from them decides on the rest.
    """
    loss, share = problem.loss(poses), 1.0
    for _ in range(HEARINGS):
        wronged = _wronged(problem, poses, weights)
        if not len(wronged):
            break
        share /= 2.0
        again = weights.copy()
        again[wronged[: max(1, round(share * len(wronged)))]] = 1.0
        result = settled(problem, minimise(poses, again, STEPS), minimise)
        new_loss = problem.loss(result[0])
        if new_loss < loss:
            loss, share, (poses, weights) = new_loss, 1.0, result
        elif share * len(wronged) < 1.0:
            break
    return poses, weights


def _wronged(problem: Problem, poses: FloatArray, weights: FloatArray) -> IntArray:
    """Silenced edges that are within the gate with the uncertainty of the graph, the surest first."""
    silenced = np.flatnonzero(weights <= 0.0)
    heard = silenced[np.argsort(problem.edges.squares(poses)[silenced], kind="stable")[:HEARD]]
    counting = problem.edges.subset(np.flatnonzero(weights > 0.0))
    graph = Marginals(counting, poses, problem.edges.subset(heard))
    while len(heard) > 1 and graph.effort > MOST_EFFORT:
        heard = heard[: len(heard) // 2]
        graph = Marginals(counting, poses, problem.edges.subset(heard))
    squared, unsure = graph.surprise()
    order = np.argsort(unsure, kind="stable")
    return heard[order[squared[order] <= problem.gate**2]]
