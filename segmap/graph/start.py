"""Where poses begin: composed along the edges that can be relied on most."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from segmap.graph.edges import Edge, Parts
from segmap.pose import FloatArray, Pose2
from segmap.scans import ScanId

__all__ = ["along_logs", "composed_along", "first_poses", "steps_between", "tree", "uncertainty"]

ARM = 5.0
"""metres; how far from a scan an error of its heading is felt"""


def uncertainty(edge: Edge) -> float:
    """Variance of what an edge places, at the end of an arm, square metres."""
    return edge.covariance[0][0] + edge.covariance[1][1] + ARM**2 * edge.covariance[2][2]


def along_logs(edge: Edge) -> tuple[float, float]:
    """How little an edge can be relied on whatever it says of itself: scans near each other in a log seldom mislead.

    Between logs, and among edges as far apart, the surest can be relied on most.
    """
    return steps_between(edge), uncertainty(edge)


def steps_between(edge: Edge) -> float:
    """How many scans apart in their log the scans of an edge were taken; infinite for scans of different logs."""
    return abs(edge.second.scan - edge.first.scan) if edge.first.log == edge.second.log else math.inf


def first_poses(
    scans: Sequence[ScanId],
    edges: Sequence[Edge],
    initial: Mapping[ScanId, Pose2] | None = None,
    doubt: Callable[[Edge], Any] = uncertainty,
) -> FloatArray:
    """Poses (n, 3) of the scans of one component in the frame of the first.

    ``initial`` poses are taken; what lacks one is composed along a spanning tree: trusted edges first, then
    those of the least ``doubt``, as a rule the surest.
    """
    return composed_along(scans, tree(scans, edges, initial or {}, doubt), initial)


def composed_along(
    scans: Sequence[ScanId], edges: Iterable[Edge], initial: Mapping[ScanId, Pose2] | None = None
) -> FloatArray:
    """Poses (n, 3) of the scans of one component in the frame of the first, along the edges of a tree."""
    initial = initial or {}
    places = {scan: place for place, scan in enumerate(scans)}
    links: list[list[tuple[int, Pose2]]] = [[] for _ in scans]
    for edge in edges:
        a, b = places[edge.first], places[edge.second]
        links[a].append((b, edge.T_1_2))
        links[b].append((a, edge.T_1_2.inverse()))
    held = {places[scan]: pose for scan, pose in initial.items() if scan in places}
    poses = _spread(links, held or {0: Pose2.identity()})
    return _in_first_frame(np.array([tuple(poses[place]) for place in range(len(scans))]))


def tree(
    scans: Sequence[ScanId], edges: Sequence[Edge], initial: Mapping[ScanId, Pose2], doubt: Callable[[Edge], Any]
) -> list[Edge]:
    """Edges that reach every scan from those with initial poses, without a loop; those of the least doubt."""
    places = {scan: place for place, scan in enumerate(scans)}
    parts = Parts(len(places))
    held = [places[scan] for scan in initial if scan in places]
    for place in held[1:]:
        parts.join(held[0], place)
    ordered = sorted(edges, key=lambda edge: (not edge.trusted, doubt(edge)))
    return [edge for edge in ordered if parts.join(places[edge.first], places[edge.second])]


def _spread(links: Sequence[Sequence[tuple[int, Pose2]]], held: Mapping[int, Pose2]) -> dict[int, Pose2]:
    poses, waiting = dict(held), deque(sorted(held))
    while waiting:
        here = waiting.popleft()
        for there, T_here_there in links[here]:
            if there not in poses:
                poses[there] = poses[here] @ T_here_there
                waiting.append(there)
    return poses


def _in_first_frame(poses: FloatArray) -> FloatArray:
    first = Pose2(*poses[0]).inverse()
    places = first @ poses[:, :2]
    return np.column_stack((places, (poses[:, 2] + first.theta + np.pi) % (2.0 * np.pi) - np.pi))
