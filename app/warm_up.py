"""Run as a script: compile every kernel once, so that numba's cache on disk holds it for all later processes."""

from __future__ import annotations

import numpy as np

from segmap.candidates import HEURISTICS
from segmap.integration import integrate
from segmap.parameters import Parameters
from segmap.segments import Order, SegmentMap

__all__ = ["warm_up"]

ROOM = np.array([[0.0, 0.0, 4.0, 0.0], [4.0, 0.0, 4.0, 3.0], [4.0, 3.0, 0.0, 3.0], [0.0, 3.0, 0.0, 0.0]])


def warm_up() -> None:
    """Integrate two small maps in every way there is."""
    room = SegmentMap(ROOM, Order.BEAMS)
    undirected = SegmentMap(ROOM, Order.NONE, np.zeros(len(ROOM), bool))
    for heuristic in HEURISTICS:
        for other in (room, undirected):
            integrate(room, other, Parameters(random_rounds=1), heuristic, "paper")


if __name__ == "__main__":
    warm_up()
