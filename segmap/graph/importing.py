"""Pose graphs of other programs as edges between scans."""

from __future__ import annotations

from collections.abc import Mapping

from segmap.graph.edges import Edge
from segmap.logs.pose_graphs import PoseGraphFile
from segmap.scans import ScanId

__all__ = ["imported_edges"]


def imported_edges(
    graph: PoseGraphFile, scans: Mapping[int, ScanId], *, loops: bool | None = None, trust_neighbours: bool = False
) -> tuple[Edge, ...]:
    """The edges of a graph between scans, which :meth:`PoseGraphFile.scans` gives for its vertices, in file order.

    Edges at vertices that stand for no scan are left out. ``loops`` chooses loop closures, or what is none;
    ``trust_neighbours`` makes what is no loop closure trusted.
    """
    return tuple(
        Edge(
            scans[edge.first],
            scans[edge.second],
            edge.T_1_2,
            edge.covariance,
            trusted=trust_neighbours and not edge.loop,
            source="imported",
        )
        for edge in graph.edges
        if edge.first in scans and edge.second in scans and loops in (None, edge.loop)
    )
