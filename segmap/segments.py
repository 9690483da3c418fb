"""Line segments: the maps they form, and how a scan becomes one (Section III-D)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from segmap import tracing
from segmap.errors import MapError
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray, Pose2
from segmap.scans import LaserScan

LEAST_LENGTH = 1e-9
"""metres; what is shorter is a point"""
FARTHEST = 1e8
"""metres; no map reaches farther from its origin"""

__all__ = ["Order", "SegmentMap", "Sight", "Source", "extract", "possible"]


class Order(StrEnum):
    """What the order of a map's segments means (Section I: a scan has one, a partial map has none)."""

    BEAMS = "beams"
    """beam order of a sensor with a first and a last beam"""
    RING = "ring"
    """beam order of a sensor that sees all round: the first follows the last"""
    NONE = "none"
    """a partial map"""


class Source(NamedTuple):
    """A segment of a scan, as the origin of a segment of a map."""

    log: int
    scan: int
    segment: int


@dataclass(frozen=True, eq=False)
class Sight:
    """A scan and where its sensor stood: what a map knows of the space between its walls."""

    T_map_sensor: Pose2
    scan: LaserScan


@dataclass(frozen=True, eq=False)
class SegmentMap:
    """A scan or a partial map: line segments in one frame.

    Segments are directed so that free space is on their left, unless ``directed`` says otherwise.

    Raises:
        MapError: wrong shapes, coordinates that are not finite or absurdly large, or a segment without length.
    """

    coordinates: FloatArray
    """shape (segments, 4): x1, y1, x2, y2 in metres"""
    order: Order = Order.NONE
    directed: NDArray[np.bool_] = None  # type: ignore[assignment]
    """shape (segments,); default: all"""
    sources: tuple[tuple[Source, ...], ...] = None  # type: ignore[assignment]
    """for each segment, the segments of scans it came from; none: a connector, or unknown"""
    sights: tuple[Sight, ...] = ()
    """the scans the map was made of, for lines of sight"""

    def __post_init__(self) -> None:
        coordinates = _checked_coordinates(self.coordinates)
        count = len(coordinates)
        directed = np.ones(count, bool) if self.directed is None else np.array(self.directed, bool)
        sources = ((),) * count if self.sources is None else tuple(self.sources)
        if directed.shape != (count,) or len(sources) != count:
            raise MapError(
                f"A map of {count} segments needs {count} directions and {count} sources,"
                f" not {directed.size} and {len(sources)}."
            )
        directed.flags.writeable = coordinates.flags.writeable = False
        object.__setattr__(self, "coordinates", coordinates)
        object.__setattr__(self, "directed", directed)
        object.__setattr__(self, "sources", sources)

    @classmethod
    def empty(cls) -> SegmentMap:
        """The map without segments."""
        return cls(np.empty((0, 4)))

    def __len__(self) -> int:
        return len(self.coordinates)

    @cached_property
    def lengths(self) -> FloatArray:
        """Lengths, shape (segments,), metres."""
        return np.hypot(*(self.coordinates[:, 2:] - self.coordinates[:, :2]).T)

    @cached_property
    def headings(self) -> FloatArray:
        """Headings from first to second extreme, shape (segments,), radians."""
        dx, dy = (self.coordinates[:, 2:] - self.coordinates[:, :2]).T
        return np.arctan2(dy, dx)

    @property
    def bounds(self) -> tuple[float, float, float, float] | None:
        """x and y from, x and y to, in metres; None for the empty map."""
        if not len(self):
            return None
        points = self.coordinates.reshape(-1, 2)
        (x1, y1), (x2, y2) = points.min(axis=0), points.max(axis=0)
        return float(x1), float(y1), float(x2), float(y2)

    def moved(self, T_to_here: Pose2) -> SegmentMap:
        """The same map in another frame: every point p becomes ``T_to_here @ p``."""
        points = T_to_here @ self.coordinates.reshape(-1, 2, 2)
        sights = tuple(Sight(T_to_here @ sight.T_map_sensor, sight.scan) for sight in self.sights)
        return SegmentMap(points.reshape(-1, 4), self.order, self.directed, self.sources, sights)

    def take(self, indices: Sequence[int] | IntArray) -> SegmentMap:
        """Some of the segments, as a partial map without sights."""
        rows = np.asarray(indices, dtype=np.int64)
        sources = tuple(self.sources[i] for i in rows)
        return SegmentMap(self.coordinates[rows], Order.NONE, self.directed[rows], sources)

    @classmethod
    def joined(cls, maps: Iterable[SegmentMap]) -> SegmentMap:
        """All segments and sights of some maps of one frame, as a partial map; nothing is fused."""
        parts = list(maps)
        if not parts:
            return cls.empty()
        return cls(
            np.concatenate([part.coordinates for part in parts]),
            Order.NONE,
            np.concatenate([part.directed for part in parts]),
            tuple(source for part in parts for source in part.sources),
            tuple(sight for part in parts for sight in part.sights),
        )


def possible(coordinates: FloatArray) -> NDArray[np.bool_]:
    """Which of some rows x1, y1, x2, y2 in metres, (n, 4), a map can have as segments, (n,)."""
    near = (np.abs(coordinates) <= FARTHEST).all(axis=1)  # false for NaN
    with np.errstate(invalid="ignore", over="ignore"):
        return near & (np.hypot(*(coordinates[:, 2:] - coordinates[:, :2]).T) > LEAST_LENGTH)


def _checked_coordinates(coordinates: ArrayLike) -> FloatArray:
    array = np.array(coordinates, dtype=np.float64)
    if array.size == 0:
        array = array.reshape(0, 4)
    if array.ndim != 2 or array.shape[1] != 4:
        raise MapError(f"Segments must be rows of x1, y1, x2, y2; these have the shape {array.shape}.")
    usable = np.abs(array) <= FARTHEST  # false for NaN
    if not usable.all():
        row = int(np.flatnonzero(~usable.all(axis=1))[0])
        raise MapError(f"Segment {row} has a coordinate that is not a number of metres within {FARTHEST:.0e}.")
    short = np.flatnonzero(np.hypot(*(array[:, 2:] - array[:, :2]).T) <= LEAST_LENGTH)
    if len(short):
        raise MapError(f"Segment {short[0]} has no length: its two extremes are the same point.")
    return array


def extract(scan: LaserScan, parameters: Parameters, log: int = 0, index: int = 0) -> SegmentMap:
    """The segments of a scan, in beam order, in the sensor's frame (Section III-D).

    Returns closer than ``cluster_distance`` to the next one form a cluster; each cluster becomes
    a polyline that keeps within ``split_tolerance`` of its points. ``log`` and ``index`` are
    written into the sources. A scan without returns gives the empty map.

    >>> len(extract(LaserScan(np.full(180, 2.0), -1.57, 0.0175), Parameters()))
    16
    """
    points, _ = scan.returns(parameters.max_range)
    points = points if scan.angle_step > 0.0 else points[::-1]  # the sensor is on the left either way
    chunks = clusters(points, parameters.cluster_distance, scan.all_round)
    coordinates = approximate(chunks, parameters.split_tolerance)
    lengths = np.hypot(*(coordinates[:, 2:] - coordinates[:, :2]).T)
    coordinates = coordinates[(lengths >= parameters.min_segment_length) & (lengths > LEAST_LENGTH)]
    segment_map = SegmentMap(
        coordinates,
        Order.RING if scan.all_round else Order.BEAMS,
        sources=tuple((Source(log, index, i),) for i in range(len(coordinates))),
        sights=(Sight(Pose2.identity(), scan),),
    )
    tracing.tell("segments", scan=scan, points=points, clusters=chunks, map=segment_map)
    return segment_map


def clusters(points: FloatArray, cluster_distance: float, all_round: bool = False) -> list[FloatArray]:
    """Cut returns in beam order, shape (returns, 2), where two neighbours are too far apart (III-D).

    Where the sensor sees all round, a cluster may run over the seam between last and first beam.
    """
    if not len(points):
        return []
    gaps = np.hypot(*np.diff(points, axis=0).T) >= cluster_distance
    chunks = np.split(points, np.flatnonzero(gaps) + 1)
    if all_round and len(chunks) > 1 and math.dist(points[-1], points[0]) < cluster_distance:
        chunks = [np.concatenate((chunks[-1], chunks[0])), *chunks[1:-1]]
    return chunks


def approximate(chunks: list[FloatArray], split_tolerance: float) -> FloatArray:
    """Polylines through clusters by recursive splitting, as segments of shape (n, 4) (III-D).

    A cluster of one point gives no segment.
    """
    long_enough = [chunk for chunk in chunks if len(chunk) > 1]
    if not long_enough:
        return np.empty((0, 4))
    owners = np.repeat(np.arange(len(long_enough)), [len(chunk) for chunk in long_enough])
    lines = shapely.linestrings(np.concatenate(long_enough), indices=owners)
    with np.errstate(invalid="ignore"):  # points nearer to each other than floats can square
        simple = shapely.simplify(lines, split_tolerance, preserve_topology=False)
    corners, line = shapely.get_coordinates(simple, return_index=True)
    same_line = line[1:] == line[:-1]
    return np.concatenate((corners[:-1], corners[1:]), axis=1)[same_line]
