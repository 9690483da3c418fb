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

__all__ = ["closest_edges", "covers", "directions", "equal_angles", "first_of_each", "superimpose"]

TOUCH = 1e-9
"""metres; a segment whose extreme is this near to a line touches it, whatever the rounding"""

AHEAD = 64
"""poses whose places in a table are looked up at a time"""

_compiled = njit(cache=True, nogil=True, error_model="numpy")
_inlined = njit(cache=True, nogil=True, error_model="numpy", inline="always")


@_inlined
def _wrap(angle):  # type: ignore[no-untyped-def]
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


# --- candidate transformations (Algorithm 2, lines 9 to 14) --------------------------------------


@_compiled
def _are_equal(phi, others, tolerance, equal):  # type: ignore[no-untyped-def]
    """Note which of the others equal an angle; returns how many."""
    for b in range(len(others)):
        equal[b] = abs(_wrap(phi - others[b])) < tolerance
    return equal.sum()


@_compiled
def _which(flags, rows):  # type: ignore[no-untyped-def]
    """The indices of what is set, at the start of ``rows``, which has one place more than the flags."""
    found = 0
    for b in range(len(flags)):
        rows[found] = b
        found += flags[b]
    return found


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
    equal = np.empty(len(phi_2), np.uint8)
    count = 0
    for a in range(len(phi_1)):
        count += _are_equal(phi_1[a], phi_2, tolerance, equal)
    rows = np.empty(len(phi_2) + 1, np.int64)
    poses = np.empty((count, 3))
    angle_1 = np.empty(count, np.int64)
    angle_2 = np.empty(count, np.int64)
    k = 0
    for a in range(len(phi_1)):
        _are_equal(phi_1[a], phi_2, tolerance, equal)
        for b in rows[: _which(equal, rows)]:
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


@_inlined
def _mixed(x, y, z):  # type: ignore[no-untyped-def]
    """One number of three, well mixed, not negative."""
    mixed = x * 0x1E3779B97F4A7C15 ^ y * 0x42B2AE3D27D4EB4F ^ z * 0x165667B19E3779F9
    mixed = (mixed ^ (mixed >> 29)) * 0x3F58476D1CE4E5B9
    return (mixed ^ (mixed >> 32)) & 0x3FFFFFFFFFFFFFFF


@_inlined
def _slot_of(x, y, z, mixed, keys, table):  # type: ignore[no-untyped-def]
    """The slot of a table that holds a key, or is free for it; see :func:`first_of_each`."""
    slot = mixed & (len(table) - 1)
    while table[slot] >= 0:
        if (table[slot] ^ mixed) >> 32 == 0:
            held = table[slot] & 0xFFFFFFFF
            if keys[held, 0] == x and keys[held, 1] == y and keys[held, 2] == z:
                break
        slot = (slot + 1) & (len(table) - 1)
    return slot


@_compiled
def first_of_each(poses: FloatArray, resolution: float, keys: IntArray, filled: int, table: IntArray) -> IntArray:
    """The rows of ``poses`` (k, 3) that to a resolution are not among the first ``filled`` keys, first ones only.

    Their keys are appended to ``keys`` (m, 3), which has room for all. ``table`` (slots,), a power of two and
    more than twice the keys, remembers between calls where each key is: its row, and above it part of its mixed
    number; negative: free.
    """
    rows = np.empty(len(poses), np.int64)
    mixed = np.empty(AHEAD, np.int64)
    looked = np.empty(AHEAD, np.int64)
    some = np.empty((AHEAD, 3), np.int64)
    count = 0
    for first in range(0, len(poses), AHEAD):
        ahead = min(AHEAD, len(poses) - first)
        for q in range(ahead):
            for c in range(3):
                some[q, c] = np.int64(np.rint(poses[first + q, c] / resolution))
            mixed[q] = _mixed(some[q, 0], some[q, 1], some[q, 2])
        for q in range(ahead):
            looked[q] = table[mixed[q] & (len(table) - 1)]  # memory accesses that do not wait for each other
        for q in range(ahead):
            slot = mixed[q] & (len(table) - 1)
            if looked[q] >= 0 or table[slot] >= 0:
                slot = _slot_of(some[q, 0], some[q, 1], some[q, 2], mixed[q], keys, table)
            if table[slot] < 0:
                table[slot] = (mixed[q] >> 32 << 32) | (filled + count)
                for c in range(3):
                    keys[filled + count, c] = some[q, c]
                rows[count] = first + q
                count += 1
    return rows[:count]


@_compiled
def place_keys(keys: IntArray, table: IntArray) -> None:
    """Fill an empty table for keys (m, 3), all different; see :func:`first_of_each`."""
    for k in range(len(keys)):
        mixed = _mixed(keys[k, 0], keys[k, 1], keys[k, 2])
        slot = _slot_of(keys[k, 0], keys[k, 1], keys[k, 2], mixed, keys, table)
        table[slot] = (mixed >> 32 << 32) | k


# --- segments ---------------------------------------------------------------------------------------


@_compiled
def directions(segments):  # type: ignore[no-untyped-def]
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


@_inlined
def _squared_from_edge(segments, i, vertices, k):  # type: ignore[no-untyped-def]
    """Squared distance of a segment from an edge of a polyline: the larger of those of its extremes."""
    x1, y1, x2, y2 = vertices[k, 0], vertices[k, 1], vertices[k + 1, 0], vertices[k + 1, 1]
    start = _squared_distance(segments[i, 0], segments[i, 1], x1, y1, x2, y2)
    return max(start, _squared_distance(segments[i, 2], segments[i, 3], x1, y1, x2, y2))


@_inlined
def _closest_edge(segments, i, vertices):  # type: ignore[no-untyped-def]
    """The edge of a polyline closest to a segment, the first of equals, and the squared distance."""
    nearest = np.inf
    edge = 0
    for k in range(len(vertices) - 1):
        squared = _squared_from_edge(segments, i, vertices, k)
        if squared < nearest:
            nearest = squared
            edge = k
    return edge, nearest


@_compiled
def closest_edges(segments: FloatArray, vertices: FloatArray) -> tuple[FloatArray, IntArray]:
    """For each segment (n, 4), the squared distance to its closest edge of a polyline (k, 2), and that edge."""
    squares = np.empty(len(segments))
    edges = np.empty(len(segments), np.int64)
    for i in range(len(segments)):
        edges[i], squares[i] = _closest_edge(segments, i, vertices)
    return squares, edges


@_compiled
def closest_edges_again(
    segments: FloatArray, vertices: FloatArray, squares: FloatArray, edges: IntArray, edge: int, added: int
) -> None:
    """Bring what :func:`closest_edges` gave up to date, after an edge was replaced by itself and some ``added`` ones.

    Only the segments that edge was closest to are compared with all edges.
    """
    for i in range(len(segments)):
        if edges[i] == edge:
            edges[i], squares[i] = _closest_edge(segments, i, vertices)
            continue
        if edges[i] > edge:
            edges[i] += added
        for k in range(edge, edge + added + 1):
            squared = _squared_from_edge(segments, i, vertices, k)
            if squared < squares[i] or (squared == squares[i] and k < edges[i]):
                squares[i] = squared
                edges[i] = k


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
    axes = directions(edges)
    for k in range(len(edges)):
        ux, uy, length = axes[k, 0], axes[k, 1], axes[k, 2]
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
