"""The inner loops of the value of a transformation (Algorithm 4). Same rules as :mod:`segmap._kernels`.

Map 2 under a pose is held as columns: x1, y1, x2, y2, the direction's x and y, and the length of each segment,
(7, m). There may be more columns than segments, so that loops over all of them run in whole vectors.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from segmap._kernels import TOUCH, directions
from segmap.pose import FloatArray, IntArray

__all__ = ["add_matches", "columns_of", "crossing", "evaluate", "matching_pairs", "move"]

LANES = 8
"""the columns are a multiple of these"""
BATCH = 256
"""poses under which crossings are looked for at a time"""

_compiled = njit(cache=True, nogil=True, error_model="numpy")
_inlined = njit(cache=True, nogil=True, error_model="numpy", inline="always")


@_compiled
def columns_of(axes):  # type: ignore[no-untyped-def]
    """Columns for a map of these directions and lengths (n, 3), with the lengths filled in."""
    columns = np.zeros((7, (len(axes) + LANES - 1) // LANES * LANES))
    columns[6, : len(axes)] = axes[:, 2]
    return columns


@_compiled
def move(segments, axes, pose, columns):  # type: ignore[no-untyped-def]
    cosine = math.cos(pose[2])
    sine = math.sin(pose[2])
    for j in range(len(segments)):
        for k in (0, 2):
            columns[k, j] = cosine * segments[j, k] - sine * segments[j, k + 1] + pose[0]
            columns[k + 1, j] = sine * segments[j, k] + cosine * segments[j, k + 1] + pose[1]
        columns[4, j] = cosine * axes[j, 0] - sine * axes[j, 1]
        columns[5, j] = sine * axes[j, 0] + cosine * axes[j, 1]


@_inlined
def _column(columns, j):  # type: ignore[no-untyped-def]
    return columns[0, j], columns[1, j], columns[2, j], columns[3, j], columns[4, j], columns[5, j], columns[6, j]


# --- matching values (lines 9 to 17) ----------------------------------------------------------------


@_inlined
def _sides(s, u, x1, y1, x2, y2, ux, uy):  # type: ignore[no-untyped-def]
    """Signed distances of the extremes of segment 2 from the line of segment 1, and the other way round."""
    cx = x1 - s[0]
    cy = y1 - s[1]
    start_2 = u[0] * cy - u[1] * cx
    end_2 = u[0] * (y2 - s[1]) - u[1] * (x2 - s[0])
    start_1 = uy * cx - ux * cy
    end_1 = uy * (x1 - s[2]) - ux * (y1 - s[3])
    return start_2, end_2, start_1, end_1


@_inlined
def _stretches(s, u, x1, y1, x2, y2, ux, uy, length):  # type: ignore[no-untyped-def]
    """The two projected common lengths, of segment 1 and of segment 2; negative: the gap between them."""
    cx = x1 - s[0]
    cy = y1 - s[1]
    p = u[0] * cx + u[1] * cy
    q = u[0] * (x2 - s[0]) + u[1] * (y2 - s[1])
    v = -(ux * cx + uy * cy)
    w = -(ux * (x1 - s[2]) + uy * (y1 - s[3]))
    return min(max(p, q), u[2]) - max(min(p, q), 0.0), min(max(v, w), length) - max(min(v, w), 0.0)


@_compiled
def _distances(s, u, columns, result):  # type: ignore[no-untyped-def]
    """The min-max distance of every segment 2 from a segment 1; infinite where they have no common length."""
    x1, y1, x2, y2, ux, uy = columns[0], columns[1], columns[2], columns[3], columns[4], columns[5]
    length = columns[6]
    for j in range(len(result)):
        start_2, end_2, start_1, end_1 = _sides(s, u, x1[j], y1[j], x2[j], y2[j], ux[j], uy[j])
        distance = min(max(abs(start_2), abs(end_2)), max(abs(start_1), abs(end_1)))
        l1, l2 = _stretches(s, u, x1[j], y1[j], x2[j], y2[j], ux[j], uy[j], length[j])
        result[j] = distance if max(l1, l2) > 0.0 else np.inf


@_compiled
def _near(distances, count, limit, rows):  # type: ignore[no-untyped-def]
    """How many of the first ``count`` are within the limit; ``rows`` begins with which."""
    found = 0
    for j in range(count):
        rows[found] = j
        found += distances[j] <= limit
    return found


@_inlined
def _meets(start, end):  # type: ignore[no-untyped-def]
    """Whether a segment with these signed distances from a line meets it, touching included."""
    return min(start, end) <= TOUCH and max(start, end) >= -TOUCH


@_inlined
def _matching_value(s, u, columns, j, distance, rate):  # type: ignore[no-untyped-def]
    """Matching value of two segments this far apart, within the limit; ``rate`` is log(penalty) / tolerance."""
    x1, y1, x2, y2, ux, uy, length = _column(columns, j)
    l1, l2 = _stretches(s, u, x1, y1, x2, y2, ux, uy, length)
    value = 0.5 * (max(0.0, l1) + max(0.0, l2))
    start_2, end_2, start_1, end_1 = _sides(s, u, x1, y1, x2, y2, ux, uy)
    if _meets(start_2, end_2) and _meets(start_1, end_1):
        return value
    return value * math.exp(rate * distance)


@_inlined
def add_matches(value, s, u, columns, count, limit, rate, distances, near):  # type: ignore[no-untyped-def]
    """A value with the matching values of a segment 1 and every segment 2 added, in order; the last two are scratch."""
    _distances(s, u, columns, distances)
    for q in range(_near(distances, count, limit, near)):
        j = near[q]
        value += _matching_value(s, u, columns, j, distances[j], rate)
    return value


# --- crossings (line 6) -----------------------------------------------------------------------------


@_compiled
def _turn(segment, axis, poses, columns):  # type: ignore[no-untyped-def]
    """One segment of map 2 under some poses, in columns."""
    for k in range(len(poses)):
        cosine, sine = columns[7, k], columns[8, k]
        columns[0, k] = cosine * segment[0] - sine * segment[1] + poses[k, 0]
        columns[1, k] = sine * segment[0] + cosine * segment[1] + poses[k, 1]
        columns[2, k] = cosine * segment[2] - sine * segment[3] + poses[k, 0]
        columns[3, k] = sine * segment[2] + cosine * segment[3] + poses[k, 1]
        columns[4, k] = cosine * axis[0] - sine * axis[1]
        columns[5, k] = sine * axis[0] + cosine * axis[1]


@_compiled
def _cross(s, u, columns, length, tolerance, sine_refuse, result):  # type: ignore[no-untyped-def]
    """Note where two segments meet inside both, farther than ``tolerance`` from all four extremes, and not too flat."""
    x1, y1, x2, y2, ux, uy = columns[0], columns[1], columns[2], columns[3], columns[4], columns[5]
    for k in range(len(result)):
        start_2, end_2, start_1, end_1 = _sides(s, u, x1[k], y1[k], x2[k], y2[k], ux[k], uy[k])
        along_2 = length * start_2 / (start_2 - end_2)  # where the lines meet
        along_1 = u[2] * start_1 / (start_1 - end_1)
        inside = min(min(along_1, u[2] - along_1), min(along_2, length - along_2)) > tolerance
        steep = abs(u[0] * uy[k] - u[1] * ux[k]) > sine_refuse
        result[k] |= steep & inside


@_compiled
def crossing(
    segments_1: FloatArray,
    segments_2: FloatArray,
    poses: FloatArray,
    tolerance: float,
    refuse_length: float,
    refuse_angle: float,
) -> NDArray[np.bool_]:
    """Whether long segments cross under each candidate ``T_1_2`` of ``poses`` (k, 3), which discards it; shape (k,)."""
    axes_1 = directions(segments_1)
    axes_2 = directions(segments_2)
    long_1 = np.flatnonzero(axes_1[:, 2] > refuse_length)
    long_2 = np.flatnonzero(axes_2[:, 2] > refuse_length)
    result = np.zeros(len(poses), np.bool_)
    if len(long_1) == 0 or len(long_2) == 0:
        return result
    sine_refuse = max(math.sin(refuse_angle), TOUCH)
    columns = np.empty((9, BATCH))
    for first in range(0, len(poses), BATCH):
        some = poses[first : first + BATCH]
        for k in range(len(some)):
            columns[7, k] = math.cos(some[k, 2])
            columns[8, k] = math.sin(some[k, 2])
        for j in long_2:
            _turn(segments_2[j], axes_2[j], some, columns)
            for i in long_1:
                found = result[first : first + len(some)]
                _cross(segments_1[i], axes_1[i], columns, axes_2[j, 2], tolerance, sine_refuse, found)
    return result


# --- values (lines 5 to 19) -------------------------------------------------------------------------


@_compiled
def evaluate(
    segments_1: FloatArray,
    segments_2: FloatArray,
    poses: FloatArray,
    tolerance: float,
    threshold: float,
    penalty: float,
    refuse_length: float,
    refuse_angle: float,
) -> FloatArray:
    """The value of each candidate ``T_1_2`` of ``poses`` (k, 3), shape (k,); NaN: discarded.

    Every pair of segments of every candidate is looked at, and summed in index order.
    """
    values = np.empty(len(poses))
    axes_1 = directions(segments_1)
    axes_2 = directions(segments_2)
    discarded = crossing(segments_1, segments_2, poses, tolerance, refuse_length, refuse_angle)
    columns = columns_of(axes_2)
    distances = np.empty(columns.shape[1])
    near = np.empty(columns.shape[1] + 1, np.int64)
    limit = threshold * tolerance
    rate = math.log(penalty) / tolerance
    for k in range(len(poses)):
        if discarded[k]:
            values[k] = np.nan
            continue
        move(segments_2, axes_2, poses[k], columns)
        value = 0.0
        for i in range(len(segments_1)):
            value = add_matches(value, segments_1[i], axes_1[i], columns, len(segments_2), limit, rate, distances, near)
        values[k] = value
    return values


@_compiled
def matching_pairs(
    segments_1: FloatArray,
    segments_2: FloatArray,
    pose: FloatArray,
    tolerance: float,
    threshold: float,
    penalty: float,
    least: float,
) -> tuple[IntArray, FloatArray]:
    """The pairs (i, j) whose matching value under one pose is above ``least``, (m, 2), and the values, (m,)."""
    axes_1 = directions(segments_1)
    axes_2 = directions(segments_2)
    columns = columns_of(axes_2)
    move(segments_2, axes_2, pose, columns)
    distances = np.empty(columns.shape[1])
    rate = math.log(penalty) / tolerance
    pairs = []
    values = []
    for i in range(len(segments_1)):
        _distances(segments_1[i], axes_1[i], columns, distances)
        for j in range(len(segments_2)):
            if distances[j] <= threshold * tolerance:
                value = _matching_value(segments_1[i], axes_1[i], columns, j, distances[j], rate)
                if value > least:
                    pairs.append((i, j))
                    values.append(value)
    indices = np.empty((len(pairs), 2), np.int64)
    for k in range(len(pairs)):
        indices[k, 0] = pairs[k][0]
        indices[k, 1] = pairs[k][1]
    return indices, np.array(values)
