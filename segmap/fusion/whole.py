"""Scans of known poses -> one clean map: each wall once, however many scans saw it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import shapely

from segmap.errors import MapError
from segmap.fusion.corners import met
from segmap.fusion.pieces import Cut, cut
from segmap.fusion.walls import Wall, walls
from segmap.fusion.witnesses import witnessed
from segmap.parameters import Parameters
from segmap.pose import FloatArray, Pose2
from segmap.scans import ScanId
from segmap.segments import LEAST_LENGTH, Order, SegmentMap, Source

__all__ = ["fuse_all", "spurious_length", "spurious_stretches"]

DOUBLE_DISTANCE, DOUBLE_ANGLE = 0.05, np.radians(5.0)
"""metres and radians; of two segments nearer than this, one is spurious"""


def fuse_all(
    maps: Mapping[ScanId, SegmentMap],
    poses: Mapping[ScanId, Pose2],
    parameters: Parameters | None = None,
    check: Callable[[], None] | None = None,
) -> SegmentMap:
    """Fuse all scans that have a pose into one map, in the frame of the poses.

    Segments of one wall scatter by the errors of their poses; they become the one line most of them lie on, and keep
    their direction, so that the two faces of a thin wall stay two. A line ends where nothing was seen, or where the
    wall goes on elsewhere. What few of the scans that see its place found, or most see through, is left out. Each
    segment knows the segments it stands for; the map keeps the sights of all scans.

    Raises:
        MapError: a pose is of a scan that has no map.
        CancelledError: raised by ``check``.
    """
    parameters = parameters or Parameters()
    missing = next((scan for scan in poses if scan not in maps), None)
    if missing is not None:
        raise MapError(f"Scan {missing} has a pose but no map.")
    pieces = cut({scan: maps[scan] for scan in poses}, poses)
    found = witnessed(walls(pieces, parameters, check), pieces, parameters)
    return _as_map(found, pieces, parameters)


def _as_map(found: Sequence[Wall], pieces: Cut, parameters: Parameters) -> SegmentMap:
    edges = met(np.reshape([wall.edge for wall in found], (-1, 4)), parameters.wall_spread)
    long_enough = np.hypot(*(edges[:, 2:] - edges[:, :2]).T) > LEAST_LENGTH
    kept = [wall for wall, whole in zip(found, long_enough, strict=True) if whole]
    return SegmentMap(
        edges[long_enough],
        Order.NONE,
        np.array([_directed(wall, pieces) for wall in kept], bool),
        tuple(_sources(wall, pieces) for wall in kept),
        pieces.whole.sights,
    )


def _directed(wall: Wall, pieces: Cut) -> bool:
    """Whether most of the wall's own pieces are sure of their direction."""
    lengths, either = pieces.pieces.lengths[wall.own], pieces.pieces.either[wall.own]
    return bool(lengths[either].sum() <= lengths[~either].sum())


def _sources(wall: Wall, pieces: Cut) -> tuple[Source, ...]:
    """The segments of scans whose pieces lie beside the wall's edge."""
    start, way = wall.edge[:2], wall.edge[2:] - wall.edge[:2]
    along = (pieces.pieces.middles[wall.claimed] - start) @ way / (way @ way)
    margin = pieces.pieces.lengths[wall.claimed] / np.hypot(*way)
    beside = wall.claimed[(along >= -margin) & (along <= 1.0 + margin)]
    segments = np.unique(pieces.segments[beside if len(beside) else wall.own])
    return tuple(sorted({source for segment in segments for source in pieces.whole.sources[segment]}))


# --- how clean a map is -----------------------------------------------------------------------------


def spurious_length(segment_map: SegmentMap) -> float:
    """Length of the segments that lie within 5 cm and 5 degrees of another one and beside it, metres.

    Two faces of a wall run in opposite directions, and are no doubles; an undirected segment may double either.

    >>> spurious_length(SegmentMap(np.array([[0.0, 0.0, 2.0, 0.0], [1.0, 0.01, 3.0, 0.01], [2.0, 0.0, 0.0, 0.0]])))
    2.0
    """
    return _united(*_doubled(segment_map))


def spurious_stretches(segment_map: SegmentMap) -> FloatArray:
    """The stretches of segments that :func:`spurious_length` counts, rows x1, y1, x2, y2; some may overlap.

    >>> len(spurious_stretches(SegmentMap(np.array([[0.0, 0.0, 2.0, 0.0], [5.0, 0.0, 7.0, 0.0]]))))
    0
    """
    owners, first, last = _doubled(segment_map)
    starts = segment_map.coordinates[owners, :2]
    ways = (segment_map.coordinates[owners, 2:] - starts) / segment_map.lengths[owners, None]
    rows = np.column_stack((starts + first[:, None] * ways, starts + last[:, None] * ways))
    return rows[last - first > LEAST_LENGTH]


def _doubled(segment_map: SegmentMap) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Segments with another one beside them, (k,), and from where to where along each, metres."""
    edges, lengths = segment_map.coordinates, segment_map.lengths
    i, j = _neighbours(segment_map)
    ways = (edges[:, 2:] - edges[:, :2]) / lengths[:, None]
    starts, ends = (_in_frame(edges[j, k : k + 2] - edges[i, :2], ways[i]) for k in (0, 2))
    first, last = _beside(starts, ends)
    first, last = np.clip(np.sort((first, last), axis=0), 0.0, lengths[i])
    return i, first, last


def _neighbours(segment_map: SegmentMap) -> tuple[FloatArray, FloatArray]:
    """Pairs of segments, in both orders, that come near each other in about one direction."""
    lines = shapely.linestrings(segment_map.coordinates.reshape(-1, 2, 2))
    i, j = shapely.STRtree(lines).query(lines, predicate="dwithin", distance=DOUBLE_DISTANCE)
    cosines = np.cos(segment_map.headings[i] - segment_map.headings[j])
    either = ~(segment_map.directed[i] & segment_map.directed[j])
    alike = (i != j) & (np.where(either, np.abs(cosines), cosines) >= np.cos(DOUBLE_ANGLE))
    return i[alike], j[alike]


def _in_frame(points: FloatArray, ways: FloatArray) -> FloatArray:
    """Along and across some directions."""
    return np.column_stack(((points * ways).sum(axis=1), ways[:, 0] * points[:, 1] - ways[:, 1] * points[:, 0]))


def _beside(starts: FloatArray, ends: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Along the axis, where the segments between points (k, 2) are near to it: from and to; equal where nowhere."""
    rise = ends[:, 1] - starts[:, 1]
    level = np.abs(rise) < LEAST_LENGTH
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.stack([(border - starts[:, 1]) / rise for border in (-DOUBLE_DISTANCE, DOUBLE_DISTANCE)])
    inside = np.abs(starts[:, 1]) <= DOUBLE_DISTANCE
    low = np.where(level, 0.0, np.clip(np.nan_to_num(shares.min(axis=0)), 0.0, 1.0))
    high = np.where(level, np.where(inside, 1.0, 0.0), np.clip(np.nan_to_num(shares.max(axis=0)), 0.0, 1.0))
    run = ends[:, 0] - starts[:, 0]
    return starts[:, 0] + low * run, starts[:, 0] + high * run


def _united(owners: FloatArray, first: FloatArray, last: FloatArray) -> float:
    """Length of the union of some intervals, by owner."""
    total, owner, reached = 0.0, -1, 0.0
    for row in np.lexsort((first, owners)).tolist():
        if owners[row] != owner:
            owner, reached = owners[row], -np.inf
        total += max(0.0, last[row] - max(first[row], reached))
        reached = max(reached, last[row])
    return float(total)
