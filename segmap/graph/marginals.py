"""How well the graph knows where a scan is, and where it is softest."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse.linalg import SuperLU

from segmap.graph.arrays import EdgeArrays, System, adjoints, composed, inverted, residuals, slopes, turns
from segmap.pose import FloatArray

__all__ = ["Marginals", "Softness"]

POWERS = 12
"""rounds of power iteration; the softest motion stands out long before"""
SUSPECTS = 8
"""poses that the softest motion moves most, looked at exactly"""


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
    """Covariances of the poses (n, 3) of one component at its optimum; only edges that count are given."""

    def __init__(self, edges: EdgeArrays, poses: FloatArray) -> None:
        self._poses = poses
        self._system = System(edges, len(poses))

    @cached_property
    def _factors(self) -> SuperLU:
        entries, _ = self._system.equations(self._poses, np.ones(len(self._system.edges)))
        return self._system.factorised(entries)

    def between(self, a: int, b: int) -> FloatArray:
        """Covariance (3, 3) of x, y, theta of ``T_a_b``, in the frame of pose a."""
        T_b_a = composed(inverted(self._poses[b]), self._poses[a])
        by_a = -adjoints(T_b_a[None])[0]
        joint = self._joint(a, b)
        slope = np.concatenate((by_a, np.eye(3)), axis=1)
        turn = turns(inverted(T_b_a)[None, 2])[0]
        covariance = turn @ slope @ joint @ slope.T @ turn.T
        return (covariance + covariance.T) / 2.0

    def squared(self, edge: EdgeArrays) -> float:
        """The squared Mahalanobis distance of one more edge, with the uncertainty of the graph and its own."""
        (a,), (b,) = edge.first, edge.second
        own = np.linalg.inv(edge.whitening[0].T @ edge.whitening[0])
        slope = np.concatenate([by_end[0] for by_end in slopes(self._poses, edge)], axis=1)
        left = residuals(self._poses, edge)[0]
        return float(left @ np.linalg.solve(own + slope @ self._joint(int(a), int(b)) @ slope.T, left))

    def _joint(self, a: int, b: int) -> FloatArray:
        """Covariance (6, 6) of small motions of two poses, each in its own frame."""
        joint = np.zeros((6, 6))
        asked = [(3 * i, self._system.unknowns_of(pose)) for i, pose in enumerate((a, b)) if pose]
        for place, unknowns in asked:
            columns = np.zeros((self._system.size, 3))
            columns[unknowns, range(3)] = 1.0
            solved = self._factors.solve(columns)
            for other, rows in asked:
                joint[other : other + 3, place : place + 3] = solved[rows]
        return joint

    def softest(self) -> Softness:
        """The pose least sure against pose 0, of those that the softest motion of the whole moves most."""
        moved = self._softest_motion()
        suspects = np.argsort(-moved, kind="stable")[:SUSPECTS]
        return max((self._softness(int(pose)) for pose in sorted(suspects)), key=lambda one: one.deviation)

    def _softest_motion(self) -> FloatArray:
        """How far each pose moves, (n,), in the motion the graph resists least."""
        motion = np.tile((1.0, 0.5, 0.0), len(self._poses) - 1)
        for _ in range(POWERS):
            motion = self._factors.solve(motion)
            motion[2::3] = 0.0  # places alone are asked for
            motion /= np.linalg.norm(motion)
        return np.hypot(*self._system.by_pose(motion)[:, :2].T)

    def _softness(self, pose: int) -> Softness:
        variances, directions = np.linalg.eigh(self.between(0, pose)[:2, :2])
        heading = math.atan2(directions[1, 1], directions[0, 1]) % math.pi
        return Softness(pose, math.sqrt(variances[1]), heading)
