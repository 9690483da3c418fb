"""Candidates -> values (Section III-B, Algorithm 4)."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from segmap import _kernels
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray, Pose2
from segmap.segments import SegmentMap

__all__ = ["best", "evaluate", "matching_values"]

BLOCK = 4096
"""candidates evaluated between two looks at whether to stop"""
LEAST_MATCH = 1e-9
"""metres; smaller matching values are none"""


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

    def block(start: int) -> FloatArray:
        if check is not None:
            check()
        values: FloatArray = _kernels.evaluate(
            map_1.coordinates,
            map_2.coordinates,
            poses[start : start + BLOCK],
            *_measure(parameters),
            parameters.segment_length_refuse,
            parameters.refuse_angle,
        )
        return values

    starts = range(0, len(poses), BLOCK)
    if workers > 1 and len(starts) > 1:
        with ThreadPoolExecutor(workers) as pool:
            parts = list(pool.map(block, starts))
    else:
        parts = [block(start) for start in starts]
    return np.concatenate(parts) if parts else np.empty(0)


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
    pairs, values = _kernels.matching_pairs(
        map_1.coordinates, map_2.coordinates, np.array(tuple(T_1_2)), *_measure(parameters), least
    )
    return pairs, values


def _measure(parameters: Parameters) -> tuple[float, float, float]:
    return (
        parameters.point_distance_tolerance,
        parameters.segment_distance_threshold,
        parameters.distance_penalty,
    )
