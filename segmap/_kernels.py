"""The inner loops, compiled by numba.

Each public function has a plain numpy twin in the tests. All are serial, deterministic and release
the interpreter lock; callers spread work over threads by blocks of candidates. Segments are rows
(x1, y1, x2, y2), poses rows (x, y, theta). Nothing here checks its arguments.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from segmap.pose import FloatArray, IntArray

__all__ = ["closest_edges", "covers", "equal_angles", "evaluate", "first_of_each", "matching_pairs", "superimpose"]

TOUCH = 1e-9
"""metres; a segment whose extreme is this near to a line touches it, whatever the rounding"""

_compiled = njit(cache=True, nogil=True, error_model="numpy")
_inlined = njit(cache=True, nogil=True, error_model="numpy", inline="always")


@_inlined
def _wrap(angle):  # type: ignore[no-untyped-def]
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


# --- candidate transformations (Algorithm 2, lines 9 to 14) --------------------------------------


@_compiled
def _count_equal(phi_1, phi_2, tolerance):  # type: ignore[no-untyped-def]
    count = 0
    for a in range(len(phi_1)):
        for b in range(len(phi_2)):
            count += abs(_wrap(phi_1[a] - phi_2[b])) < tolerance
    return count


@_compiled
def equal_angles(
    phi_1: FloatArray,
    headings_1: FloatArray,
    vertices_1: FloatArray,
    phi_2: FloatArray,
    headings_2: FloatArray,
    vertices_2: FloatArray,
    tolerance: float,
) -> tuple[FloatArray, IntArray, IntArray]:
    """All pairs of equal angles in lexicographic order, and the pose that superimposes each.

    ``phi`` (n,), ``headings`` (n, 2) and ``vertices`` (n, 2) describe the angles of a map. Returns
    poses ``T_1_2`` (k, 3) and the two angles' indices, (k,) each.
    """
    count = _count_equal(phi_1, phi_2, tolerance)
    poses = np.empty((count, 3))
    angle_1 = np.empty(count, np.int64)
    angle_2 = np.empty(count, np.int64)
    k = 0
    for a in range(len(phi_1)):
        for b in range(len(phi_2)):
            if abs(_wrap(phi_1[a] - phi_2[b])) < tolerance:
                _superimpose(headings_1[a], vertices_1[a], headings_2[b], vertices_2[b], poses[k])
                angle_1[k] = a
                angle_2[k] = b
                k += 1
    return poses, angle_1, angle_2


@_compiled
def superimpose(headings_1, vertices_1, headings_2, vertices_2):  # type: ignore[no-untyped-def]
    """The pose for each row of two equally long lists of angles; see :func:`equal_angles`."""
    poses = np.empty((len(headings_1), 3))
    for k in range(len(headings_1)):
        _superimpose(headings_1[k], vertices_1[k], headings_2[k], vertices_2[k], poses[k])
    return poses


@_compiled
def _superimpose(headings_1, vertex_1, headings_2, vertex_2, pose):  # type: ignore[no-untyped-def]
    """Vertex onto vertex, and the mean of the two heading differences."""
    turn = _wrap(headings_1[0] - headings_2[0])
    other = _wrap(headings_1[1] - headings_2[1])
    theta = _wrap(turn + 0.5 * _wrap(other - turn))
    cosine = math.cos(theta)
    sine = math.sin(theta)
    pose[0] = vertex_1[0] - cosine * vertex_2[0] + sine * vertex_2[1]
    pose[1] = vertex_1[1] - sine * vertex_2[0] - cosine * vertex_2[1]
    pose[2] = theta


@_compiled
def first_of_each(keys: IntArray, table: IntArray, filled: int) -> tuple[IntArray, int]:
    """The rows of ``keys`` (k, 3) not seen before, first occurrences only.

    ``table`` (slots, 3), slots a power of two and more than twice the keys, is an open-addressing
    hash set that remembers between calls; a row of least integers is a free slot.
    """
    fresh = np.empty(len(keys), np.int64)
    count = 0
    mask = len(table) - 1
    free = np.iinfo(np.int64).min
    for k in range(len(keys)):
        slot = (keys[k, 0] * 73856093 ^ keys[k, 1] * 19349663 ^ keys[k, 2] * 83492791) & mask
        while table[slot, 0] != free and not (
            table[slot, 0] == keys[k, 0] and table[slot, 1] == keys[k, 1] and table[slot, 2] == keys[k, 2]
        ):
            slot = (slot + 1) & mask
        if table[slot, 0] == free:
            table[slot] = keys[k]
            fresh[count] = k
            count += 1
    return fresh[:count], filled + count


# --- value of a transformation (Algorithm 4, lines 5 to 19) --------------------------------------


@_compiled
def _directions(segments):  # type: ignore[no-untyped-def]
    """Unit vectors and lengths, (n, 3)."""
    result = np.empty((len(segments), 3))
    for i in range(len(segments)):
        dx = segments[i, 2] - segments[i, 0]
        dy = segments[i, 3] - segments[i, 1]
        length = math.sqrt(dx * dx + dy * dy)
        result[i, 0] = dx / length
        result[i, 1] = dy / length
        result[i, 2] = length
    return result


@_compiled
def _move(segments, directions, pose, moved, turned):  # type: ignore[no-untyped-def]
    cosine = math.cos(pose[2])
    sine = math.sin(pose[2])
    for j in range(len(segments)):
        for k in (0, 2):
            moved[j, k] = cosine * segments[j, k] - sine * segments[j, k + 1] + pose[0]
            moved[j, k + 1] = sine * segments[j, k] + cosine * segments[j, k + 1] + pose[1]
        turned[j, 0] = cosine * directions[j, 0] - sine * directions[j, 1]
        turned[j, 1] = sine * directions[j, 0] + cosine * directions[j, 1]
        turned[j, 2] = directions[j, 2]


@_inlined
def _common_length(t, u, length):  # type: ignore[no-untyped-def]
    """Length of [0, length] within the interval between t and u."""
    return max(0.0, min(max(t, u), length) - max(min(t, u), 0.0))


@_inlined
def _meets(start, end):  # type: ignore[no-untyped-def]
    """Whether a segment with these signed distances from a line meets it, touching included."""
    return min(start, end) <= TOUCH and max(start, end) >= -TOUCH


@_inlined
def _matching_value(s1, d1, s2, d2, limit, rate):  # type: ignore[no-untyped-def]
    """Matching value of two segments (lines 9 to 17); ``rate`` is log(penalty) / tolerance."""
    cx = s2[0] - s1[0]
    cy = s2[1] - s1[1]
    dx = s2[2] - s1[0]
    dy = s2[3] - s1[1]
    start_2 = d1[0] * cy - d1[1] * cx  # signed distances of the extremes of s2 from the line of s1
    end_2 = d1[0] * dy - d1[1] * dx
    far_2 = max(abs(start_2), abs(end_2))
    bx = s2[0] - s1[2]
    by = s2[1] - s1[3]
    start_1 = d2[1] * cx - d2[0] * cy  # and of those of s1 from the line of s2
    end_1 = d2[1] * bx - d2[0] * by
    distance = min(far_2, max(abs(start_1), abs(end_1)))
    if distance > limit:
        return 0.0
    l1 = _common_length(d1[0] * cx + d1[1] * cy, d1[0] * dx + d1[1] * dy, d1[2])
    l2 = _common_length(-(d2[0] * cx + d2[1] * cy), -(d2[0] * bx + d2[1] * by), d2[2])
    value = 0.5 * (l1 + l2)
    if value > 0.0 and not (_meets(start_2, end_2) and _meets(start_1, end_1)):
        value *= math.exp(rate * distance)
    return value


@_inlined
def _crosses(s1, d1, s2, d2, tolerance, sine_refuse):  # type: ignore[no-untyped-def]
    """Whether two segments meet inside both, farther than ``tolerance`` from all four extremes."""
    if abs(d1[0] * d2[1] - d1[1] * d2[0]) <= sine_refuse:
        return False
    start_2 = d1[0] * (s2[1] - s1[1]) - d1[1] * (s2[0] - s1[0])
    end_2 = d1[0] * (s2[3] - s1[1]) - d1[1] * (s2[2] - s1[0])
    start_1 = d2[0] * (s1[1] - s2[1]) - d2[1] * (s1[0] - s2[0])
    end_1 = d2[0] * (s1[3] - s2[1]) - d2[1] * (s1[2] - s2[0])
    if not (_meets(start_2, end_2) and _meets(start_1, end_1)):
        return False
    along_2 = d2[2] * start_2 / (start_2 - end_2)
    along_1 = d1[2] * start_1 / (start_1 - end_1)
    return min(min(along_1, d1[2] - along_1), min(along_2, d2[2] - along_2)) > tolerance


@_compiled
def _contradicts(s1, d1, long_1, s2, d2, long_2, tolerance, sine_refuse):  # type: ignore[no-untyped-def]
    for i in long_1:
        for j in long_2:
            if _crosses(s1[i], d1[i], s2[j], d2[j], tolerance, sine_refuse):
                return True
    return False


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
    directions_1 = _directions(segments_1)
    directions_2 = _directions(segments_2)
    long_1 = np.flatnonzero(directions_1[:, 2] > refuse_length)
    long_2 = np.flatnonzero(directions_2[:, 2] > refuse_length)
    moved = np.empty_like(segments_2)
    turned = np.empty_like(directions_2)
    limit = threshold * tolerance
    rate = math.log(penalty) / tolerance
    sine_refuse = max(math.sin(refuse_angle), TOUCH)
    for k in range(len(poses)):
        _move(segments_2, directions_2, poses[k], moved, turned)
        if _contradicts(segments_1, directions_1, long_1, moved, turned, long_2, tolerance, sine_refuse):
            values[k] = np.nan
            continue
        value = 0.0
        for i in range(len(segments_1)):
            for j in range(len(moved)):
                value += _matching_value(segments_1[i], directions_1[i], moved[j], turned[j], limit, rate)
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
    directions_1 = _directions(segments_1)
    directions_2 = _directions(segments_2)
    moved = np.empty_like(segments_2)
    turned = np.empty_like(directions_2)
    _move(segments_2, directions_2, pose, moved, turned)
    limit = threshold * tolerance
    rate = math.log(penalty) / tolerance
    pairs = []
    values = []
    for i in range(len(segments_1)):
        for j in range(len(moved)):
            value = _matching_value(segments_1[i], directions_1[i], moved[j], turned[j], limit, rate)
            if value > least:
                pairs.append((i, j))
                values.append(value)
    indices = np.empty((len(pairs), 2), np.int64)
    for k in range(len(pairs)):
        indices[k, 0] = pairs[k][0]
        indices[k, 1] = pairs[k][1]
    return indices, np.array(values)


# --- fusion (Algorithm 5) -------------------------------------------------------------------------


@_inlined
def _squared_distance(x, y, x1, y1, x2, y2):  # type: ignore[no-untyped-def]
    """Squared distance of a point from a segment, which may be a point."""
    ex = x2 - x1
    ey = y2 - y1
    squared = ex * ex + ey * ey
    share = 0.0 if squared == 0.0 else min(1.0, max(0.0, ((x - x1) * ex + (y - y1) * ey) / squared))
    dx = x - x1 - share * ex
    dy = y - y1 - share * ey
    return dx * dx + dy * dy


@_compiled
def closest_edges(segments: FloatArray, vertices: FloatArray) -> tuple[FloatArray, IntArray]:
    """For each segment (n, 4), the distance to its closest edge of a polyline (k, 2), and that edge, (n,) each."""
    distances = np.empty(len(segments))
    edges = np.empty(len(segments), np.int64)
    for i in range(len(segments)):
        nearest = np.inf
        for k in range(len(vertices) - 1):
            x1, y1, x2, y2 = vertices[k, 0], vertices[k, 1], vertices[k + 1, 0], vertices[k + 1, 1]
            start = _squared_distance(segments[i, 0], segments[i, 1], x1, y1, x2, y2)
            end = _squared_distance(segments[i, 2], segments[i, 3], x1, y1, x2, y2)
            if max(start, end) < nearest:
                nearest = max(start, end)
                edges[i] = k
        distances[i] = math.sqrt(nearest)
    return distances, edges


@_compiled
def middles_within(edges: FloatArray, segments: FloatArray, tolerance: float) -> IntArray:
    """Whether the middle of each edge (k, 4) is within a tolerance of each segment (n, 4), as (n, k) of 0 and 1."""
    near = np.zeros((len(segments), len(edges)), np.int64)
    for k in range(len(edges)):
        x = 0.5 * (edges[k, 0] + edges[k, 2])
        y = 0.5 * (edges[k, 1] + edges[k, 3])
        for i in range(len(segments)):
            x1, y1, x2, y2 = segments[i, 0], segments[i, 1], segments[i, 2], segments[i, 3]
            near[i, k] = _squared_distance(x, y, x1, y1, x2, y2) <= tolerance * tolerance
    return near


@_compiled
def covers(edges: FloatArray, segments: FloatArray, reach: float) -> FloatArray:
    """For each edge (k, 4) and segment (n, 4), the stretch of the edge along which the segment lies within reach.

    Returns (k, n, 2): from and to, metres from the start of the edge, within it; equal where there is none.
    """
    result = np.zeros((len(edges), len(segments), 2))
    directions = _directions(edges)
    for k in range(len(edges)):
        ux, uy, length = directions[k, 0], directions[k, 1], directions[k, 2]
        for i in range(len(segments)):
            ax = segments[i, 0] - edges[k, 0]
            ay = segments[i, 1] - edges[k, 1]
            bx = segments[i, 2] - edges[k, 0]
            by = segments[i, 3] - edges[k, 1]
            side_a = ux * ay - uy * ax
            side_b = ux * by - uy * bx
            if min(side_a, side_b) > reach or max(side_a, side_b) < -reach:
                continue
            first, last = 0.0, 1.0  # shares of the segment between which it is within reach of the edge's line
            if abs(side_b - side_a) > 1e-12:
                p = (-reach - side_a) / (side_b - side_a)
                q = (reach - side_a) / (side_b - side_a)
                first = max(0.0, min(p, q))
                last = min(1.0, max(p, q))
            along_a = ux * ax + uy * ay
            along_b = ux * bx + uy * by
            s = along_a + first * (along_b - along_a)
            t = along_a + last * (along_b - along_a)
            begin = max(0.0, min(s, t))
            end = min(length, max(s, t))
            if end > begin:
                result[k, i, 0] = begin
                result[k, i, 1] = end
    return result


@_compiled
def farthest_extremes(points: FloatArray) -> tuple[int, int]:
    """The two of some points (n, 2) that are farthest apart; the first such pair where several are."""
    first = 0
    second = 0
    farthest = -1.0
    for i in range(len(points)):
        for j in range(i + 1, len(points)):
            dx = points[i, 0] - points[j, 0]
            dy = points[i, 1] - points[j, 1]
            if dx * dx + dy * dy > farthest:
                farthest = dx * dx + dy * dy
                first = i
                second = j
    return first, second


@_compiled
def nearest_segments(points: FloatArray, coordinates: FloatArray) -> tuple[IntArray, FloatArray]:
    """The segment (of rows x1, y1, x2, y2) nearest to each point (m, 2), and how far it is, metres."""
    nearest = np.zeros(len(points), np.int64)
    distances = np.full(len(points), np.inf)
    for k in range(len(points)):
        for i in range(len(coordinates)):
            ex = coordinates[i, 2] - coordinates[i, 0]
            ey = coordinates[i, 3] - coordinates[i, 1]
            dx = points[k, 0] - coordinates[i, 0]
            dy = points[k, 1] - coordinates[i, 1]
            share = min(1.0, max(0.0, (dx * ex + dy * ey) / (ex * ex + ey * ey)))
            apart = math.sqrt((dx - share * ex) ** 2 + (dy - share * ey) ** 2)
            if apart < distances[k]:
                nearest[k] = i
                distances[k] = apart
    return nearest, distances
