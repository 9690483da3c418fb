"""Cells of a grid, compiled by numba: triangles filled, lines drawn. Each has a plain twin in the tests.

Coordinates are in cells from the grid's lower left corner: cell (row, column) covers x from column
to column + 1 and y from row to row + 1. What lies outside the grid is passed over.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from segmap.pose import FloatArray

__all__ = ["draw_lines", "fill_triangles"]

_compiled = njit(cache=True, nogil=True, error_model="numpy")


@_compiled
def fill_triangles(cells: NDArray[Any], triangles: FloatArray, value: int) -> None:
    """Set every cell whose centre lies in one of some triangles, (n, 3, 2)."""
    rows, columns = cells.shape
    for t in range(len(triangles)):
        low, high = triangles[t, :, 1].min(), triangles[t, :, 1].max()
        for row in range(max(math.ceil(low - 0.5), 0), min(math.floor(high - 0.5), rows - 1) + 1):
            left, right = _across(triangles[t], row + 0.5)
            for column in range(max(math.ceil(left - 0.5), 0), min(math.floor(right - 0.5), columns - 1) + 1):
                cells[row, column] = value


@_compiled
def _across(triangle, y):  # type: ignore[no-untyped-def]
    """From where to where a triangle reaches at a height."""
    left, right = np.inf, -np.inf
    for i in range(3):
        x1, y1 = triangle[i]
        x2, y2 = triangle[(i + 1) % 3]
        if min(y1, y2) <= y <= max(y1, y2):
            x = x1 if y1 == y2 else x1 + (x2 - x1) * (y - y1) / (y2 - y1)
            left, right = min(left, x), max(right, x)
            if y1 == y2:
                left, right = min(left, x2), max(right, x2)
    return left, right


@_compiled
def draw_lines(cells: NDArray[Any], lines: FloatArray, value: int) -> None:
    """Set every cell that one of some lines, (n, 4), passes through, so that no gap is left between them."""
    rows, columns = cells.shape
    for i in range(len(lines)):
        x1, y1, x2, y2 = lines[i]
        column, row = math.floor(x1), math.floor(y1)
        last_column, last_row = math.floor(x2), math.floor(y2)
        right, up = (1 if x2 > x1 else -1), (1 if y2 > y1 else -1)
        for _ in range(abs(last_column - column) + abs(last_row - row) + 1):
            if 0 <= row < rows and 0 <= column < columns:
                cells[row, column] = value
            # the next border on the line: crossing a column's where that comes first
            to_column = (column + (right > 0) - x1) / (x2 - x1) if column != last_column else np.inf
            to_row = (row + (up > 0) - y1) / (y2 - y1) if row != last_row else np.inf
            if to_column < to_row:
                column += right
            else:
                row += up
