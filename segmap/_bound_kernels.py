"""Tables of what a segment can add to a value, by where it lies. Same rules as :mod:`segmap._kernels`.

A table holds, for segments of map 2 of about one length and one heading in the frame of map 1, and for each
cell of a grid over map 1, the most that such a segment with its middle in that cell can add to a value. A
candidate's bound is one look for each segment of map 2. What makes a table a bound, with s1 of half length
k, s2 of half length l, p the angle between their lines and (x, y), (a, b) the middle of s2 seen from the
middle of s1, along and across s1 and s2:

- they are within d of each other's lines only where |y| + l sin p <= d or |b| + k sin p <= d;
- s1 covers of s2 at most k + l cos p - |x|, 2 k and 2 l cos p, and s2 of s1 at most l + k cos p - |a|, 2 l
  and 2 k cos p, so beyond |x| = k + l cos p + d tan p, or the like along s2, nothing is left;
- where they do not meet, the penalty for the smaller of the two distances applies.

Steep pairs therefore reach far along strips; what they can still add outside the grid is kept in its border
cells, which stand for everything beyond.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import njit

__all__ = ["Grid", "paint"]

_compiled = njit(cache=True, nogil=True, error_model="numpy")
_inlined = njit(cache=True, nogil=True, error_model="numpy", inline="always")


class Grid(NamedTuple):
    """Where the cells of the tables lie in the frame of map 1, and what rounding may add."""

    x: float
    """metres, the corner of the first cell"""
    y: float
    cell: float
    """metres"""
    margin: float
    """metres by which middles may be off"""
    slack: float
    """radians by which headings may be off: half the width of a bin, and half that of a rotation's"""


class _Pair(NamedTuple):
    """Segment 1 and a kind of segments 2: lengths, angle, and the rectangles outside of which they never match."""

    x: float
    """middle of segment 1, cells from the corner of the grid in the units of metres"""
    y: float
    cosine_1: float
    sine_1: float
    cosine_2: float
    sine_2: float
    half_1: float
    least_2: float
    """half length of the shortest and longest segment 2"""
    most_2: float
    sine_least: float
    """of the angle between the two, over the slack in heading"""
    sine_most: float
    cosine_most: float
    along_1: float
    """half extents of the rectangle along segment 1, and of that along segment 2; negative: no such rectangle"""
    across_1: float
    along_2: float
    across_2: float


@_compiled
def _pair(segment, heading, least, most, grid, limit, longest):  # type: ignore[no-untyped-def]
    dx = segment[2] - segment[0]
    dy = segment[3] - segment[1]
    length = math.sqrt(dx * dx + dy * dy)
    cosine_1, sine_1, half = dx / length, dy / length, 0.5 * length
    cosine_2, sine_2 = math.cos(heading), math.sin(heading)
    angle = math.asin(min(1.0, abs(cosine_1 * sine_2 - sine_1 * cosine_2)))
    smallest = max(0.0, angle - grid.slack)
    largest = min(0.5 * math.pi, angle + grid.slack)
    sine_least, cosine_most = math.sin(smallest), math.cos(smallest)
    far = limit * math.tan(largest) if largest < 1.57 else longest
    across_1 = limit + grid.margin - least * sine_least
    across_2 = limit + grid.margin - half * sine_least
    along_1 = min(longest, half + most * cosine_most + far + grid.margin)
    along_2 = min(longest, most + half * cosine_most + far + grid.margin)
    return _Pair(
        0.5 * (segment[0] + segment[2]) - grid.x,
        0.5 * (segment[1] + segment[3]) - grid.y,
        cosine_1,
        sine_1,
        cosine_2,
        sine_2,
        half,
        least,
        most,
        sine_least,
        math.sin(largest),
        cosine_most,
        along_1,
        across_1,
        along_2 + max(0.0, across_2) * grid.slack,
        across_2 + along_2 * grid.slack if across_2 >= 0.0 else -1.0,
    )


@_inlined
def _within(offset, rate, reach, low, high):  # type: ignore[no-untyped-def]
    """The part of low..high (from some middle) where |rate x + v| <= reach for some v within offset; empty: 1, 0."""
    first, last = offset
    if abs(rate) < 1e-9:
        near = first - 1e-6 <= reach and last + 1e-6 >= -reach
        return (low, high) if near else (1.0, 0.0)
    p = (-reach - last) / rate
    q = (reach - first) / rate
    return max(low, min(p, q)), min(high, max(p, q))


@_compiled
def _row_span(pair, ux, uy, along, across, row, width, cell):  # type: ignore[no-untyped-def]
    """The first and last cell of a row that a rectangle about the middle of segment 1 touches; none: 1, 0."""
    if across < 0.0:
        return 1, 0
    low = row * cell - pair.y
    high = low + cell
    first, last = -pair.x, width * cell - pair.x
    first, last = _within((min(uy * low, uy * high), max(uy * low, uy * high)), ux, along, first, last)
    if first <= last:
        first, last = _within((min(ux * low, ux * high), max(ux * low, ux * high)), -uy, across, first, last)
    if first > last:
        return 1, 0
    return max(0, int((first + pair.x) / cell)), min(width - 1, int((last + pair.x) / cell))


@_compiled
def _add(row, first, last, x, y, pair, grid, limit, rate):  # type: ignore[no-untyped-def]
    """Add the most a pair can match in each of some cells of a row; x, y: the centre of cell 0 from segment 1."""
    wide_1 = 0.5 * grid.cell * (abs(pair.cosine_1) + abs(pair.sine_1)) + grid.margin
    wide_2 = 0.5 * grid.cell * (abs(pair.cosine_2) + abs(pair.sine_2)) + grid.margin
    most_1 = min(2.0 * pair.half_1, 2.0 * pair.most_2 * pair.cosine_most)
    most_2 = min(2.0 * pair.most_2, 2.0 * pair.half_1 * pair.cosine_most)
    reach_1 = pair.half_1 + pair.most_2 * pair.cosine_most
    reach_2 = pair.most_2 + pair.half_1 * pair.cosine_most
    own_1 = pair.half_1 * pair.sine_least
    own_2 = pair.least_2 * pair.sine_least
    meet_1 = pair.most_2 * pair.sine_most + grid.margin
    meet_2 = pair.half_1 * pair.sine_most + grid.margin
    for q in range(first, last + 1):
        dx = x + q * grid.cell
        along_1 = abs(dx * pair.cosine_1 + y * pair.sine_1) - wide_1
        across_1 = max(0.0, abs(y * pair.cosine_1 - dx * pair.sine_1) - wide_1)
        a = abs(dx * pair.cosine_2 + y * pair.sine_2)
        b = abs(y * pair.cosine_2 - dx * pair.sine_2)
        along_2 = a - wide_2 - grid.slack * (b + wide_2 + grid.slack * (a + wide_2))
        across_2 = max(0.0, b - wide_2 - grid.slack * (a + wide_2 + grid.slack * (b + wide_2)))
        distance = min(across_1 + own_2, across_2 + own_1)
        covered = min(most_1, max(0.0, reach_1 - max(0.0, along_1)))
        covered += min(most_2, max(0.0, reach_2 - max(0.0, along_2)))
        away = rate * distance
        penalty = min(1.0, 1.0 + away + 0.5 * away * away)  # e^x <= 1 + x + x^2 / 2 for x <= 0
        penalty = penalty if max(across_1 - meet_1, across_2 - meet_2) > 0.0 else 1.0
        row[q] += 0.5 * covered * penalty if distance <= limit else 0.0


@_inlined
def _way_out(x, y, ux, uy, across, width, height):  # type: ignore[no-untyped-def]
    """How far a strip along (ux, uy) about a point runs at least before it leaves the grid."""
    sideways = (min(x, width - x) - across * abs(uy)) / max(1e-12, abs(ux))
    upwards = (min(y, height - y) - across * abs(ux)) / max(1e-12, abs(uy))
    return max(0.0, min(sideways, upwards))


@_compiled
def _outside(pair, ux, uy, along, across, shape, grid, limit):  # type: ignore[no-untyped-def]
    """The most a pair can match where a rectangle reaches out of the grid, less its border."""
    if across < 0.0:
        return 0.0
    width, height = (shape[1] - 2) * grid.cell, (shape[0] - 2) * grid.cell
    out = _way_out(pair.x - grid.cell, pair.y - grid.cell, ux, uy, across, width, height)
    if out > along:
        return 0.0
    rest = max(0.0, out - pair.half_1 - pair.most_2 - grid.margin)  # <= limit * tan of the angle
    cosine = min(pair.cosine_most, limit / math.sqrt(limit * limit + rest * rest)) if limit > 0.0 else 1.0
    return 0.5 * (
        min(2.0 * pair.half_1, 2.0 * pair.most_2 * cosine) + min(2.0 * pair.most_2, 2.0 * pair.half_1 * cosine)
    )


@_compiled
def _paint(table, pair, grid, limit, rate):  # type: ignore[no-untyped-def]
    """Add what one segment of map 1 can match to the cells of one table; returns what it can outside."""
    height, width = table.shape
    up = 0.0
    if pair.across_1 >= 0.0:
        up = pair.along_1 * abs(pair.sine_1) + pair.across_1 * abs(pair.cosine_1)
    if pair.across_2 >= 0.0:
        up = max(up, pair.along_2 * abs(pair.sine_2) + pair.across_2 * abs(pair.cosine_2))
    x = 0.5 * grid.cell - pair.x
    for r in range(max(0, int((pair.y - up) / grid.cell)), min(height - 1, int((pair.y + up) / grid.cell)) + 1):
        y = (r + 0.5) * grid.cell - pair.y
        first, last = _row_span(pair, pair.cosine_1, pair.sine_1, pair.along_1, pair.across_1, r, width, grid.cell)
        begin, end = _row_span(pair, pair.cosine_2, pair.sine_2, pair.along_2, pair.across_2, r, width, grid.cell)
        if first <= last and begin <= end and first <= end + 1 and begin <= last + 1:  # one stretch of both
            first, last, begin, end = min(first, begin), max(last, end), 1, 0
        if first <= last:
            _add(table[r], first, last, x, y, pair, grid, limit, rate)
        if begin <= end:
            _add(table[r], begin, end, x, y, pair, grid, limit, rate)
    shape = (height, width)
    return max(
        _outside(pair, pair.cosine_1, pair.sine_1, pair.along_1, pair.across_1, shape, grid, limit),
        _outside(pair, pair.cosine_2, pair.sine_2, pair.along_2, pair.across_2, shape, grid, limit),
    )


@_compiled
def paint(tables, first, last, segments_1, kinds, grid, limit, rate):  # type: ignore[no-untyped-def]
    """Fill tables ``first`` to ``last`` (exclusive) of (kinds, headings, height, width), counted kind by kind.

    ``kinds`` (m, 2) are the least and greatest half length of each kind; ``limit`` is the farthest distance
    at which segments match, ``rate`` the logarithm of the penalty for a metre.
    """
    _, headings, height, width = tables.shape
    longest = (height + width) * grid.cell
    for t in range(first, last):
        kind, heading = t // headings, t % headings
        table = tables[kind, heading]
        table[:] = 0.0
        outside = 0.0
        for i in range(len(segments_1)):
            middle = (heading + 0.5) * math.pi / headings
            pair = _pair(segments_1[i], middle, kinds[kind, 0], kinds[kind, 1], grid, limit, longest)
            if max(pair.across_1, pair.across_2) >= 0.0:
                outside += _paint(table, pair, grid, limit, rate)
        for r in range(height):
            table[r, 0] = max(table[r, 0], outside)
            table[r, width - 1] = max(table[r, width - 1], outside)
        for q in range(width):
            table[0, q] = max(table[0, q], outside)
            table[height - 1, q] = max(table[height - 1, q], outside)
