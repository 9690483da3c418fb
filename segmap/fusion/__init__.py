"""Matching chains -> fused map (Section III-C), and all scans of known poses -> one clean map.

:func:`fuse` is the paper's third step for two maps. :func:`fuse_all` is for the end, when every scan has its pose:
each wall comes out once, however many scans saw it.
"""

from segmap.fusion.chains import Fusion, Polyline, closest_edges, fuse, polyline
from segmap.fusion.whole import fuse_all, spurious_length, spurious_stretches

__all__ = [
    "Fusion",
    "Polyline",
    "closest_edges",
    "fuse",
    "fuse_all",
    "polyline",
    "spurious_length",
    "spurious_stretches",
]
