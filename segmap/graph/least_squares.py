"""Weighted least squares over poses: Gauss-Newton, damped where a step would not go down (Levenberg-Marquardt)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from segmap import tracing
from segmap.graph.arrays import EdgeArrays, System, moved
from segmap.pose import FloatArray, IntArray

__all__ = ["STEPS", "LeastSquares"]

STEPS = 50
STILL = 1e-9
"""metres, radians; a smaller step is the last"""
FIRST_DAMPING = 1e-4
LAST_DAMPING = 1e8
SPARSER = 0.9
"""of the edges in the equations; fewer that count are worth equations of their own"""


class LeastSquares:
    """The poses of one graph; remembers the layout of the equations from one call to the next."""

    def __init__(self, edges: EdgeArrays, count: int, check: Callable[[], None] | None = None) -> None:
        self.edges, self.count = edges, count
        self._check = check or (lambda: None)
        self._held: tuple[IntArray, System] = np.arange(0), System(edges.subset(np.arange(0)), 1)

    def minimised(self, poses: FloatArray, weights: FloatArray, steps: int = STEPS) -> FloatArray:
        """Poses (n, 3) nearer to the minimum of the weighted sum of squares; pose 0 stays.

        Ends after ``steps`` steps, or one in which no pose moved to speak of.
        """
        system, counting = self._laid_out(weights)
        error, damping = float(counting @ system.edges.squares(poses)), 0.0
        for _ in range(steps):
            self._check()
            before = poses
            poses, error, damping, moved_by = _stepped(system, poses, counting, error, damping)
            tracing.tell("stepped", before=before, poses=poses, weights=weights, error=error)
            if moved_by <= STILL:
                break
        return poses

    def _laid_out(self, weights: FloatArray) -> tuple[System, FloatArray]:
        """Equations that hold every edge of a weight above zero, and the weights of the edges they hold."""
        alive = np.flatnonzero(weights > 0.0)
        chosen, system = self._held
        if len(alive) < SPARSER * len(chosen) or not np.isin(alive, chosen, assume_unique=True).all():
            chosen, system = self._held = alive, System(self.edges.subset(alive), self.count)
        return system, weights[chosen]


def _stepped(
    system: System, poses: FloatArray, weights: FloatArray, error: float, damping: float
) -> tuple[FloatArray, float, float, float]:
    """Poses after one step that does not go up, their error, the damping for the next, and how far any moved."""
    entries, gradient = system.equations(poses, weights)
    while damping <= LAST_DAMPING:
        step = system.by_pose(system.factorised(entries, damping).solve(-gradient))
        tried = moved(poses, step)
        new_error = float(weights @ system.edges.squares(tried))
        if new_error <= error * (1.0 + 1e-12):
            return tried, new_error, damping / 10.0 if damping > FIRST_DAMPING else 0.0, float(np.abs(step).max())
        damping = max(FIRST_DAMPING, 10.0 * damping)
    return poses, error, damping, 0.0
