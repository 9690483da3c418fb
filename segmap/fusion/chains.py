"""Chains -> fused map (Section III-C, Algorithm 5)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from segmap import _kernels, tracing
from segmap.chains import MatchingChain
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray, Pose2
from segmap.segments import LEAST_LENGTH, Order, SegmentMap, Source

__all__ = ["Fusion", "Polyline", "fuse", "polyline"]

AGAINST = 1.0 / 3.0
"""where a larger share of a chain's length runs against the rest, its polyline has no direction"""


@dataclass(frozen=True, eq=False)
class Polyline:
    """The polyline that replaces a matching chain."""

    vertices: FloatArray
    """shape (k, 2), metres, directed as most of the chain's length is"""
    directed: bool
    insertions: int
    """n of the last P_n (Algorithm 5, line 8)"""
    finished: bool
    """False where the plain variant met its bound: the greedy polyline with spurs was taken instead"""

    @property
    def edges(self) -> FloatArray:
        """Shape (k - 1, 4), metres."""
        return np.concatenate((self.vertices[:-1], self.vertices[1:]), axis=1)


@dataclass(frozen=True, eq=False)
class Fusion:
    """S_1,2: what INTEGRATE makes of two maps, in the frame of map 1."""

    map: SegmentMap
    polylines: tuple[Polyline, ...]
    """one for each chain"""

    @property
    def unfinished(self) -> int:
        """How many polylines met their bound."""
        return sum(not line.finished for line in self.polylines)


def fuse(
    map_1: SegmentMap, map_2: SegmentMap, T_1_2: Pose2, chains: Sequence[MatchingChain], parameters: Parameters
) -> Fusion:
    """Unmatched segments of both maps, then a polyline for each chain (Algorithm 5).

    Unmatched segments stay as they are; each edge of a polyline knows the sources of the segments it
    stands for, and an edge that stands for none is a connector.
    """
    moved_2 = map_2.moved(T_1_2)
    parts = [_unmatched(map_1, [i for c in chains for i in c.first])]  # line 2
    parts += [_unmatched(moved_2, [j for c in chains for j in c.second])]
    polylines = []
    for chain in chains:
        members = SegmentMap.joined([map_1.take(chain.first), moved_2.take(chain.second)])
        polylines.append(polyline(members, parameters))
        parts.append(_as_map(polylines[-1], members, parameters))  # line 12
    fused = replace(SegmentMap.joined(parts), sights=map_1.sights + moved_2.sights)
    tracing.tell("fused", moved_2=moved_2, chains=chains, polylines=polylines, parts=parts, map=fused)
    return Fusion(fused, tuple(polylines))


def _unmatched(segment_map: SegmentMap, matched: list[int]) -> SegmentMap:
    return segment_map.take(np.setdiff1d(np.arange(len(segment_map)), matched))


# --- the polyline of one chain (Algorithm 5, lines 4 to 11) ---------------------------------------


def polyline(members: SegmentMap, parameters: Parameters) -> Polyline:
    """P_0, P_1, ... until every segment of a chain is within ``fusion_tolerance`` of its closest edge.

    ``greedy`` inserts each segment at most once; ``plain`` may insert one again, at most ``fusion_bound``
    times the number of segments in all. Where it meets that bound it goes round in circles; then the greedy
    polyline is taken, with a spur to each segment that is still too far, and reported as unfinished.
    """
    if parameters.fusion_variant == "greedy":
        return _grown(members, parameters, again=False)
    line = _grown(members, parameters, again=True)
    if line.finished:
        return line
    line = _grown(members, parameters, again=False)
    far = closest_edges(members.coordinates, line.vertices)[0] > parameters.fusion_tolerance
    vertices = _with_spurs(line.vertices, members.coordinates[far])
    return replace(line, vertices=vertices, finished=False)


def _with_spurs(vertices: FloatArray, segments: FloatArray) -> FloatArray:
    """The polyline with a detour from the nearest vertex to each of some segments and back; no edge is lost."""
    for segment in segments:
        extremes = segment.reshape(2, 2)
        apart = np.hypot(*(vertices[:, None] - extremes).transpose(2, 0, 1))
        vertex, first = divmod(int(np.argmin(apart)), 2)
        detour = np.stack((extremes[first], extremes[1 - first], vertices[vertex]))
        detour = detour[1:] if apart[vertex, first] <= LEAST_LENGTH else detour
        vertices = np.concatenate((vertices[: vertex + 1], detour, vertices[vertex + 1 :]))
    return vertices


def _grown(members: SegmentMap, parameters: Parameters, again: bool) -> Polyline:
    """The while loop of Algorithm 5, lines 7 to 11."""
    vertices, directed = _first_edge(members)
    segments = members.coordinates
    waiting = np.ones(len(segments), bool)
    bound = len(segments) * (parameters.fusion_bound if again else 1)
    tracing.tell("chain", members=members, again=again)
    squares, edges = _kernels.closest_edges(segments, vertices)
    for insertions in range(bound + 1):
        s = int(np.argmax(np.where(waiting, np.sqrt(squares), -1.0)))
        tracing.tell("polyline", vertices=vertices, squares=squares, edges=edges, waiting=waiting, farthest=s)
        if not waiting[s] or math.sqrt(squares[s]) <= parameters.fusion_tolerance:
            return Polyline(vertices, directed, insertions, finished=True)
        if insertions < bound:
            waiting[s] = again
            edge, before = int(edges[s]), len(vertices)
            vertices = _inserted(vertices, edge, segments[s], parameters.point_distance_tolerance)
            _kernels.closest_edges_again(segments, vertices, squares, edges, edge, len(vertices) - before)
    return Polyline(vertices, directed, bound, finished=False)


def _first_edge(members: SegmentMap) -> tuple[FloatArray, bool]:
    """P_0 between the two farthest extremes, directed as most of the length is; and whether it is directed."""
    extremes = members.coordinates.reshape(-1, 2)
    edge = extremes[list(_kernels.farthest_extremes(extremes))]
    along = (members.coordinates[:, 2:] - members.coordinates[:, :2]) @ (edge[1] - edge[0])
    lengths = members.lengths
    ahead = lengths[members.directed & (along >= 0.0)].sum()
    against = lengths[members.directed & (along < 0.0)].sum()
    either = lengths[~members.directed].sum()
    directed = bool(min(ahead, against) + either / 2.0 <= AGAINST * lengths.sum())
    return (edge if ahead >= against else edge[::-1].copy()), directed


def closest_edges(segments: FloatArray, vertices: FloatArray) -> tuple[FloatArray, IntArray]:
    """For each segment (n, 4), the distance to its closest edge of a polyline (k, 2), and that edge.

    The distance from an edge is the larger of the distances of the two extremes.
    """
    squares, edges = _kernels.closest_edges(segments, vertices)
    return np.sqrt(squares), edges


def _inserted(vertices: FloatArray, edge: int, segment: FloatArray, tolerance: float) -> FloatArray:
    """The polyline with edge (u, v) replaced by u, a, b, v (line 9), near-coinciding vertices dropped."""
    u, v = vertices[edge], vertices[edge + 1]
    a, b = segment[:2], segment[2:]
    if _distance(u, b) + _distance(a, v) < _distance(u, a) + _distance(b, v):
        a, b = b, a
    between: list[FloatArray] = []
    for point in (a, b):
        before = between[-1] if between else u
        if _distance(before, point) >= tolerance and _distance(point, v) >= tolerance:
            between.append(point)
    return np.concatenate((vertices[: edge + 1], np.reshape(between, (-1, 2)), vertices[edge + 1 :]))


def _distance(p: FloatArray, q: FloatArray) -> float:
    return float(np.hypot(p[0] - q[0], p[1] - q[1]))


# --- what of a polyline is wall, and where it comes from ------------------------------------------


def _as_map(line: Polyline, members: SegmentMap, parameters: Parameters) -> SegmentMap:
    """The edges of a polyline as a map (line 12); without stretches that would claim a wall nobody saw."""
    if parameters.max_connector is None:
        return _all_edges(line, members, parameters.fusion_tolerance)
    reach = parameters.segment_distance_threshold * parameters.point_distance_tolerance
    return SegmentMap.joined(
        [_covered(line, members, reach, parameters.max_connector), _left_aside(line, members, reach)]
    )


def _all_edges(line: Polyline, members: SegmentMap, tolerance: float) -> SegmentMap:
    """Every edge; it stands for a segment whose closest edge it is, or that its middle is within the tolerance of."""
    _, closest = closest_edges(members.coordinates, line.vertices)
    owners = _kernels.middles_within(line.edges, members.coordinates, tolerance)
    owners[np.arange(len(members)), closest] = 1
    sources = tuple(_united(members, np.flatnonzero(column)) for column in owners.T)
    return SegmentMap(line.edges, Order.NONE, np.full(len(line.edges), line.directed), sources)


def _covered(line: Polyline, members: SegmentMap, reach: float, longest_gap: float) -> SegmentMap:
    """The stretches of the edges along which segments lie within reach; gaps up to a length are bridged."""
    rows: list[FloatArray] = []
    sources: list[tuple[Source, ...]] = []
    for edge, cover in zip(line.edges, _kernels.covers(line.edges, members.coordinates, reach), strict=True):
        length = _distance(edge[:2], edge[2:])
        along = (edge[2:] - edge[:2]) / max(length, LEAST_LENGTH)
        lying = np.flatnonzero(cover[:, 1] - cover[:, 0] > LEAST_LENGTH)
        for first, last in _bridged(cover[lying], length, longest_gap):
            rows.append(np.concatenate((edge[:2] + first * along, edge[:2] + last * along)))
            within = (cover[lying, 0] <= last) & (cover[lying, 1] >= first)
            sources.append(_united(members, lying[within]))
    coordinates = np.reshape(rows, (-1, 4))
    return SegmentMap(coordinates, Order.NONE, np.full(len(rows), line.directed), tuple(sources))


def _bridged(intervals: FloatArray, length: float, longest_gap: float) -> list[tuple[float, float]]:
    """The union of intervals (n, 2) of an edge, metres from its start, with short gaps and short ends filled."""
    if not len(intervals):
        return [(0.0, length)] if LEAST_LENGTH < length <= longest_gap else []
    spans: list[tuple[float, float]] = []
    for first, last in intervals[np.argsort(intervals[:, 0], kind="stable")].tolist():
        if spans and first - spans[-1][1] <= longest_gap:
            spans[-1] = spans[-1][0], max(spans[-1][1], last)
        else:
            spans.append((first, last))
    if spans[0][0] <= longest_gap:
        spans[0] = 0.0, spans[0][1]
    if length - spans[-1][1] <= longest_gap:
        spans[-1] = spans[-1][0], length
    return spans


def _left_aside(line: Polyline, members: SegmentMap, reach: float) -> SegmentMap:
    """The segments that no stretch of the polyline stands for: they stay as they are."""
    start, end = members.coordinates[:, :2], members.coordinates[:, 2:]
    beyond = np.zeros(len(members), bool)
    for point in (start, (start + end) / 2.0, end):
        beyond |= closest_edges(np.concatenate((point, point), axis=1), line.vertices)[0] > reach
    return members.take(np.flatnonzero(beyond))


def _united(members: SegmentMap, rows: IntArray) -> tuple[Source, ...]:
    return tuple(sorted({source for row in rows for source in members.sources[row]}))
