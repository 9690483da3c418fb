"""How far single scans lie from the walls of the map they were merged into."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from segmap.merging.components import Component
from segmap.pose import FloatArray, IntArray
from segmap.scans import ScanId
from segmap.segments import SegmentMap

__all__ = ["misfit", "witnesses"]


def witnesses(segment_map: SegmentMap) -> IntArray:
    """How many scans each segment of a map comes from, shape (n,); 0: a connector, or unknown."""
    return np.array([len({(s.log, s.scan) for s in sources}) for sources in segment_map.sources], dtype=np.int64)


def misfit(component: Component, maps: Mapping[ScanId, SegmentMap]) -> FloatArray:
    """How far the segments of scans lie from the segment they were fused into, shape (n,), metres.

    The root mean square over both ends of what the scans' segments have beside the map's segment. ``maps`` are those
    the component was made of. NaN where nothing lies beside a segment: it connects others, or its sources are unknown.
    """
    owner, ends = _sources(component, maps)
    if not len(owner):
        return np.full(len(component.map), np.nan)
    off, beside = _off(component.map.coordinates[owner], ends)
    count = np.bincount(owner[beside], minlength=len(component.map))
    squares = np.bincount(owner[beside], off[beside], minlength=len(component.map))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.sqrt(squares / count)


def _sources(component: Component, maps: Mapping[ScanId, SegmentMap]) -> tuple[IntArray, FloatArray]:
    """For every source of every segment: the segment, (k,), and the source's coordinates in the map's frame, (k, 4)."""
    places: dict[ScanId, tuple[int, int]] = {}
    rows, start = [], 0
    for scan in component.scans:
        moved = maps[scan].moved(component.poses[scan]).coordinates
        places[scan] = start, len(moved)
        rows.append(moved)
        start += len(moved)
    owner, source = [], []
    for segment, sources in enumerate(component.map.sources):
        for one in sources:
            first, count = places.get(ScanId(one.log, one.scan), (0, 0))
            if one.segment < count:
                owner.append(segment)
                source.append(first + one.segment)
    held = np.concatenate(rows) if rows else np.empty((0, 4))
    return np.array(owner, dtype=np.int64), held[np.array(source, dtype=np.int64)]


def _off(walls: FloatArray, ends: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean squared distance from each wall of what its source has beside it, (k,); and where there is any, (k,)."""
    start, along = walls[:, :2], walls[:, 2:] - walls[:, :2]
    length = np.hypot(*along.T)
    direction = along / length[:, None]
    normal = np.stack((-direction[:, 1], direction[:, 0]), axis=1)
    points = ends.reshape(-1, 2, 2) - start[:, None]
    t = np.einsum("kij,kj->ki", points, direction)
    d = np.einsum("kij,kj->ki", points, normal)
    kept = np.clip(t, 0.0, length[:, None])
    beside = np.abs(kept[:, 1] - kept[:, 0]) > 0.0
    span = np.where(t[:, 1] == t[:, 0], 1.0, t[:, 1] - t[:, 0])
    slope = (d[:, 1] - d[:, 0]) / span
    clipped = d[:, :1] + (kept - t[:, :1]) * slope[:, None]
    return np.mean(clipped**2, axis=1), beside
