"""Run as a script: compile every kernel once, so that numba's cache on disk holds it for all later processes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from segmap.evaluation import BOUNDED, search
from segmap.export.grid import grid_of
from segmap.integration import MODES, heuristics, integrate
from segmap.parameters import Parameters
from segmap.scans import LaserScan
from segmap.segments import Order, extract

__all__ = ["warm_up"]


def warm_up() -> None:
    """Integrate two small maps in every way there is, search many candidates, and draw one."""
    parameters = Parameters(random_rounds=1)
    headings = np.radians(np.arange(180.0) - 90.0)
    ranges = 2.0 / np.maximum(np.abs(np.cos(headings)), np.abs(np.sin(headings)))  # half a square room
    room = extract(LaserScan(ranges, -math.pi / 2, math.radians(1.0)), parameters)
    undirected = replace(room, order=Order.NONE, directed=np.zeros(len(room), bool))
    for mode in MODES:
        for heuristic in heuristics(mode):
            for other in (room, undirected):
                integrate(room, other, parameters, heuristic, mode)
    shifts = np.zeros((1 + BOUNDED // len(room) ** 2, 3))
    shifts[:, 0] = np.linspace(-3.0, 3.0, len(shifts))
    search(room, room, shifts, parameters, 1)
    grid_of(room, 0.1)


if __name__ == "__main__":
    warm_up()
