"""Pose graphs of other programs as edges between scans."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from segmap.graph.edges import Edge, as_covariance
from segmap.logs.pose_graphs import PoseGraphFile
from segmap.scans import ScanId

__all__ = ["imported_edges"]


def imported_edges(
    graph: PoseGraphFile,
    scans: Mapping[int, ScanId],
    *,
    loops: bool | None = None,
    trust_neighbours: bool = False,
    scale: float = 1.0,
) -> tuple[Edge, ...]:
    """The edges of a graph between scans, which :meth:`PoseGraphFile.scans` gives for its vertices, in file order.

    Edges at vertices that stand for no scan are left out. ``loops`` chooses loop closures, or what is none;
    ``trust_neighbours`` makes what is no loop closure trusted; ``scale`` multiplies the covariances, which many
    programs write by rule of thumb: :attr:`Optimised.variance_factor` tells by how much.
    """
    return tuple(
        Edge(
            scans[edge.first],
            scans[edge.second],
            edge.T_1_2,
            as_covariance(np.array(edge.covariance) * scale),
            trusted=trust_neighbours and not edge.loop,
            source="imported",
        )
        for edge in graph.edges
        if edge.first in scans and edge.second in scans and loops in (None, edge.loop)
    )
