"""The entries of the inverse of a sparse positive definite matrix where the matrix itself has entries, compiled.

The matrix is factorised as L D L^T with L unit lower triangular, and the inverse Z is filled in from its last
column to its first: ``Z = D^-1 L^-1 + (I - L^T) Z`` needs of Z only what lies on the pattern of L (Takahashi,
Fagan, Chen 1973). Matrices are columns of a lower or upper triangle; nothing here checks its arguments.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from segmap.pose import FloatArray, IntArray

__all__ = ["column_starts", "factorise", "invert", "looked_up"]

_compiled = njit(cache=True, nogil=True, error_model="numpy")


@_compiled
def _columns(starts: IntArray, rows: IntArray) -> tuple[IntArray, IntArray]:
    """The elimination tree, and where each column of L begins, from the upper triangle of the matrix."""
    size = len(starts) - 1
    parents, seen, counts = np.full(size, -1), np.full(size, -1), np.zeros(size + 1, np.int64)
    for k in range(size):
        seen[k] = k
        for entry in range(starts[k], starts[k + 1]):
            i = rows[entry]
            while i < k and seen[i] != k:
                if parents[i] < 0:
                    parents[i] = k
                counts[i + 1] += 1
                seen[i] = k
                i = parents[i]
    return parents, np.cumsum(counts)


@_compiled
def column_starts(starts: IntArray, rows: IntArray) -> IntArray:
    """Where each column of L would begin, and at last how many entries it has below its diagonal."""
    return _columns(starts, rows)[1]


@_compiled
def factorise(
    starts: IntArray, rows: IntArray, values: FloatArray
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Column starts, rows and values of L without its diagonal, and D, of a symmetric matrix given by columns.

    Row k of L is solved for with the columns before it; what is below the diagonal is not looked at.
    """
    size = len(starts) - 1
    parents, begins = _columns(starts, rows)
    below, factors, diagonal = np.zeros(begins[-1], np.int64), np.zeros(begins[-1]), np.zeros(size)
    ends, seen = begins[:-1].copy(), np.full(size, -1)
    row, order, path = np.zeros(size), np.zeros(size, np.int64), np.zeros(size, np.int64)
    for k in range(size):
        seen[k], top = k, size
        for entry in range(starts[k], starts[k + 1]):
            i, length = rows[entry], 0
            if i > k:
                continue
            row[i] += values[entry]
            while seen[i] != k:
                path[length], seen[i] = i, k
                length, i = length + 1, parents[i]
            while length > 0:
                length, top = length - 1, top - 1
                order[top] = path[length]
        diagonal[k], row[k] = row[k], 0.0
        for place in range(top, size):
            i = order[place]
            held, row[i] = row[i], 0.0
            for entry in range(begins[i], ends[i]):
                row[below[entry]] -= factors[entry] * held
            diagonal[k] -= held / diagonal[i] * held
            below[ends[i]], factors[ends[i]] = k, held / diagonal[i]
            ends[i] += 1
    return begins, below, factors, diagonal


@_compiled
def invert(
    begins: IntArray, below: IntArray, factors: FloatArray, diagonal: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The inverse on the pattern of L: its entries below the diagonal, in the order of L's, and its diagonal."""
    size = len(diagonal)
    inverse, middle = np.zeros(len(below)), 1.0 / diagonal
    column, sums, marks = np.zeros(size), np.zeros(size), np.full(size, -1)
    for j in range(size - 1, -1, -1):
        for entry in range(begins[j], begins[j + 1]):
            k = below[entry]
            column[k], sums[k], marks[k] = factors[entry], 0.0, j
        for entry in range(begins[j], begins[j + 1]):
            k = below[entry]
            sums[k] += column[k] * middle[k]
            for other in range(begins[k], begins[k + 1]):
                i = below[other]
                if marks[i] == j:
                    sums[i] += column[k] * inverse[other]
                    sums[k] += column[i] * inverse[other]
        for entry in range(begins[j], begins[j + 1]):
            inverse[entry] = -sums[below[entry]]
            middle[j] -= factors[entry] * inverse[entry]
    return inverse, middle


@_compiled
def looked_up(
    begins: IntArray, below: IntArray, inverse: FloatArray, middle: FloatArray, rows: IntArray, columns: IntArray
) -> FloatArray:
    """The entries of the inverse at some rows and columns, NaN where the pattern of L has none."""
    found = np.full(len(rows), np.nan)
    for place in range(len(rows)):
        low, high = min(rows[place], columns[place]), max(rows[place], columns[place])
        if low == high:
            found[place] = middle[low]
            continue
        entry = begins[low] + np.searchsorted(below[begins[low] : begins[low + 1]], high)
        if entry < begins[low + 1] and below[entry] == high:
            found[place] = inverse[entry]
    return found
