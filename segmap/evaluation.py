"""Candidates -> values; the exact best K (Section III-B, Algorithm 4)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from segmap import _value_kernels, tracing
from segmap._threads import Crew, crew
from segmap.bounds import Bounds
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray, Pose2
from segmap.segments import SegmentMap

__all__ = ["Best", "best", "evaluate", "matching_values", "search"]

BLOCK = 4096
"""candidates evaluated between two looks at whether to stop"""
LEAST_BLOCK = 64
"""fewer candidates are not worth a thread"""
CROSSED = 1 << 16
"""candidates looked at for crossings between two looks at whether to stop"""
FIRST = 256
"""least number of candidates evaluated first, those of the highest bounds"""
BOUNDED = 1 << 22
"""pairs of segments of all candidates together above which bounds pay"""
SPARSE = 16
"""and how many candidates there must be for each that is wanted"""
LEAST_MATCH = 1e-9
"""metres; smaller matching values are none"""


@dataclass(frozen=True, eq=False)
class Best:
    """The best of some candidates by value."""

    rows: IntArray
    """which, best first; ties go to the lower one"""
    values: FloatArray
    """their values, metres, all above zero"""
    discarded: int
    """how many of all candidates are discarded because long segments cross"""


def evaluate(
    map_1: SegmentMap,
    map_2: SegmentMap,
    poses: FloatArray,
    parameters: Parameters,
    *,
    workers: int = 1,
    check: Callable[[], None] | None = None,
) -> FloatArray:
    """The value of each candidate ``T_1_2`` of ``poses`` (k, 3), shape (k,), metres; NaN: discarded.

    Every pair of segments of every candidate counts (Algorithm 4, lines 5 to 19). ``workers`` spreads
    blocks of candidates over threads; ``check`` is called between blocks and raises to stop.
    """
    with crew(workers, check) as threads:
        return _Task(map_1, map_2, poses, parameters, threads).values(poses)


def search(
    map_1: SegmentMap,
    map_2: SegmentMap,
    poses: FloatArray,
    parameters: Parameters,
    count: int,
    *,
    workers: int = 1,
    check: Callable[[], None] | None = None,
) -> Best:
    """The ``count`` best candidates: exactly those that :func:`best` takes of what :func:`evaluate` gives.

    Upper bounds of the values tell which candidates can be among the best; these alone are evaluated.
    ``workers`` and ``check`` as in :func:`evaluate`.
    """
    with crew(workers, check) as threads:
        task = _Task(map_1, map_2, poses, parameters, threads)
        if task.bounds_pay(count):
            discarded = task.discarded()
            values = task.best_values(count, ~discarded)
        else:
            values = task.values(poses)
            discarded = np.isnan(values)
        rows = best(values, count)
        found = Best(rows, values[rows], int(discarded.sum()))
    tracing.tell("search", poses=poses, best=found)
    return found


def best(values: FloatArray, count: int) -> IntArray:
    """Indices of the ``count`` best values above zero, best first; ties go to the lower index."""
    alive = np.flatnonzero(values > 0.0)  # false for NaN, the discarded ones
    if count < len(alive):
        border = np.partition(values[alive], len(alive) - count)[len(alive) - count]
        alive = alive[values[alive] >= border]
    return alive[np.argsort(-values[alive], kind="stable")][:count]


def matching_values(
    map_1: SegmentMap, map_2: SegmentMap, T_1_2: Pose2, parameters: Parameters, least: float = LEAST_MATCH
) -> tuple[IntArray, FloatArray]:
    """The pairs of segments that match under ``T_1_2``, shape (m, 2), and their matching values, (m,), metres.

    In index order, so that the values above ``least`` = 0 sum to the value of the transformation.
    """
    pairs, values = _value_kernels.matching_pairs(
        map_1.coordinates, map_2.coordinates, np.array(tuple(T_1_2)), *_measure(parameters), least
    )
    return pairs, values


def _measure(parameters: Parameters) -> tuple[float, float, float]:
    return (
        parameters.point_distance_tolerance,
        parameters.segment_distance_threshold,
        parameters.distance_penalty,
    )


@dataclass(frozen=True, eq=False)
class _Task:
    """Candidates to find the values of."""

    map_1: SegmentMap
    map_2: SegmentMap
    poses: FloatArray
    parameters: Parameters
    threads: Crew

    def values(self, poses: FloatArray) -> FloatArray:
        """Values of some poses, (k,), in blocks over the threads."""

        def block(rows: slice) -> FloatArray:
            p, kernel = self.parameters, _value_kernels.evaluate
            refused = p.segment_length_refuse, p.refuse_angle
            values: FloatArray = kernel(*self._coordinates, poses[rows], *_measure(p), *refused)
            return values

        blocks = self.threads.blocks(len(poses), BLOCK, LEAST_BLOCK)
        return np.concatenate([np.empty(0), *self.threads.run(block, blocks)])

    def discarded(self) -> NDArray[np.bool_]:
        """Which candidates long crossing segments discard, (k,) (line 6)."""

        def block(rows: slice) -> NDArray[np.bool_]:
            p, kernel = self.parameters, _value_kernels.crossing
            refused = p.segment_length_refuse, p.refuse_angle
            crossing: NDArray[np.bool_] = kernel(
                *self._coordinates, self.poses[rows], p.point_distance_tolerance, *refused
            )
            return crossing

        return np.concatenate(self.threads.run(block, self.threads.blocks(len(self.poses), CROSSED)))

    def bounds_pay(self, count: int) -> bool:
        """Whether bounds cost less than they save."""
        candidates = len(self.poses)
        return SPARSE * count < candidates and candidates * len(self.map_1) * len(self.map_2) > BOUNDED

    def best_values(self, count: int, allowed: NDArray[np.bool_]) -> FloatArray:
        """Values, (k,): those of the best ``count`` of the allowed and of all that tie with them; others may be zero.

        Candidates come by their bounds, the highest first, until no bound reaches the worst of the best.
        """
        closer = Bounds(self.map_1, self.map_2, self.poses, self.parameters, self.threads)
        bounds = closer.of_all() * allowed
        values, top, size = np.zeros(len(bounds)), np.zeros(count), max(FIRST, 2 * count)
        left = np.flatnonzero(bounds > 0.0)
        while len(left):
            if size < len(left):
                left = left[np.argpartition(-bounds[left], size)]
            now, left = np.sort(left[:size]), left[size:]
            if top[0] > 0.0:
                now = closer.outlasting(now, top[0])
            values[now] = self.values(self.poses[now])
            top = np.sort(np.concatenate((top, values[now])))[-count:]
            left = left[bounds[left] >= top[0]]
            size *= 2
        return values

    @property
    def _coordinates(self) -> tuple[FloatArray, FloatArray]:
        return self.map_1.coordinates, self.map_2.coordinates
