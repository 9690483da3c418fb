"""The inner loops over walls: how firmly they hold a pose, and what is seen beside them.

Same rules as :mod:`segmap._kernels`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from segmap._sight_kernels import CLASSES, SUPPORTED, Sighting, _look_at
from segmap.pose import FloatArray

__all__ = ["hold", "look_closely"]

WALLS = 3
"""strongest walls taken away"""

_compiled = njit(cache=True, nogil=True, error_model="numpy")
_inlined = njit(cache=True, nogil=True, error_model="numpy", inline="always")


# --- how firmly segments hold a pose --------------------------------------------------------------


@_compiled
def hold(
    points_1: FloatArray,
    points_2: FloatArray,
    segments_1: FloatArray,
    segments_2: FloatArray,
    poses: FloatArray,
    gate: float,
    blur: float,
) -> FloatArray:
    """For each ``T_1_2`` of poses (k, 3), the normal matrices of points of 2 against segments of 1, and of points
    of 1 against segments of 2, (k, 2, 3, 3), by x, y and theta of the pose.

    A point farther than ``gate`` from every segment counts nothing. A segment is sure of its direction only to
    ``blur`` across its length, and what that could feign along it is taken off.
    """
    held = np.zeros((len(poses), 2, 3, 3))
    bounds_2 = _bounds(segments_2, gate)
    for k in range(len(poses)):
        cosine = math.cos(poses[k, 2])
        sine = math.sin(poses[k, 2])
        arms = np.empty((len(points_2), 2))  # from the pose to the points of 2, in frame 1
        for q in range(len(points_2)):
            arms[q, 0] = cosine * points_2[q, 0] - sine * points_2[q, 1]
            arms[q, 1] = sine * points_2[q, 0] + cosine * points_2[q, 1]
        near = _crossing(segments_1, _bounds(arms, gate), poses[k, 0], poses[k, 1])
        for q in range(len(points_2)):
            x = arms[q, 0] + poses[k, 0]
            y = arms[q, 1] + poses[k, 1]
            _add_hold(held[k, 0], x, y, arms[q, 0], arms[q, 1], near, 1.0, 0.0, gate, blur)
        for q in range(len(points_1)):
            dx = points_1[q, 0] - poses[k, 0]
            dy = points_1[q, 1] - poses[k, 1]
            x = cosine * dx + sine * dy
            y = cosine * dy - sine * dx
            if bounds_2[0] <= x <= bounds_2[1] and bounds_2[2] <= y <= bounds_2[3]:
                _add_hold(held[k, 1], x, y, dx, dy, segments_2, cosine, sine, gate, blur)
    return held


@_compiled
def _bounds(rows, margin):  # type: ignore[no-untyped-def]
    """x from and to, y from and to, of rows x, y or x1, y1, x2, y2, and a margin around."""
    bounds = np.array((np.inf, -np.inf, np.inf, -np.inf))
    for i in range(len(rows)):
        for c in range(0, rows.shape[1], 2):
            bounds[0] = min(bounds[0], rows[i, c] - margin)
            bounds[1] = max(bounds[1], rows[i, c] + margin)
            bounds[2] = min(bounds[2], rows[i, c + 1] - margin)
            bounds[3] = max(bounds[3], rows[i, c + 1] + margin)
    return bounds


@_compiled
def _crossing(segments, bounds, x, y):  # type: ignore[no-untyped-def]
    """The segments whose own bounds meet some bounds moved by x and y, in order."""
    kept = np.empty_like(segments)
    count = 0
    for i in range(len(segments)):
        x1, y1, x2, y2 = segments[i]
        across = max(x1, x2) >= bounds[0] + x and min(x1, x2) <= bounds[1] + x
        if across and max(y1, y2) >= bounds[2] + y and min(y1, y2) <= bounds[3] + y:
            kept[count] = segments[i]
            count += 1
    return kept[:count]


@_compiled
def _add_hold(held, x, y, arm_x, arm_y, segments, cosine, sine, gate, blur):  # type: ignore[no-untyped-def]
    """Add what one point tells, by the segment nearest to it; the segments' frame is turned by a cosine and sine."""
    nearest = gate * gate
    best = -1
    for i in range(len(segments)):
        ex = segments[i, 2] - segments[i, 0]
        ey = segments[i, 3] - segments[i, 1]
        dx = x - segments[i, 0]
        dy = y - segments[i, 1]
        share = min(1.0, max(0.0, (dx * ex + dy * ey) / (ex * ex + ey * ey)))
        apart = (dx - share * ex) ** 2 + (dy - share * ey) ** 2
        if apart < nearest:
            nearest = apart
            best = i
    if best < 0:
        return
    ex = segments[best, 2] - segments[best, 0]
    ey = segments[best, 3] - segments[best, 1]
    length = math.sqrt(ex * ex + ey * ey)
    weight = (1.0 - nearest / (gate * gate)) ** 2
    along_x = (cosine * ex - sine * ey) / length
    along_y = (sine * ex + cosine * ey) / length
    _add_square(held, weight, -along_y, along_x, along_x * arm_x + along_y * arm_y)
    _add_square(held, -weight * min(1.0, blur / length) ** 2, along_x, along_y, along_y * arm_x - along_x * arm_y)


@_inlined
def _add_square(matrix, weight, a, b, c):  # type: ignore[no-untyped-def]
    """Add the weighted outer product of a vector with itself."""
    row = (a, b, c)
    for i in range(3):
        for j in range(3):
            matrix[i, j] += weight * row[i] * row[j]


# --- what is more than plain walls ----------------------------------------------------------------


@_compiled
def look_closely(
    sighting_1: Sighting,
    sighting_2: Sighting,
    walls_1: FloatArray,
    walls_2: FloatArray,
    poses: FloatArray,
    tolerance: float,
    gap: float,
    depth: float,
    reach: float,
) -> FloatArray:
    """For each ``T_1_2`` of poses (k, 3): the metres of :func:`segmap._sight_kernels.look`, and the metres supported
    off the strongest 1, 2 and 3 of the walls, (k, 7).

    Walls are given by segments (n, 4) of each map and run on along their lines. The strongest is the one with most
    support within ``reach`` of its line; what it has is taken away before the next is chosen. Both maps support the
    same wall, so half of the sum of their widths counts.
    """
    found = np.zeros((len(poses), CLASSES + WALLS))
    kinds_1 = np.empty(len(sighting_1.points), np.int64)
    kinds_2 = np.empty(len(sighting_2.points), np.int64)
    for k in range(len(poses)):
        totals = found[k, :CLASSES]
        _look_at(sighting_1, sighting_2, poses[k], tolerance, gap, depth, totals, kinds_1, kinds_2)
        points, lines = _together(sighting_1, sighting_2, kinds_1, kinds_2, walls_1, walls_2, poses[k])
        _take_walls(points, lines, reach, found[k, CLASSES:])
    return found


@_compiled
def _together(sighting_1, sighting_2, kinds_1, kinds_2, walls_1, walls_2, pose):  # type: ignore[no-untyped-def]
    """The supported points of both maps, with half their widths, and the walls of both, in frame 1."""
    cosine = math.cos(pose[2])
    sine = math.sin(pose[2])
    points = np.empty((len(kinds_1) + len(kinds_2), 3))
    count = 0
    for q in range(len(kinds_1)):
        if kinds_1[q] == SUPPORTED:
            points[count] = sighting_1.points[q]
            count += 1
    for q in range(len(kinds_2)):
        if kinds_2[q] == SUPPORTED:
            x, y, points[count, 2] = sighting_2.points[q]
            points[count, 0] = cosine * x - sine * y + pose[0]
            points[count, 1] = sine * x + cosine * y + pose[1]
            count += 1
    points[:count, 2] *= 0.5
    lines = np.empty((len(walls_1) + len(walls_2), 4))
    lines[: len(walls_1)] = walls_1
    for i in range(len(walls_2)):
        for c in (0, 2):
            lines[len(walls_1) + i, c] = cosine * walls_2[i, c] - sine * walls_2[i, c + 1] + pose[0]
            lines[len(walls_1) + i, c + 1] = sine * walls_2[i, c] + cosine * walls_2[i, c + 1] + pose[1]
    return points[:count], lines


@_compiled
def _take_walls(points, lines, reach, left):  # type: ignore[no-untyped-def]
    """Set what is left of the points' widths when the strongest 1, 2, ... lines are taken away."""
    near = np.empty((len(lines), len(points)))
    for i in range(len(lines)):
        ex = lines[i, 2] - lines[i, 0]
        ey = lines[i, 3] - lines[i, 1]
        limit = reach * math.sqrt(ex * ex + ey * ey)
        for q in range(len(points)):
            apart = ex * (points[q, 1] - lines[i, 1]) - ey * (points[q, 0] - lines[i, 0])
            near[i, q] = points[q, 2] if abs(apart) <= limit else 0.0
    remaining = points[:, 2].sum()
    for taken in range(len(left)):
        best = -1
        strongest = 0.0
        for i in range(len(lines)):
            width = near[i].sum()
            if width > strongest:
                strongest = width
                best = i
        if best >= 0:
            remaining -= strongest
            for q in range(len(points)):
                if near[best, q] > 0.0:
                    near[:, q] = 0.0
        left[taken] = max(0.0, remaining)
