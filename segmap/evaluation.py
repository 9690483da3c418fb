"""Candidates -> values; the exact best K (Section III-B, Algorithm 4)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from segmap import _value_kernels
from segmap._threads import Crew, crew
from segmap.bounds import upper_bounds
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray, Pose2
from segmap.segments import SegmentMap

__all__ = ["Best", "best", "evaluate", "matching_values", "search"]

BLOCK = 4096
"""candidates evaluated between two looks at whether to stop"""
LEAST_BLOCK = 64
"""fewer candidates are not worth a thread"""
FIRST = 256
"""least number of candidates evaluated first, those of the highest bounds"""
BOUNDED = 1 << 23
"""pairs of segments of all candidates together above which bounds pay"""
SPARSE = 32
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
        return _values(map_1, map_2, poses, parameters, threads)


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
        if not _bounds_pay(map_1, map_2, len(poses), count):
            values = _values(map_1, map_2, poses, parameters, threads)
            rows = best(values, count)
            return Best(rows, values[rows], int(np.isnan(values).sum()))
        discarded = _discarded(map_1, map_2, poses, parameters, threads)
        bounds = upper_bounds(map_1, map_2, poses, parameters, threads)
        bounds[discarded] = 0.0
        values = _best_values(map_1, map_2, poses, parameters, bounds, count, threads)
        rows = best(values, count)
        return Best(rows, values[rows], int(discarded.sum()))


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


def _values(
    map_1: SegmentMap, map_2: SegmentMap, poses: FloatArray, parameters: Parameters, threads: Crew
) -> FloatArray:
    def block(rows: slice) -> FloatArray:
        values: FloatArray = _value_kernels.evaluate(
            map_1.coordinates,
            map_2.coordinates,
            poses[rows],
            *_measure(parameters),
            parameters.segment_length_refuse,
            parameters.refuse_angle,
        )
        return values

    return np.concatenate([np.empty(0), *threads.run(block, threads.blocks(len(poses), BLOCK, LEAST_BLOCK))])


# --- the best without the value of every one --------------------------------------------------------


def _bounds_pay(map_1: SegmentMap, map_2: SegmentMap, candidates: int, count: int) -> bool:
    """Whether bounds cost less than they save."""
    return SPARSE * count < candidates and candidates * len(map_1) * len(map_2) > BOUNDED


def _discarded(
    map_1: SegmentMap, map_2: SegmentMap, poses: FloatArray, parameters: Parameters, threads: Crew
) -> NDArray[np.bool_]:
    """Which candidates long crossing segments discard (line 6)."""

    def block(rows: slice) -> NDArray[np.bool_]:
        crossing: NDArray[np.bool_] = _value_kernels.crossing(
            map_1.coordinates,
            map_2.coordinates,
            poses[rows],
            parameters.point_distance_tolerance,
            parameters.segment_length_refuse,
            parameters.refuse_angle,
        )
        return crossing

    return np.concatenate(threads.run(block, threads.blocks(len(poses), 16 * BLOCK)))


def _best_values(
    map_1: SegmentMap,
    map_2: SegmentMap,
    poses: FloatArray,
    parameters: Parameters,
    bounds: FloatArray,
    count: int,
    threads: Crew,
) -> FloatArray:
    """Values, (k,): the best ``count`` are theirs, and so are ties; others may be zero.

    Ever more candidates of the highest bounds are evaluated, until no bound reaches the worst of the best.
    """
    values = np.zeros(len(poses))
    top = np.zeros(count)
    left = np.flatnonzero(bounds > 0.0)
    size = max(FIRST, 2 * count)
    while len(left):
        if size < len(left):
            left = left[np.argpartition(-bounds[left], size)]
        now, left = np.sort(left[:size]), left[size:]
        values[now] = _values(map_1, map_2, poses[now], parameters, threads)
        top = np.sort(np.concatenate((top, values[now])))[-count:]
        left = left[bounds[left] >= top[0]]
        size *= 2
    return values
