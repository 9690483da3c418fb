"""Segments of many scans in one frame, cut into short pieces that walls are found from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from segmap.fusion._wall_kernels import Grid, Pieces
from segmap.pose import FloatArray, IntArray, Pose2
from segmap.scans import ScanId
from segmap.segments import SegmentMap

__all__ = ["Cut", "cut", "grid"]

PIECE = 0.2
"""metres; no piece is longer"""
SHARP = 6.0
"""metres; at this distance from its sensor a segment counts half, as an error of the heading grows with distance"""


@dataclass(frozen=True, eq=False)
class Cut:
    """All segments in one frame, and their pieces."""

    whole: SegmentMap
    """every segment as it came"""
    pieces: Pieces
    segments: IntArray
    """(m,): the segment each piece is of"""
    scans: IntArray
    """(m,): the map it came with, by number"""


def cut(maps: Mapping[ScanId, SegmentMap], poses: Mapping[ScanId, Pose2]) -> Cut:
    """Cut the segments of some maps, each moved by its pose."""
    whole = SegmentMap.joined(maps[scan].moved(poses[scan]) for scan in maps)
    counts = np.maximum(1, np.ceil(whole.lengths / PIECE)).astype(np.int64)
    segments = np.repeat(np.arange(len(whole)), counts)
    place = np.arange(len(segments)) - np.repeat(np.cumsum(counts) - counts, counts)
    start, way = whole.coordinates[:, :2], whole.coordinates[:, 2:] - whole.coordinates[:, :2]
    pieces = Pieces(
        start[segments] + way[segments] * ((place + 0.5) / counts[segments])[:, None],
        (way / whole.lengths[:, None])[segments],
        (whole.lengths / counts)[segments],
        np.concatenate([np.empty(0), *(_trust(segment_map) for segment_map in maps.values())])[segments],
        ~whole.directed[segments],
    )
    owners = np.repeat(np.arange(len(maps)), [len(segment_map) for segment_map in maps.values()])
    return Cut(whole, pieces, segments, owners[segments])


def _trust(segment_map: SegmentMap) -> FloatArray:
    """How far each segment of a scan is to be trusted: less with the distance from its sensor."""
    if len(segment_map.sights) != 1:
        return np.ones(len(segment_map))
    sensor = segment_map.sights[0].T_map_sensor
    middles = (segment_map.coordinates[:, :2] + segment_map.coordinates[:, 2:]) / 2.0
    return 1.0 / (1.0 + ((middles - (sensor.x, sensor.y)) ** 2).sum(axis=1) / SHARP**2)


def grid(points: FloatArray, cell: float) -> Grid:
    """Which of some points (m, 2), m > 0, are in which cell."""
    corner = points.min(axis=0)
    places = ((points - corner) / cell).astype(np.int64)
    rows, columns = (int(count) + 1 for count in places.max(axis=0))
    keys = places[:, 0] * columns + places[:, 1]
    order: IntArray = np.argsort(keys, kind="stable")
    starts = np.searchsorted(keys[order], np.arange(rows * columns + 1))
    return Grid(order, starts, corner, rows, columns, cell)


Mask = NDArray[np.bool_]
