"""A plain numpy reading of Algorithms 2 and 4, as slow and as literal as it can be.

The twin of the compiled kernels: written from the paper and its reading, on complex numbers, with
nothing of the library in it but the maps and the parameters.
"""

from itertools import pairwise

import numpy as np

from segmap.parameters import Parameters
from segmap.segments import Order, SegmentMap


def wrapped(angle):
    return np.angle(np.exp(1j * np.asarray(angle)))


def extremes(segment_map):
    """Start and end of each segment as complex numbers."""
    x1, y1, x2, y2 = segment_map.coordinates.T
    return x1 + 1j * y1, x2 + 1j * y2


# --- candidate transformations --------------------------------------------------------------------


def pairs_of(segment_map: SegmentMap, heuristic: str, p: Parameters):
    n = len(segment_map)
    start, end = extremes(segment_map)
    lengths = abs(end - start)
    headings = np.angle(end - start)
    if heuristic == "all":
        return [(i, j) for i in range(n) for j in range(i + 1, n)]
    if heuristic == "histogram":
        width = np.pi / p.histogram_slots
        bucket = [int((h % np.pi) / width) % p.histogram_slots for h in headings]
        totals = [sum(lengths[i] for i in range(n) if bucket[i] == b) for b in range(p.histogram_slots)]
        principal = max(range(p.histogram_slots), key=lambda b: (totals[b], -b))
        normal = (principal + p.histogram_slots // 2) % p.histogram_slots
        wanted = {principal, normal}
        return [(i, j) for i in range(n) for j in range(i + 1, n) if {bucket[i], bucket[j]} == wanted]
    long = [i for i in range(n) if lengths[i] >= p.segment_length_percentage / 100 * max(lengths)]
    if p.consecutive_strict or segment_map.order is Order.NONE:
        ends = np.stack((start, end))
        near = [
            (i, j)
            for i in range(n)
            for j in range(i + 1, n)
            if min(abs(a - b) for a in ends[:, i] for b in ends[:, j]) < p.point_distance_tolerance
        ]
        return [(i, j) for i, j in near if i in long and j in long]
    kept = long if p.consecutive_over_short else list(range(n))
    ring = [(kept[-1], kept[0])] if segment_map.order is Order.RING and len(kept) > 2 else []
    return [(i, j) for i, j in [*pairwise(kept), *ring] if i in long and j in long]


def angles_of(segment_map, pairs, p):
    """(pair, heading of the first, heading of the second, vertex) of every usable pair."""
    start, end = extremes(segment_map)
    found = []
    for i, j in pairs:
        turns_i = (0.0,) if segment_map.directed[i] else (0.0, np.pi)
        turns_j = (0.0,) if segment_map.directed[j] else (0.0, np.pi)
        for turn_i in turns_i:
            for turn_j in turns_j:
                along_i, along_j = end[i] - start[i], end[j] - start[j]
                acute = abs(wrapped(2 * (np.angle(along_i) - np.angle(along_j)))) / 2
                if acute <= p.min_vertex_angle:
                    continue
                system = np.array([[along_i.real, -along_j.real], [along_i.imag, -along_j.imag]])
                gap = start[j] - start[i]
                share = np.linalg.solve(system, [gap.real, gap.imag])[0]
                headings = np.angle(along_i) + turn_i, np.angle(along_j) + turn_j
                found.append(((i, j), *headings, start[i] + share * along_i))
    return found


def candidates(map_1, map_2, heuristic, p):
    """Every candidate as a row x, y, theta: Algorithm 2, lines 9 to 14."""
    pairs_1, pairs_2 = pairs_of(map_1, heuristic, p), pairs_of(map_2, heuristic, p)
    if not (map_1.order is Order.BEAMS and map_2.order is Order.BEAMS):
        pairs_2 = pairs_2 + [(j, i) for i, j in pairs_2]
    angles_2 = angles_of(map_2, pairs_2, p)
    if not angles_2:
        return np.empty((0, 3))
    first_2, second_2, vertex_2 = (np.array(column) for column in list(zip(*angles_2, strict=True))[1:])
    rows = []
    for _, first_1, second_1, vertex_1 in angles_of(map_1, pairs_1, p):
        equal = abs(wrapped((second_1 - first_1) - (second_2 - first_2))) < p.angle_difference_tolerance
        d, d_other = wrapped(first_1 - first_2[equal]), wrapped(second_1 - second_2[equal])
        theta = d + wrapped(d_other - d) / 2
        shift = vertex_1 - np.exp(1j * theta) * vertex_2[equal]
        rows.append(np.stack((shift.real, shift.imag, wrapped(theta)), axis=-1))
    return np.concatenate([np.empty((0, 3)), *rows])


# --- value of a transformation --------------------------------------------------------------------


def line_distance(start, end, point):
    unit = (end - start) / abs(end - start)
    return ((point - start) * unit.conjugate()).imag


def meets(a, b):
    """Whether a segment meets a line from which its extremes have these signed distances; touching to 1e-9 m."""
    return (np.sign(a) != np.sign(b)) | (abs(a) <= 1e-9) | (abs(b) <= 1e-9)


def common(start, end, a, b):
    """Length of the part of (start, end) that the projection of (a, b) covers."""
    length = abs(end - start)
    unit = (end - start) / length
    t, u = (((x - start) * unit.conjugate()).real for x in (a, b))
    return np.maximum(0.0, np.minimum(np.maximum(t, u), length) - np.maximum(np.minimum(t, u), 0.0))


def values(map_1, map_2, poses, p, block=64):
    """The value of each pose, NaN where it is discarded: Algorithm 4, lines 2 to 19."""
    parts = [_values(map_1, map_2, poses[k : k + block], p) for k in range(0, len(poses), block)]
    return np.concatenate([np.empty(0), *parts])


def _values(map_1, map_2, poses, p):
    turn, shift = np.exp(1j * poses[:, 2]), poses[:, 0] + 1j * poses[:, 1]
    s1, e1 = (x[None, :, None] for x in extremes(map_1))
    s2, e2 = ((turn[:, None] * x + shift[:, None])[:, None, :] for x in extremes(map_2))
    to_1 = line_distance(s1, e1, s2), line_distance(s1, e1, e2)
    to_2 = line_distance(s2, e2, s1), line_distance(s2, e2, e1)
    both = (common(s1, e1, s2, e2) + common(s2, e2, s1, e1)) / 2
    straddle = meets(*to_1) & meets(*to_2)
    distance = np.minimum(np.maximum(*map(abs, to_1)), np.maximum(*map(abs, to_2)))
    ratio = distance / p.point_distance_tolerance
    matching = np.where(straddle, both, both * p.distance_penalty**ratio)
    matching = np.where(ratio > p.segment_distance_threshold, 0.0, matching)
    result = matching.sum(axis=(1, 2))
    result[_discarded(s1, e1, s2, e2, to_1, straddle, p)] = np.nan
    return result


def _discarded(s1, e1, s2, e2, to_1, straddle, p):
    """Line 6, as it is read: the meeting point coincides with no extreme, and the lines differ enough."""
    long = (abs(e1 - s1) > p.segment_length_refuse) & (abs(e2 - s2) > p.segment_length_refuse)
    acute = abs(wrapped(2 * (np.angle(e1 - s1) - np.angle(e2 - s2)))) / 2
    with np.errstate(invalid="ignore", divide="ignore"):
        point = s2 + (e2 - s2) * to_1[0] / (to_1[0] - to_1[1])
        clear = np.minimum.reduce([abs(point - x) for x in np.broadcast_arrays(s1, e1, s2, e2)])
        crossing = straddle & (acute > max(p.refuse_angle, 1e-9)) & (clear > p.point_distance_tolerance)
    return (long & crossing).any(axis=(1, 2))
