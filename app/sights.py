"""What each return of two scans says of a candidate, for drawing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray, Pose2
from segmap.segments import SegmentMap
from segmap.visibility import Evidence, classes, evidence, sighting

__all__ = ["CLASSES", "Sights", "sights"]

CLASSES = ("supported", "contradicted", "shadowed", "unseen")
"""by number, as the library has them"""


@dataclass(frozen=True, eq=False)
class Sights:
    """The returns of both maps, each with what the other map's lines of sight say of it."""

    points: tuple[FloatArray, FloatArray]
    """shape (n, 2), metres, each in its own map's frame"""
    classes: tuple[IntArray, IntArray]
    """shape (n,), places in ``CLASSES``"""
    evidence: Evidence
    """the same in metres, of both together"""


def sights(map_1: SegmentMap, map_2: SegmentMap, T_1_2: Pose2, parameters: Parameters) -> Sights | None:
    """What lines of sight say of a candidate; None where a map knows of no scan."""
    seen_1, seen_2 = (sighting(some, parameters.max_range) for some in (map_1, map_2))
    if seen_1 is None or seen_2 is None:
        return None
    found = classes(seen_1, seen_2, T_1_2, parameters)
    widths = np.concatenate((seen_1.points[:, 2], seen_2.points[:, 2]))
    totals = np.bincount(np.concatenate(found), widths, len(CLASSES)).astype(np.float64)
    return Sights((seen_1.points[:, :2], seen_2.points[:, :2]), found, evidence(totals))
