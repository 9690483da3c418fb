"""Pose graphs of other programs -> proposed pairs, each with the pose the file claims."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from app.creation import Source
from app.errors import RequestError
from app.pairs import are_neighbours
from segmap.errors import LogError
from segmap.events import Covariance, IntegrationId, Proposal
from segmap.graph import Edge
from segmap.logs import base_name
from segmap.logs.pose_graphs import GraphEdge, PoseGraphFile, read_pose_graph
from segmap.scans import LaserLog, ScanId

__all__ = ["Imported", "proposals_of"]

PROBLEMS = 20
"""told at most"""


@dataclass(frozen=True)
class Imported:
    """What a pose graph proposes."""

    proposals: tuple[Proposal, ...]
    edges: int
    """in the file"""
    loops: int
    """of them, closures"""
    problems: tuple[str, ...]


def proposals_of(source: Source, logs: Iterable[LaserLog]) -> Imported:
    """The loop edges of a pose graph whose vertices are scans of the logs.

    Raises:
        LogError: it holds no pose graph, or nothing tells which scans its vertices stand for.
        RequestError: it has no loop edge between scans of the logs.
    """
    source.file.seek(0)
    graph = read_pose_graph(source.file, base_name(source.name))
    scans = _scans(graph, list(logs))
    loops = [edge for edge in graph.edges if edge.loop]
    best: dict[str, Edge] = {}
    for edge in loops:
        found = _between(edge, scans)
        if found is not None and (found.name not in best or _size(found) < _size(best[found.name])):
            best[found.name] = found
    if not best:
        raise RequestError(
            f"{graph.name} holds {len(graph.edges)} edges, {len(loops)} of them loop closures, and none of these joins"
            " two scans of this project that are not neighbours. Take the pose graph that was made from its log."
        )
    proposals = tuple(_proposal(best[name], graph.name) for name in sorted(best, key=IntegrationId.parse))
    problems = tuple(f"{graph.name}, {problem}" for problem in graph.problems[:PROBLEMS])
    return Imported(proposals, len(graph.edges), len(loops), problems)


def _scans(graph: PoseGraphFile, logs: list[LaserLog]) -> Mapping[int, ScanId]:
    """The scans that vertices stand for, of the log that most of them do."""
    found: list[Mapping[int, ScanId]] = []
    trouble: LogError | None = None
    for number, log in enumerate(logs):
        try:
            found.append(graph.scans(log, number))
        except LogError as error:
            trouble = trouble or error
    if not found:
        raise trouble or LogError(f"{graph.name} cannot be compared: this project has no log.")
    return max(found, key=len)


def _between(edge: GraphEdge, scans: Mapping[int, ScanId]) -> Edge | None:
    """An edge between two scans that are no neighbours, the earlier one first."""
    first, second = scans.get(edge.first), scans.get(edge.second)
    if first is None or second is None or first == second:
        return None
    if are_neighbours(min(first, second), max(first, second)):
        return None
    made = Edge(first, second, edge.T_1_2, edge.covariance, source="imported")
    return made if first < second else made.reversed()


def _size(edge: Edge) -> float:
    return float(np.linalg.det(np.array(edge.covariance)))


def _proposal(edge: Edge, name: str) -> Proposal:
    covariance: Covariance = edge.covariance
    return Proposal(integration=edge.name, kind="imported", T_1_2=edge.T_1_2, covariance=covariance, source=name)
