"""What the sensors say of walls: a wall stays where scans that see its place found it, and nobody sees through."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from segmap._sight_kernels import CONTRADICTED, SUPPORTED
from segmap.fusion import _wall_kernels as kernels
from segmap.fusion.pieces import Cut
from segmap.fusion.walls import Wall
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray
from segmap.segments import Sight
from segmap.visibility import SURFACE_GAP, sensors

__all__ = ["witnessed"]

STEP = 0.1
"""metres between places that are looked at"""
REACH = 8.0
"""metres; from farther away neighbouring returns are too far apart to tell"""
GRAZING = 0.2
"""sine; a beam along a wall tells little of it"""
TOLERANCE = 3.0
"""spreads; a surface this near is the wall"""
ALONE = 0.3
"""metres; what has no wall this near may be a small thing, and stays"""
JOINED = 0.12
"""metres; ends this near belong together"""
LONG = 0.6
"""metres; a step leads from one wall to another, not among small things"""
BARELY = 0.25
"""of the share of scans: enough where the wall goes on to where the share is met"""
SURE = 3
"""times as often seen as seen through: what a small thing needs, and in how many scans"""


@dataclass(frozen=True, eq=False)
class _Samples:
    """Places along walls."""

    owners: IntArray
    """(k,): the wall of each"""
    places: FloatArray
    """(k,): its share of the wall's length"""
    found: IntArray
    """(k,): in how many scans a segment of the wall is there"""
    supported: IntArray
    """(k,): how many sensors see the wall there"""
    contradicted: IntArray
    """(k,): how many see through it"""

    @property
    def solid(self) -> NDArray[np.bool_]:
        """Whether at least as many see the wall as see through it."""
        return self.contradicted <= self.supported

    def held(self, share: float) -> NDArray[np.bool_]:
        """Whether it is solid, and a share of the scans that see the place found the wall."""
        return self.solid & (self.found >= share * (self.supported + self.contradicted))

    def borne_out(self, share: float) -> NDArray[np.bool_]:
        """Whether it is held, or is barely and goes on from where it is."""
        barely = self.held(BARELY * share)
        begins = np.concatenate(([True], (self.owners[1:] != self.owners[:-1]) | (barely[1:] != barely[:-1])))
        run = np.cumsum(begins) - 1
        return barely & (np.bincount(run, self.held(share)) > 0.0)[run]


def witnessed(found: Sequence[Wall], cut: Cut, parameters: Parameters) -> list[Wall]:
    """The stretches of walls that scans bear out.

    Where fewer than ``wall_witnesses`` of the scans that see a place found the wall, it is an accident of noise or
    of a view along an edge, unless nothing else is near; where more sensors see through, it was a person or a door.
    Without sights everything stays.
    """
    sights = [sight for sight in cut.whole.sights if np.isfinite(sight.scan.ranges).any()]
    if not sights or not found:
        return list(found)
    samples = _sampled(found, cut, sights, parameters.wall_spread)
    held = samples.borne_out(parameters.wall_witnesses)
    kept = list(_stretches(found, samples, held, parameters.cluster_distance))
    return kept + _small_things(kept, found, samples, held, parameters.cluster_distance)


def _sampled(found: Sequence[Wall], cut: Cut, sights: Sequence[Sight], spread: float) -> _Samples:
    edges = np.array([wall.edge for wall in found])
    ways = edges[:, 2:] - edges[:, :2]
    lengths = np.hypot(*ways.T)
    counts = np.maximum(1, np.ceil(lengths / STEP)).astype(np.int64)
    owners = np.repeat(np.arange(len(found)), counts)
    starts = np.cumsum(counts) - counts
    places = (np.arange(len(owners)) - starts[owners] + 0.5) / counts[owners]
    points = edges[owners, :2] + places[:, None] * ways[owners]
    normals = np.column_stack((-ways[:, 1], ways[:, 0])) / lengths[:, None]
    beams, eyes = sensors(sights)
    votes = kernels.votes(points, normals[owners], beams, eyes, REACH, GRAZING, TOLERANCE * spread, SURFACE_GAP)
    scans = _scans(found, cut, edges, lengths, counts, starts)
    return _Samples(owners, places, scans, votes[:, SUPPORTED], votes[:, CONTRADICTED])


def _scans(
    found: Sequence[Wall], cut: Cut, edges: FloatArray, lengths: FloatArray, counts: IntArray, starts: IntArray
) -> IntArray:
    """In how many scans each place is covered by a piece of its wall, half a step to spare."""
    pieces = np.concatenate([wall.own for wall in found])
    walls = np.repeat(np.arange(len(found)), [len(wall.own) for wall in found])
    ways = (edges[walls, 2:] - edges[walls, :2]) / lengths[walls][:, None]
    along = ((cut.pieces.middles[pieces] - edges[walls, :2]) * ways).sum(axis=1)
    step, half = (lengths / counts)[walls], cut.pieces.lengths[pieces] / 2.0
    first = np.clip(np.ceil((along - half) / step - 1.0).astype(np.int64), 0, counts[walls] - 1)
    last = np.clip(np.floor((along + half) / step).astype(np.int64), 0, counts[walls] - 1)
    spans = last - first + 1
    place = np.arange(spans.sum()) - np.repeat(np.cumsum(spans) - spans, spans)
    covered = np.repeat(starts[walls] + first, spans) + place
    pairs = np.unique(np.column_stack((covered, np.repeat(cut.scans[pieces], spans))), axis=0)
    return np.bincount(pairs[:, 0], minlength=int(counts.sum()))


def _stretches(found: Sequence[Wall], samples: _Samples, held: NDArray[np.bool_], longest_gap: float) -> Iterator[Wall]:
    """The parts of each wall where it holds, over short gaps too."""
    borders = np.searchsorted(samples.owners, np.arange(len(found) + 1))
    for wall, first, last in zip(found, borders[:-1], borders[1:], strict=True):
        for begin, end in _runs(held[first:last], longest_gap):
            yield _part(wall, begin / (last - first), end / (last - first))


def _runs(held: NDArray[np.bool_], longest_gap: float) -> list[tuple[int, int]]:
    """Where some places in a row hold, from the first to beyond the last; gaps up to a length are bridged.

    >>> _runs(np.array([0, 1, 1, 0, 1, 0, 0, 0, 1], bool), 0.2)
    [(1, 5), (8, 9)]
    """
    places = np.flatnonzero(held)
    runs = np.split(places, np.flatnonzero(np.diff(places) > round(longest_gap / STEP)) + 1)
    return [(int(run[0]), int(run[-1]) + 1) for run in runs if len(run)]


def _part(wall: Wall, first: float, last: float) -> Wall:
    """A wall from one share of its length to another."""
    if (first, last) == (0.0, 1.0):
        return wall
    start, way = wall.edge[:2], wall.edge[2:] - wall.edge[:2]
    return replace(wall, edge=np.concatenate((start + first * way, start + last * way)))


def _small_things(
    kept: list[Wall], found: Sequence[Wall], samples: _Samples, held: NDArray[np.bool_], longest_gap: float
) -> list[Wall]:
    """What few scans found as it is, but many see: of those near each other, the one that most found."""
    some = samples.solid & ~held & (samples.supported >= SURE * np.maximum(samples.contradicted, 1))
    rest = list(_stretches(found, samples, some, longest_gap))
    shares = np.array([len(np.unique(wall.own)) for wall in rest])
    lines = shapely.linestrings([wall.edge.reshape(2, 2) for wall in (*kept, *rest)])
    tree, standing = shapely.STRtree(lines), np.arange(len(lines)) < len(kept)
    joins = _joins(rest, kept)
    for number in np.argsort(-shares, kind="stable").tolist():
        near = tree.query(lines[len(kept) + number], predicate="dwithin", distance=ALONE)
        standing[len(kept) + number] = joins[number] or not standing[near].any()
    return [wall for wall, stands in zip(rest, standing[len(kept) :], strict=True) if stands]


def _joins(rest: Sequence[Wall], kept: Sequence[Wall]) -> NDArray[np.bool_]:
    """Whether walls lead from an end of one long wall to an end of another: steps, which few scans see whole."""
    edges = np.array([wall.edge for wall in kept if np.hypot(*(wall.edge[2:] - wall.edge[:2])) >= LONG])
    if not len(edges) or not rest:
        return np.zeros(len(rest), bool)
    ends = edges.reshape(-1, 2)
    apart, nearest = cKDTree(ends).query(np.array([wall.edge for wall in rest]).reshape(-1, 2))
    owners = nearest.reshape(-1, 2) // 2
    return (apart.reshape(-1, 2) <= JOINED).all(axis=1) & (owners[:, 0] != owners[:, 1])
