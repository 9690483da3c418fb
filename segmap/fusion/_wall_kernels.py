"""The inner loops over pieces of segments, from which walls are found. Same rules as :mod:`segmap._kernels`.

A line is a row (x, y, ux, uy): a point and the unit direction. Of a piece, t is where its middle lies along a line
and n how far to the left of it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from segmap._sight_kernels import CLASSES, _seen_by
from segmap.pose import FloatArray, IntArray

__all__ = ["Grid", "Pieces", "crowding", "fitted", "profile", "votes"]

STEPS = 8
"""most rounds of fitting"""
SETTLED = 1e-4
"""metres, and radians: a line that moves less is found"""

_compiled = njit(cache=True, nogil=True, error_model="numpy")
_inlined = njit(cache=True, nogil=True, error_model="numpy", inline="always")


class Pieces(NamedTuple):
    """Segments cut into short pieces."""

    middles: FloatArray
    """(m, 2), metres"""
    along: FloatArray
    """(m, 2): unit directions"""
    lengths: FloatArray
    """(m,), metres"""
    weights: FloatArray
    """(m,): how far each is to be trusted, at most 1"""
    either: NDArray[np.bool_]
    """(m,): whether it may as well run the other way"""

    def take(self, rows: IntArray) -> Pieces:
        """Some of them."""
        middles, along, lengths, weights, either = self
        return Pieces(middles[rows], along[rows], lengths[rows], weights[rows], either[rows])


class Grid(NamedTuple):
    """Which pieces are in which cell of a square grid."""

    order: IntArray
    """(m,): pieces by cell"""
    starts: IntArray
    """(rows * columns + 1,): where each cell's begin"""
    corner: FloatArray
    """(2,): x and y from, metres"""
    rows: int
    columns: int
    cell: float
    """metres"""


@_inlined
def _agreement(pieces, j, ux, uy):  # type: ignore[no-untyped-def]
    """Cosine between a piece and a direction."""
    cosine = pieces.along[j, 0] * ux + pieces.along[j, 1] * uy
    return abs(cosine) if pieces.either[j] else cosine


@_compiled
def crowding(pieces: Pieces, grid: Grid, spread: float, cosine: float) -> FloatArray:
    """About how many segments run through each piece's middle in its direction, (m,).

    Each piece beside the middle counts by its weight and, with ``spread`` as standard deviation, by its distance.
    """
    crowd = np.zeros(len(pieces.middles))
    for i in range(len(crowd)):
        x = pieces.middles[i, 0]
        y = pieces.middles[i, 1]
        row = int((x - grid.corner[0]) / grid.cell)
        column = int((y - grid.corner[1]) / grid.cell)
        for r in range(max(0, row - 1), min(grid.rows, row + 2)):
            for c in range(max(0, column - 1), min(grid.columns, column + 2)):
                first = grid.starts[r * grid.columns + c]
                last = grid.starts[r * grid.columns + c + 1]
                for j in grid.order[first:last]:
                    if _agreement(pieces, j, pieces.along[i, 0], pieces.along[i, 1]) < cosine and not (
                        pieces.either[i] and _agreement(pieces, j, -pieces.along[i, 0], -pieces.along[i, 1]) >= cosine
                    ):
                        continue
                    dx = x - pieces.middles[j, 0]
                    dy = y - pieces.middles[j, 1]
                    if abs(dx * pieces.along[j, 0] + dy * pieces.along[j, 1]) <= 0.5 * pieces.lengths[j]:
                        n = dy * pieces.along[j, 0] - dx * pieces.along[j, 1]
                        crowd[i] += pieces.weights[j] * math.exp(-0.5 * (n / spread) ** 2)
    return crowd


@_compiled
def _beside(line, pieces, free, tolerance, cosine, rows, places):  # type: ignore[no-untyped-def]
    """The free pieces within the tolerance of a line: fills their rows and places along it; how many."""
    count = 0
    for j in range(len(free)):
        if not free[j] or _agreement(pieces, j, line[2], line[3]) < cosine:
            continue
        dx = pieces.middles[j, 0] - line[0]
        dy = pieces.middles[j, 1] - line[1]
        if abs(dy * line[2] - dx * line[3]) <= tolerance:
            rows[count] = j
            places[count] = dx * line[2] + dy * line[3]
            count += 1
    return count


@_compiled
def _run(places, lengths, gap, start):  # type: ignore[no-untyped-def]
    """The places in order that are joined to one of them, ``start``, without a gap: first and last."""
    first = start
    while first > 0 and places[first] - places[first - 1] - 0.5 * (lengths[first] + lengths[first - 1]) <= gap:
        first -= 1
    last = start
    while last < len(places) - 1 and places[last + 1] - places[last] - 0.5 * (lengths[last] + lengths[last + 1]) <= gap:
        last += 1
    return first, last


@_compiled
def fitted(
    line: FloatArray,
    pieces: Pieces,
    free: NDArray[np.bool_],
    spread: float,
    tolerance: float,
    gap: float,
    cosine: float,
) -> FloatArray:
    """The line through the free pieces that go on from its point without a gap, by total least squares.

    Pieces within ``tolerance`` count, the less the farther they are: the line settles where most of them lie.
    """
    line = line.copy()
    x = line[0]
    y = line[1]
    rows = np.empty(len(free), np.int64)
    places = np.empty(len(free))
    for _ in range(STEPS):
        count = _beside(line, pieces, free, tolerance, cosine, rows, places)
        if count == 0:
            break
        order = np.argsort(places[:count], kind="mergesort")
        here = (x - line[0]) * line[2] + (y - line[1]) * line[3]
        start = np.argmin(np.abs(places[:count][order] - here))
        members = rows[:count][order]
        first, last = _run(places[:count][order], pieces.lengths[members], gap, start)
        if _refit(line, pieces, members[first : last + 1], spread) < SETTLED:
            break
    return line


@_compiled
def _refit(line, pieces, members, spread):  # type: ignore[no-untyped-def]
    """Lay a line through some pieces, weighted by their distance from where it was; how far it moved."""
    weights = np.empty(len(members))
    x = 0.0
    y = 0.0
    for k, j in enumerate(members):
        n = (pieces.middles[j, 1] - line[1]) * line[2] - (pieces.middles[j, 0] - line[0]) * line[3]
        weights[k] = pieces.weights[j] * pieces.lengths[j] * math.exp(-0.5 * (n / spread) ** 2)
        x += weights[k] * pieces.middles[j, 0]
        y += weights[k] * pieces.middles[j, 1]
    total = weights.sum()
    x /= total
    y /= total
    xx = 0.0
    xy = 0.0
    yy = 0.0
    for k, j in enumerate(members):
        dx = pieces.middles[j, 0] - x
        dy = pieces.middles[j, 1] - y
        own = pieces.lengths[j] ** 2 / 12.0
        xx += weights[k] * (dx * dx + own * pieces.along[j, 0] ** 2)
        xy += weights[k] * (dx * dy + own * pieces.along[j, 0] * pieces.along[j, 1])
        yy += weights[k] * (dy * dy + own * pieces.along[j, 1] ** 2)
    heading = 0.5 * math.atan2(2.0 * xy, xx - yy)
    ux = math.cos(heading)
    uy = math.sin(heading)
    if ux * line[2] + uy * line[3] < 0.0:
        ux = -ux
        uy = -uy
    moved = abs((y - line[1]) * line[2] - (x - line[0]) * line[3]) + abs(line[2] * uy - line[3] * ux)
    line[0] = x
    line[1] = y
    line[2] = ux
    line[3] = uy
    return moved


@_compiled
def profile(
    line: FloatArray,
    pieces: Pieces,
    free: NDArray[np.bool_],
    cosine: float,
    start: float,
    step: float,
    bins: int,
    cell: float,
    half: int,
) -> FloatArray:
    """What lies along and beside a line: the weight of the free pieces in each bin, (bins, 2 * half + 1).

    Bins of ``step`` metres begin at t = ``start``; beside the line they are ``cell`` metres wide, the middle one on it.
    """
    weights = np.zeros((bins, 2 * half + 1))
    for j in range(len(free)):
        if not free[j] or _agreement(pieces, j, line[2], line[3]) < cosine:
            continue
        dx = pieces.middles[j, 0] - line[0]
        dy = pieces.middles[j, 1] - line[1]
        beside = math.floor((dy * line[2] - dx * line[3]) / cell + 0.5) + half
        if beside < 0 or beside > 2 * half:
            continue
        t = dx * line[2] + dy * line[3] - start
        first = max(0, math.floor((t - 0.5 * pieces.lengths[j]) / step + 0.5))
        last = min(bins, max(first + 1, math.floor((t + 0.5 * pieces.lengths[j]) / step + 0.5)))
        for b in range(first, last):
            weights[b, int(beside)] += pieces.weights[j]
    return weights


@_compiled
def votes(
    points: FloatArray,
    normals: FloatArray,
    beams: FloatArray,
    sensors: FloatArray,
    reach: float,
    grazing: float,
    tolerance: float,
    gap: float,
) -> IntArray:
    """How many sensors in front of each point (m, 2) see it in each way, (m, 4): supported, contradicted, ...

    A sensor counts within ``reach`` metres and where the sine between its beam and the wall, whose ``normals`` (m, 2)
    point to its free side, is above ``grazing``.
    """
    counts = np.zeros((len(points), CLASSES), np.int64)
    for k in range(len(points)):
        for s in range(len(sensors)):
            dx = sensors[s, 2] - points[k, 0]
            dy = sensors[s, 3] - points[k, 1]
            squared = dx * dx + dy * dy
            if squared > reach * reach:
                continue
            if dx * normals[k, 0] + dy * normals[k, 1] <= grazing * math.sqrt(squared):
                continue
            counts[k, _seen_by(points[k, 0], points[k, 1], beams, sensors, s, tolerance, gap, 0.0)] += 1
    return counts
