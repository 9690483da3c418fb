"""A pose graph as arrays: residuals, their slopes, and the normal equations.

The residual of an edge is ``e = Log(T_1_2^-1 T_w_1^-1 T_w_2)``, the motion (x, y in metres, theta in
radians) that is left between where the edge puts scan 2 and where it stands, in the edge's frame 2. Its
size does not depend on which of the two scans is called the first. Poses move by ``T <- T Exp(delta)``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import SuperLU, splu

from segmap.graph.edges import Edge
from segmap.pose import FloatArray, IntArray, wrap
from segmap.scans import ScanId

__all__ = ["EdgeArrays", "System", "adjoints", "composed", "gaps", "inverted", "moved", "residuals", "slopes", "turns"]

NEARLY_STRAIGHT = 1e-4
"""radians; below, the series is more exact than the formula"""
RIDGE = 1e-12
"""of the largest diagonal entry; keeps what no edge holds where it is"""


@dataclass(frozen=True, eq=False)
class EdgeArrays:
    """m edges between n poses."""

    first: IntArray
    """(m,), number of the pose"""
    second: IntArray
    """(m,)"""
    measured: FloatArray
    """(m, 3), ``T_1_2``"""
    whitening: FloatArray
    """(m, 3, 3), upper triangular W with W^T W the information in frame 2: ``W e`` has unit variance"""

    @classmethod
    def of(cls, edges: Sequence[Edge], places: Mapping[ScanId, int]) -> EdgeArrays:
        """Edges between scans numbered by ``places``."""
        measured = np.array([tuple(edge.T_1_2) for edge in edges]).reshape(-1, 3)
        covariances = np.array([edge.covariance for edge in edges]).reshape(-1, 3, 3)
        turn = turns(-measured[:, 2])
        held = np.linalg.inv(turn @ covariances @ turn.transpose(0, 2, 1))
        return cls(
            np.array([places[edge.first] for edge in edges], np.int64),
            np.array([places[edge.second] for edge in edges], np.int64),
            measured,
            np.linalg.cholesky(held).transpose(0, 2, 1).copy(),
        )

    def __len__(self) -> int:
        return len(self.first)

    def subset(self, chosen: IntArray) -> EdgeArrays:
        """Some of the edges."""
        return EdgeArrays(self.first[chosen], self.second[chosen], self.measured[chosen], self.whitening[chosen])

    def joined(self, others: EdgeArrays) -> EdgeArrays:
        """These edges, and others after them."""
        pairs = zip(vars(self).values(), vars(others).values(), strict=True)
        return EdgeArrays(*(np.concatenate(pair) for pair in pairs))

    def covariances(self) -> FloatArray:
        """Of the residuals, (m, 3, 3)."""
        return np.linalg.inv(self.whitening.transpose(0, 2, 1) @ self.whitening).astype(np.float64)

    def squares(self, poses: FloatArray) -> FloatArray:
        """The squared Mahalanobis distance of every edge, (m,)."""
        whitened = self.whitened(poses)
        return np.einsum("ei,ei->e", whitened, whitened)

    def whitened(self, poses: FloatArray) -> FloatArray:
        """Residuals of unit variance, (m, 3); the norm of a row is its Mahalanobis distance."""
        return np.einsum("eij,ej->ei", self.whitening, residuals(poses, self))


def turns(angles: FloatArray) -> FloatArray:
    """Rotations of the plane acting on (x, y, theta), (m, 3, 3)."""
    turns = np.zeros((len(angles), 3, 3))
    turns[:, 0, 0] = turns[:, 1, 1] = np.cos(angles)
    turns[:, 1, 0] = np.sin(angles)
    turns[:, 0, 1] = -turns[:, 1, 0]
    turns[:, 2, 2] = 1.0
    return turns


def _turned(angles: FloatArray, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    cosine, sine = np.cos(angles), np.sin(angles)
    return cosine * x - sine * y, sine * x + cosine * y


def _left_over(poses: FloatArray, edges: EdgeArrays) -> tuple[FloatArray, FloatArray, FloatArray]:
    """x, y, theta of ``T_1_2^-1 T_w_1^-1 T_w_2``, and x, y of ``T_w_1^-1 T_w_2`` (m, 2) after them."""
    first, second = poses[edges.first], poses[edges.second]
    between = np.stack(_turned(-first[:, 2], *(second - first)[:, :2].T), axis=-1)
    place = np.stack(_turned(-edges.measured[:, 2], *(between - edges.measured[:, :2]).T), axis=-1)
    return place, wrap(second[:, 2] - first[:, 2] - edges.measured[:, 2]), between


def _half_cotangent(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``h = theta/2 cot(theta/2)`` and its slope."""
    near = np.abs(theta) < NEARLY_STRAIGHT
    half = np.where(near, 1.0, theta) / 2.0
    cotangent = np.cos(half) / np.sin(half)
    h = np.where(near, 1.0 - theta**2 / 12.0, half * cotangent)
    return h, np.where(near, -theta / 6.0, cotangent / 2.0 - half / 2.0 / np.sin(half) ** 2)


def residuals(poses: FloatArray, edges: EdgeArrays) -> FloatArray:
    """``e`` of every edge, (m, 3), at poses (n, 3)."""
    place, theta, _ = _left_over(poses, edges)
    h, _ = _half_cotangent(theta)
    x, y = place.T
    return np.stack((h * x + theta / 2.0 * y, h * y - theta / 2.0 * x, theta), axis=-1)


def gaps(poses: FloatArray, edges: EdgeArrays) -> FloatArray:
    """How far each edge puts its second scan from where it stands, (m,), metres."""
    return np.hypot(*_left_over(poses, edges)[0].T)


def slopes(poses: FloatArray, edges: EdgeArrays) -> tuple[FloatArray, FloatArray]:
    """How ``e`` changes with a motion ``delta`` of pose 1 and of pose 2, each (m, 3, 3)."""
    place, theta, between = _left_over(poses, edges)
    h, rise = _half_cotangent(theta)
    straight = _straightening(h, theta / 2.0)
    bend = np.stack((rise * place[:, 0] + place[:, 1] / 2.0, rise * place[:, 1] - place[:, 0] / 2.0), axis=-1)
    by_second = turns(theta)
    by_second[:, :2, :2] = straight @ by_second[:, :2, :2]
    by_second[:, :2, 2] = bend
    into_edge = turns(-edges.measured[:, 2])[:, :2, :2]
    arm = np.stack((-between[:, 1], between[:, 0]), axis=-1)
    by_first = np.zeros_like(by_second)
    by_first[:, :2, :2] = -(straight @ into_edge)
    by_first[:, :2, 2] = np.einsum("eij,ej->ei", by_first[:, :2, :2], arm) - bend
    by_first[:, 2, 2] = -1.0
    return by_first, by_second


def _straightening(h: FloatArray, half: FloatArray) -> FloatArray:
    """The matrices (m, 2, 2) that take the translation of a motion to that of its logarithm."""
    return np.stack((np.stack((h, half), axis=-1), np.stack((-half, h), axis=-1)), axis=-2)


def adjoints(poses: FloatArray) -> FloatArray:
    """The matrices (m, 3, 3) that take a small motion in the frame of each pose to the frame it is given in."""
    matrices = turns(poses[:, 2])
    matrices[:, 0, 2] = poses[:, 1]
    matrices[:, 1, 2] = -poses[:, 0]
    return matrices


def composed(a: FloatArray, b: FloatArray) -> FloatArray:
    """Poses ``a @ b``, (..., 3)."""
    x, y = _turned(a[..., 2], b[..., 0], b[..., 1])
    return np.stack(np.broadcast_arrays(a[..., 0] + x, a[..., 1] + y, wrap(a[..., 2] + b[..., 2])), axis=-1)


def inverted(poses: FloatArray) -> FloatArray:
    """Inverse poses, (..., 3)."""
    x, y = _turned(-poses[..., 2], poses[..., 0], poses[..., 1])
    return np.stack((-x, -y, wrap(-poses[..., 2])), axis=-1)


def moved(poses: FloatArray, deltas: FloatArray) -> FloatArray:
    """Poses (n, 3) moved by small motions (n, 3), each in its own frame."""
    return composed(poses, deltas)


class System:
    """The normal equations of a graph that hangs together; pose 0 stays where it is.

    Which entries are not zero, and in which order they are eliminated, is found once.
    """

    def __init__(self, edges: EdgeArrays, count: int) -> None:
        self.edges, self.count = edges, count
        self._place = np.concatenate(([-1], _elimination(edges, count)))
        ends = np.stack((self._place[edges.first], self._place[edges.second]), axis=-1)
        self._variables = (3 * ends[:, :, None] + np.arange(3)).reshape(-1, 6)
        self._variables[np.repeat(ends < 0, 3, axis=1)] = -1
        self._lay_out()

    def _lay_out(self) -> None:
        """Where each entry of each edge's 6 x 6 block goes in the sparse matrix."""
        size, variables = self.size, self._variables
        rows, columns = (
            np.broadcast_to(v, (len(variables), 6, 6)).ravel() for v in (variables[:, :, None], variables[:, None, :])
        )
        self._inside = (rows >= 0) & (columns >= 0)
        flat = columns[self._inside] * size + rows[self._inside]
        diagonal = np.arange(size) * (size + 1)
        entries, self._entry = np.unique(np.concatenate((diagonal, flat)), return_inverse=True)
        self._rows = (entries % size).astype(np.int32)
        self._starts = np.searchsorted(entries, np.arange(size + 1) * size).astype(np.int32)
        self._diagonal = self._entry[:size]

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return 3 * (self.count - 1)

    def equations(self, poses: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Entries of the normal matrix, and the gradient (size,) of half the weighted sum of squares."""
        left = self.edges.whitened(poses)
        slope = self.edges.whitening @ np.concatenate(slopes(poses, self.edges), axis=-1)
        weighted = slope * weights[:, None, None]
        blocks = weighted.transpose(0, 2, 1) @ slope
        gradient = np.einsum("eij,ei->ej", weighted, left)
        known = self._variables >= 0
        entries = np.concatenate((np.zeros(self.size), blocks.ravel()[self._inside]))
        matrix = np.bincount(self._entry, entries, minlength=len(self._rows)).astype(np.float64)
        return matrix, np.bincount(self._variables[known], gradient[known], minlength=self.size).astype(np.float64)

    def factorised(self, entries: FloatArray, damping: float = 0.0) -> SuperLU:
        """The normal matrix, its diagonal raised by a share of itself, ready to solve."""
        held = entries[self._diagonal]
        raised = entries.copy()
        raised[self._diagonal] += damping * held + RIDGE * held.max(initial=1.0)
        matrix = csc_array((raised, self._rows, self._starts), shape=(self.size, self.size))
        return splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})

    def columns(self, entries: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """The normal matrix by columns: where each begins, the rows and the values of its entries."""
        raised = entries.copy()
        raised[self._diagonal] += RIDGE * entries[self._diagonal].max(initial=1.0)
        return self._starts.astype(np.int64), self._rows.astype(np.int64), raised

    def by_pose(self, unknowns: FloatArray) -> FloatArray:
        """Motions of all poses, (n, 3), of a solution (size,)."""
        return np.concatenate((np.zeros((1, 3)), unknowns.reshape(-1, 3)[self._place[1:]]))

    def unknowns_of(self, poses: IntArray) -> IntArray:
        """The three unknowns of each of some poses other than 0, (k, 3)."""
        return 3 * self._place[poses, None] + np.arange(3)


def _elimination(edges: EdgeArrays, count: int) -> IntArray:
    """The place of each pose but the first in an order of elimination that fills in little."""
    inside = (edges.first > 0) & (edges.second > 0)
    a, b = edges.first[inside] - 1, edges.second[inside] - 1
    every = np.arange(count - 1)
    links = np.full(len(a), -1.0)
    degree = np.full(count - 1, 1.0) + np.bincount(a, minlength=count - 1) + np.bincount(b, minlength=count - 1)
    rows, columns = np.concatenate((a, b, every)), np.concatenate((b, a, every))
    matrix = csc_array((np.concatenate((links, links, degree)), (rows, columns)), shape=(count - 1, count - 1))
    factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return factors.perm_c.astype(np.int64)
