"""How well the graph knows where a scan is, how far another edge is from what it knows, and where it is softest."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse.linalg import SuperLU

from segmap.graph import _inverse
from segmap.graph.arrays import EdgeArrays, System, adjoints, composed, inverted, residuals, slopes, turns
from segmap.graph.start import ARM
from segmap.pose import FloatArray, IntArray

__all__ = ["Marginals", "Softness"]


@dataclass(frozen=True)
class Softness:
    """The pose a graph holds least."""

    pose: int
    """its number"""
    deviation: float
    """metres; standard deviation along the weakest direction"""
    heading: float
    """radians, that direction in the frame of pose 0, in [0, pi)"""


class Marginals:
    """Covariances of the poses (n, 3) of one component at its optimum.

    ``edges`` are those that count; of ``others`` it can be told how far they are from what those know.
    """

    def __init__(self, edges: EdgeArrays, poses: FloatArray, others: EdgeArrays | None = None) -> None:
        self._poses = poses
        every = edges if others is None else edges.joined(others)
        self._system = System(every, len(poses))
        self._others = others
        weights = np.zeros(len(every))
        weights[: len(edges)] = 1.0
        self._entries, _ = self._system.equations(poses, weights)

    @property
    def effort(self) -> int:
        """About how many multiplications the inverse takes."""
        starts, rows, _ = self._system.columns(self._entries)
        return int((np.diff(_inverse.column_starts(starts, rows)) ** 2).sum())

    def between(self, a: int, b: int) -> FloatArray:
        """Covariance (3, 3) of x, y, theta of ``T_a_b``, in the frame of pose a."""
        T_b_a = composed(inverted(self._poses[b]), self._poses[a])
        slope = np.concatenate((-adjoints(T_b_a[None])[0], np.eye(3)), axis=1)
        turn = turns(inverted(T_b_a)[None, 2])[0]
        covariance = turn @ slope @ self._joint(a, b) @ slope.T @ turn.T
        return (covariance + covariance.T) / 2.0

    def of_all(self) -> FloatArray:
        """Covariances (n, 3, 3) of x, y, theta of every pose in the frame of pose 0."""
        every = np.arange(len(self._poses))
        turn = turns(composed(inverted(self._poses[0]), self._poses)[:, 2])
        return turn @ self._blocks(every, every) @ turn.transpose(0, 2, 1)

    def softest(self) -> Softness:
        """The pose least sure against pose 0."""
        variances, directions = np.linalg.eigh(self.of_all()[:, :2, :2])
        pose = int(np.argmax(variances[:, 1]))
        x, y = directions[pose, :, 1]
        return Softness(pose, math.sqrt(max(variances[pose, 1], 0.0)), math.atan2(y, x) % math.pi)

    def surprise(self) -> tuple[FloatArray, FloatArray]:
        """Of the others: squared Mahalanobis distances (k,), and how unsure the graph is of what they say, (k,).

        The distances are with the uncertainty of both, graph and edge; the unsureness is the variance of a
        point at the end of an arm, square metres.
        """
        if self._others is None:
            return np.empty(0), np.empty(0)
        left, (by_1, by_2) = residuals(self._poses, self._others), slopes(self._poses, self._others)
        first, second = self._others.first, self._others.second
        cross = by_1 @ self._blocks(first, second) @ by_2.transpose(0, 2, 1)
        known = cross + cross.transpose(0, 2, 1)
        for slope, pose in ((by_1, first), (by_2, second)):
            known += slope @ self._blocks(pose, pose) @ slope.transpose(0, 2, 1)
        both = known + self._others.covariances()
        squared = np.einsum("ei,ei->e", left, np.linalg.solve(both, left[:, :, None])[:, :, 0])
        return squared, known[:, 0, 0] + known[:, 1, 1] + ARM**2 * known[:, 2, 2]

    def _blocks(self, first: IntArray, second: IntArray) -> FloatArray:
        """Covariances (k, 3, 3) of small motions of pairs of poses that an edge joins, or of a pose with itself."""
        blocks = np.zeros((len(first), 3, 3))
        known = (first > 0) & (second > 0)
        rows, columns = (self._system.unknowns_of(poses[known]) for poses in (first, second))
        rows, columns = np.repeat(rows, 3, axis=1), np.tile(columns, 3)
        found = _inverse.looked_up(*self._inverted, rows.ravel(), columns.ravel())
        blocks[known] = found.reshape(-1, 3, 3)
        return blocks

    @cached_property
    def _inverted(self) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
        begins, below, factors, diagonal = _inverse.factorise(*self._system.columns(self._entries))
        return begins, below, *_inverse.invert(begins, below, factors, diagonal)

    @cached_property
    def _factors(self) -> SuperLU:
        return self._system.factorised(self._entries)

    def _joint(self, a: int, b: int) -> FloatArray:
        """Covariance (6, 6) of small motions of any two poses, each in its own frame."""
        joint = np.zeros((6, 6))
        asked = [(3 * i, self._system.unknowns_of(np.array([pose]))[0]) for i, pose in enumerate((a, b)) if pose]
        for place, unknowns in asked:
            columns = np.zeros((self._system.size, 3))
            columns[unknowns, range(3)] = 1.0
            solved = self._factors.solve(columns)
            for other, rows in asked:
                joint[other : other + 3, place : place + 3] = solved[rows]
        return joint
