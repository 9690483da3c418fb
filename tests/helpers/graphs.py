"""Pose graphs of known truth."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from segmap.graph import Edge
from segmap.pose import Pose2
from segmap.scans import ScanId

NOISE = 0.02
"""metres and, a quarter of it, radians: standard deviations of an edge"""
COVARIANCE = ((NOISE**2, 0.0, 0.0), (0.0, NOISE**2, 0.0), (0.0, 0.0, (NOISE / 4) ** 2))


def ring(
    count: int, *, noise: float = 1.0, trusted: bool = True, seed: int = 0, log: int = 0, reach: int = 3
) -> tuple[dict[ScanId, Pose2], list[Edge]]:
    """Scans 0.5 m apart on two rounds of a ring: consecutive edges, closures to scans near by.

    ``noise`` is in units of the covariance that the edges say they have.
    """
    rng = np.random.default_rng(seed)
    radius = 0.5 * count / 2 / (2.0 * math.pi)
    angles = [4.0 * math.pi * i / count for i in range(count)]
    world = [Pose2(radius * math.cos(a), radius * math.sin(a), a + math.pi / 2) for a in angles]
    half = count // 2
    pairs = [(i, i + step) for step in range(1, reach + 1) for i in range(count - step)]
    pairs += [(i, i + half + step) for i in range(half) for step in (-1, 0, 1) if i + half + step < count]
    edges = [
        Edge(
            ScanId(log, i),
            ScanId(log, j),
            noisy(world[i].inverse() @ world[j], rng, noise),
            COVARIANCE,
            trusted=trusted and j == i + 1,
        )
        for i, j in pairs
    ]
    return {ScanId(log, i): world[0].inverse() @ pose for i, pose in enumerate(world)}, edges


def noisy(pose: Pose2, rng: np.random.Generator, noise: float) -> Pose2:
    """A pose with an error; ``noise`` in standard deviations of ``COVARIANCE``."""
    x, y, theta = noise * NOISE * rng.uniform(-1.0, 1.0, 3)
    return Pose2(pose.x + x, pose.y + y, pose.theta + theta / 4)


def with_wrong(edges: Sequence[Edge], share: float, kind: str, seed: int = 1) -> list[Edge]:
    """The edges, and after them wrong ones until these are a share of all that are not trusted."""
    rng = np.random.default_rng(seed)
    free = [edge for edge in edges if not edge.trusted]
    scans = sorted({scan for edge in edges for scan in (edge.first, edge.second)})
    count = round(share * len(free) / (1.0 - share))
    return [*edges, *(_WRONG[kind](free, scans, rng) for _ in range(count))]


def _random(_: Sequence[Edge], scans: Sequence[ScanId], rng: np.random.Generator) -> Edge:
    a, b = rng.choice(len(scans), 2, replace=False)
    return Edge(scans[a], scans[b], Pose2(*rng.uniform(-8.0, 8.0, 2), rng.uniform(-3.0, 3.0)), COVARIANCE)


def _shifted(free: Sequence[Edge], _: Sequence[ScanId], rng: np.random.Generator) -> Edge:
    """A right edge slid along the heading of its first scan, as matches in a corridor are."""
    edge = free[rng.integers(len(free))]
    slide = rng.choice((-1.0, 1.0)) * rng.uniform(0.5, 3.0)
    T = edge.T_1_2
    return Edge(edge.first, edge.second, Pose2(T.x + slide, T.y, T.theta), COVARIANCE)


_WRONG = {"random": _random, "shifted": _shifted}


def far_apart(poses: Mapping[ScanId, Pose2], others: Mapping[ScanId, Pose2]) -> tuple[float, float]:
    """The largest distances, metres and radians, between two sets of poses of the same scans."""
    assert poses.keys() == others.keys()
    distances = [poses[scan].distance(others[scan]) for scan in poses]
    return max(d for d, _ in distances), max(a for _, a in distances)
