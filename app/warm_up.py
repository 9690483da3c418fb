"""Run as a script: compile every kernel once, so that numba's cache on disk holds it for all later processes.

With ``first`` as its argument, only what every match of two scans needs; with ``rest``, what some need.
"""

from __future__ import annotations

import math
import sys
from dataclasses import replace

import numpy as np

from segmap.evaluation import BOUNDED, search
from segmap.export.grid import grid_of
from segmap.graph import Edge, optimise, preview, strength
from segmap.integration import MODES, heuristics, integrate
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.scans import LaserScan, ScanId
from segmap.segments import Order, SegmentMap, extract

__all__ = ["first", "rest"]


PARAMETERS = Parameters(random_rounds=1)
COVARIANCE = ((0.01, 0.0, 0.0), (0.0, 0.01, 0.0), (0.0, 0.0, 0.01))


def first() -> None:
    """Integrate two small maps, and optimise a small graph, as a project does that was just opened."""
    integrate(_room(), _room(), PARAMETERS, mode="verified")
    held = optimise([*_edges(1, 0.0), *_edges(2, 0.0), *_edges(3, 9.0)])
    strength(held)
    preview([residual.edge for residual in held.residuals], _edges(4, 9.0)[0], held)


def _edges(step: int, apart: float) -> list[Edge]:
    """From scans that all lie at one place to those so many later; wrong ones where these are said to be apart."""
    scans = [ScanId(0, i) for i in range(8)]
    return [Edge(a, b, Pose2(apart, 0.0, 0.0), COVARIANCE) for a, b in zip(scans, scans[step:], strict=False)]


def rest() -> None:
    """Integrate them in every way there is, search many candidates, and draw one."""
    room = _room()
    undirected = replace(room, order=Order.NONE, directed=np.zeros(len(room), bool))
    shifts = np.zeros((1 + BOUNDED // len(room) ** 2, 3))
    shifts[:, 0] = np.linspace(-3.0, 3.0, len(shifts))
    search(room, room, shifts, PARAMETERS, 1)
    grid_of(room, 0.1)
    for mode in MODES:
        for heuristic in heuristics(mode):
            for other in (room, undirected):
                integrate(room, other, PARAMETERS, heuristic, mode)


def _room() -> SegmentMap:
    """Half a square room, as a scan sees it."""
    headings = np.radians(np.arange(180.0) - 90.0)
    ranges = 2.0 / np.maximum(np.abs(np.cos(headings)), np.abs(np.sin(headings)))
    return extract(LaserScan(ranges, -math.pi / 2, math.radians(1.0)), PARAMETERS)


if __name__ == "__main__":
    {"first": first, "rest": rest}[sys.argv[1]]()
