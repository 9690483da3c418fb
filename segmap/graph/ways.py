"""The surest way between two scans along edges, and by how much a loop misses itself."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from segmap.graph.arrays import adjoints
from segmap.graph.edges import Edge
from segmap.graph.start import uncertainty
from segmap.pose import FloatArray, Pose2
from segmap.scans import ScanId

__all__ = ["Loop", "Ways", "loop_of"]


@dataclass(frozen=True)
class Loop:
    """An edge closed to a loop by the surest way that other edges give."""

    edge: Edge
    scans: tuple[ScanId, ...]
    """round the loop, from the edge's first scan to its second"""
    translation: float
    """metres; how far the edge misses where the way leads"""
    rotation: float
    """radians, in [0, pi]"""
    chi: float
    """Mahalanobis distance of the miss, with the covariances of all edges of the loop"""


class Ways:
    """Edges as a net of ways."""

    def __init__(self, edges: Iterable[Edge]) -> None:
        self._links: dict[ScanId, list[tuple[float, ScanId, Edge, bool]]] = {}
        for edge in edges:
            cost = uncertainty(edge)
            self._links.setdefault(edge.first, []).append((cost, edge.second, edge, True))
            self._links.setdefault(edge.second, []).append((cost, edge.first, edge, False))

    def between(self, start: ScanId, end: ScanId, without: Edge | None = None) -> tuple[Edge, ...] | None:
        """The edges of the surest way, each told from its first scan on the way; None where none leads there.

        ``without`` is an edge (this very object, not one like it) that is not taken.
        """
        came: dict[ScanId, tuple[ScanId, Edge, bool]] = {}
        costs, waiting, done = {start: 0.0}, [(0.0, start)], set()
        while waiting:
            cost, here = heapq.heappop(waiting)
            if here == end:
                return self._back(came, start, end)
            if here in done:
                continue
            done.add(here)
            for more, there, edge, forward in self._links.get(here, ()):
                if edge is not without and cost + more < costs.get(there, math.inf):
                    costs[there], came[there] = cost + more, (here, edge, forward)
                    heapq.heappush(waiting, (cost + more, there))
        return None

    @staticmethod
    def _back(came: dict[ScanId, tuple[ScanId, Edge, bool]], start: ScanId, end: ScanId) -> tuple[Edge, ...]:
        way: list[Edge] = []
        while end != start:
            end, edge, forward = came[end]
            way.append(edge if forward else edge.reversed())
        return tuple(reversed(way))


def loop_of(edge: Edge, ways: Ways) -> Loop | None:
    """The loop an edge closes; None where nothing but the edge joins its scans.

    The net may hold the edge itself, it is not taken.
    """
    way = ways.between(edge.first, edge.second, without=edge)
    if way is None:
        return None
    T_1_2, covariance = _composed(way)
    miss = T_1_2.inverse() @ edge.T_1_2
    own = _in_second(edge)
    left = np.array(tuple(miss))
    chi = math.sqrt(float(left @ np.linalg.solve(covariance + own, left)))
    scans = (edge.first, *(step.second for step in way))
    return Loop(edge, scans, math.hypot(miss.x, miss.y), abs(miss.theta), chi)


def _composed(way: tuple[Edge, ...]) -> tuple[Pose2, FloatArray]:
    """The pose at the end of a way and the covariance (3, 3) of a small motion there, in its own frame."""
    pose, covariance = Pose2.identity(), np.zeros((3, 3))
    for edge in way:
        back = adjoints(np.array([tuple(edge.T_1_2.inverse())]))[0]
        covariance = back @ covariance @ back.T + _in_second(edge)
        pose = pose @ edge.T_1_2
    return pose, covariance


def _in_second(edge: Edge) -> FloatArray:
    """The covariance of an edge as one of a small motion in its frame 2."""
    turn = np.eye(3)
    turn[:2, :2] = _rotation(-edge.T_1_2.theta)
    return turn @ np.array(edge.covariance) @ turn.T


def _rotation(theta: float) -> FloatArray:
    return np.array([[math.cos(theta), -math.sin(theta)], [math.sin(theta), math.cos(theta)]])
