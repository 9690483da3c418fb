"""Upper bounds on the values of many candidates, from tables; closer ones of few. Same rules as :mod:`segmap._kernels`.

A candidate's bound is the sum of what the tables of :mod:`segmap._bound_kernels` hold for each segment of map 2.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from segmap._bound_kernels import Grid
from segmap._kernels import directions
from segmap._value_kernels import add_matches, columns_of, move
from segmap.pose import FloatArray, IntArray

__all__ = ["Tables", "by_rotation", "look_up", "outlast"]

GROUP = 2048
"""candidates whose bounds are summed at a time: their numbers stay in the nearest cache"""
FEW = 64
"""candidates whose closer bounds are found at a time"""

_compiled = njit(cache=True, nogil=True, error_model="numpy")
_inlined = njit(cache=True, nogil=True, error_model="numpy", inline="always")


class Tables(NamedTuple):
    """Tables, and where the segments of map 2 are looked up in them."""

    cells: NDArray[np.float32]
    """shape (kinds times headings, rows times columns), metres"""
    headings: int
    """bins of half a turn"""
    rows: int
    columns: int
    grid: Grid
    kinds: IntArray
    """shape (n,): of each segment of map 2, the kind"""
    middles: FloatArray
    """shape (n, 2): its middle, from ``middle``"""
    middle: FloatArray
    """shape (2,): of map 2, metres"""
    turns: FloatArray
    """shape (n,): its heading in radians"""
    rotations: int
    """bins of a whole turn"""


@_compiled
def by_rotation(poses: FloatArray, bins: int) -> tuple[IntArray, IntArray]:
    """The rows of poses (k, 3) sorted into bins of rotation from -pi to pi, and where each bin starts, (bins + 1,)."""
    starts = np.zeros(bins + 1, np.int64)
    bin_of = np.empty(len(poses), np.int32)
    for k in range(len(poses)):
        bin_of[k] = _rotation_bin(poses[k, 2], bins)
        starts[bin_of[k] + 1] += 1
    for b in range(bins):
        starts[b + 1] += starts[b]
    free = starts[:-1].copy()
    order = np.empty(len(poses), np.int64)
    for k in range(len(poses)):
        order[free[bin_of[k]]] = k
        free[bin_of[k]] += 1
    return order, starts


@_inlined
def _rotation_bin(theta, bins):  # type: ignore[no-untyped-def]
    turn = (theta + math.pi) / (2.0 * math.pi)
    return min(bins - 1, int((turn - math.floor(turn)) * bins))


@_inlined
def _table_of(tables, j, b):  # type: ignore[no-untyped-def]
    """The table of segment j of map 2 under the rotations of bin b."""
    turned = tables.turns[j] / math.pi + (b + 0.5) * (2.0 / tables.rotations) - 1.0
    heading = int((turned - math.floor(turned)) * tables.headings)
    return tables.kinds[j] * tables.headings + min(tables.headings - 1, heading)


@_compiled
def _placed(poses, rows, tables, places):  # type: ignore[no-untyped-def]
    """Cosine, sine, x, y of some poses in cells, for points of map 2 from its middle, (4, k)."""
    grid, middle = tables.grid, tables.middle
    for k in range(len(rows)):
        x, y, theta = poses[rows[k], 0], poses[rows[k], 1], poses[rows[k], 2]
        cosine = math.cos(theta)
        sine = math.sin(theta)
        places[0, k] = cosine / grid.cell
        places[1, k] = sine / grid.cell
        places[2, k] = (x + cosine * middle[0] - sine * middle[1] - grid.x) / grid.cell
        places[3, k] = (y + sine * middle[0] + cosine * middle[1] - grid.y) / grid.cell


@_compiled
def _find(places, tables, j, cells):  # type: ignore[no-untyped-def]
    """The cell of the middle of segment j under each of some poses; what lies outside, in the border."""
    x, y = np.float32(tables.middles[j, 0]), np.float32(tables.middles[j, 1])
    zero = np.float32(0.0)
    right = np.float32(tables.columns - 1)
    top = np.float32(tables.rows - 1)
    row = np.float32(tables.columns)
    for k in range(len(cells)):
        u = places[0, k] * x - places[1, k] * y + places[2, k]
        v = places[1, k] * x + places[0, k] * y + places[3, k]
        u = min(max(u, zero), right)
        v = min(max(v, zero), top)
        cells[k] = np.uint32(np.int32(np.floor(v) * row + np.floor(u)))


@_compiled
def _gather(table, cells, sums):  # type: ignore[no-untyped-def]
    for k in range(len(cells)):
        sums[k] += table[cells[k]]


@_compiled
def _sum_runs(tables, j, cells, sums, starts, first, last):  # type: ignore[no-untyped-def]
    """Add what segment j has in its table of each rotation bin; bins in a row with one table at once."""
    b = first
    while b < last:
        table = _table_of(tables, j, b)
        end = b + 1
        while end < last and _table_of(tables, j, end) == table:
            end += 1
        low, high = starts[b] - starts[first], starts[end] - starts[first]
        _gather(tables.cells[table], cells[low:high], sums[low:high])
        b = end


@_compiled
def look_up(tables, poses, order, starts, first, last, bounds):  # type: ignore[no-untyped-def]
    """Write the bounds of the candidates of rotation bins ``first`` to ``last`` (exclusive), by row of ``poses``.

    ``order`` and ``starts`` are those of :func:`by_rotation`; bounds are sums in single precision.
    """
    b = first
    while b < last:
        end = b + 1
        while end < last and starts[end + 1] - starts[b] <= GROUP:
            end += 1
        rows = order[starts[b] : starts[end]]
        places = np.empty((4, len(rows)), np.float32)
        cells = np.empty(len(rows), np.uint32)
        sums = np.zeros(len(rows), np.float32)
        _placed(poses, rows, tables, places)
        for j in range(len(tables.kinds)):
            _find(places, tables, j, cells)
            _sum_runs(tables, j, cells, sums, starts, b, end)
        for k in range(len(rows)):
            bounds[rows[k]] = sums[k]
        b = end


# --- closer bounds ----------------------------------------------------------------------------------


@_compiled
def _each(tables, poses, rows, places, cells, bounds):  # type: ignore[no-untyped-def]
    """The bound of every segment of map 2 under each of some poses, (n, k)."""
    _placed(poses, rows, tables, places)
    for j in range(len(tables.kinds)):
        _find(places, tables, j, cells)
        for k in range(len(rows)):
            b = _rotation_bin(poses[rows[k], 2], tables.rotations)
            bounds[j, k] = tables.cells[_table_of(tables, j, b), cells[k]]


@_compiled
def _outlasts(bounds, order, moved, axes_2, columns_1, count_1, limit, rate, least, distances, near):  # type: ignore[no-untyped-def]
    """Whether bounds of the segments of map 2 add up to ``least`` while truth takes their place, one by one."""
    total = 0.0
    for j in range(len(bounds)):
        total += bounds[j]
    for j in order:
        if total < least:
            return False
        if bounds[j] > 0.0:
            axis = (moved[4, j], moved[5, j], axes_2[j, 2])
            segment = (moved[0, j], moved[1, j], moved[2, j], moved[3, j])
            total -= bounds[j]
            total = add_matches(total, segment, axis, columns_1, count_1, limit, rate, distances, near)
    return total >= least


@_compiled
def outlast(
    tables: Tables,
    poses: FloatArray,
    rows: IntArray,
    segments_1: FloatArray,
    segments_2: FloatArray,
    limit: float,
    rate: float,
    least: float,
) -> NDArray[np.bool_]:
    """Which of the candidates ``rows`` of ``poses`` (k, 3) can have a value of ``least`` and above.

    The longest segments of map 2 come first; most candidates fall out after a few.
    """
    axes_1 = directions(segments_1)
    axes_2 = directions(segments_2)
    columns_1 = columns_of(axes_1)
    move(segments_1, axes_1, np.zeros(3), columns_1)
    moved = columns_of(axes_2)
    order = np.argsort(-axes_2[:, 2])
    distances = np.empty(columns_1.shape[1])
    near = np.empty(columns_1.shape[1] + 1, np.int64)
    places = np.empty((4, FEW), np.float32)
    cells = np.empty(FEW, np.uint32)
    bounds = np.empty((len(segments_2), FEW))
    result = np.empty(len(rows), np.bool_)
    for first in range(0, len(rows), FEW):
        some = rows[first : first + FEW]
        _each(tables, poses, some, places, cells[: len(some)], bounds)
        for k in range(len(some)):
            move(segments_2, axes_2, poses[some[k]], moved)
            result[first + k] = _outlasts(
                bounds[:, k], order, moved, axes_2, columns_1, len(segments_1), limit, rate, least, distances, near
            )
    return result
