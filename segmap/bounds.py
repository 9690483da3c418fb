"""Candidates -> upper bounds of their values, from tables made once for a pair of maps.

:mod:`segmap._search_kernels` says why they are bounds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from segmap import _search_kernels
from segmap._search_kernels import Grid
from segmap._threads import Crew
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray
from segmap.segments import SegmentMap

__all__ = ["upper_bounds"]

HEADINGS = 32
"""bins of half a turn"""
KINDS = 4
"""most kinds of segments of map 2 by length, each up to twice as long as the next"""
CELL = (1.0, 2.0)
"""least and greatest side of a cell, in distances at which segments cease to match"""
COARSE = 1e8
"""pairs of segments of all candidates together up to which cells are of the greatest side"""
CELLS = 1 << 23
"""most cells of all tables of a pair together"""
ROTATIONS = (256, 1024)
"""fewest and most bins of a whole turn into which candidates are sorted"""
PAINTED, LOOKED_UP = 8, 1 << 16
"""tables and candidates between two looks at whether to stop"""


@dataclass(frozen=True, eq=False)
class _Kinds:
    """Segments of map 2 in kinds of about one length."""

    of: IntArray
    """shape (segments,): the kind of each"""
    halves: FloatArray
    """shape (kinds, 2): least and greatest half length, metres"""


def upper_bounds(
    map_1: SegmentMap, map_2: SegmentMap, poses: FloatArray, parameters: Parameters, threads: Crew
) -> FloatArray:
    """What the value of each candidate ``T_1_2`` of ``poses`` (k, 3) cannot exceed, discarded or not, (k,), metres.

    Zero only where nothing matches. Both maps need segments.
    """
    rotations = _rotations(len(poses))
    kinds = _kinds(map_2.lengths)
    grid, shape = _grid(map_1, map_2, len(poses), parameters, len(kinds.halves))
    tables = _painted(map_1, kinds, grid, shape, parameters, threads)
    sums = _looked_up(tables, kinds, map_2, poses, rotations, grid, threads)
    return sums * np.float64(1.0 + 1.2e-7 * (len(map_1) + len(map_2) + 8))  # each a sum in single precision


def _rotations(candidates: int) -> int:
    """About a hundred candidates in each bin."""
    least, most = ROTATIONS
    return min(most, max(least, 1 << (candidates // 128).bit_length()))


def _kinds(lengths: FloatArray) -> _Kinds:
    """A kind for each halving of the greatest length, the shortest all in one."""
    halvings = np.minimum(KINDS - 1, np.log2(lengths.max() / lengths).astype(np.int64))
    present, of = np.unique(halvings, return_inverse=True)
    ends = [(lengths[halvings == k].min(), lengths[halvings == k].max()) for k in present]
    return _Kinds(of, 0.5 * np.array(ends))


def _grid(
    map_1: SegmentMap, map_2: SegmentMap, candidates: int, parameters: Parameters, kinds: int
) -> tuple[Grid, tuple[int, int]]:
    """Cells over map 1, and beyond as far as all but steep pairs can reach; rows and columns."""
    limit = parameters.segment_distance_threshold * parameters.point_distance_tolerance
    points = map_1.coordinates.reshape(-1, 2)
    beyond = 0.5 * map_2.lengths.max() + 4.0 * limit
    corner = points.min(axis=0) - beyond
    sides = points.max(axis=0) + beyond - corner
    most = CELLS // (HEADINGS * kinds)
    cell = max(
        _fineness(candidates * len(map_1) * len(map_2)) * limit,
        math.sqrt(sides[0] * sides[1] / most),
        8.0 * max(sides) / most,
    )
    columns, rows = (int(count) + 5 for count in sides / cell)
    x, y = (corner - 2.0 * cell).tolist()
    slack = 0.5 * math.pi / HEADINGS + math.pi / _rotations(candidates) + 1e-6
    return Grid(x, y, cell, _rounding(map_1, map_2, sides), slack), (rows, columns)


def _fineness(pairs: int) -> float:
    """Side of a cell in distances: the more there is to save, the finer."""
    least, most = CELL
    return max(least, most * min(1.0, COARSE / pairs) ** 0.25)


def _rounding(map_1: SegmentMap, map_2: SegmentMap, sides: FloatArray) -> float:
    """Metres by which a middle may be off, in single precision here and in double precision in the value."""
    farthest = max(np.abs(map_1.coordinates).max(), np.abs(map_2.coordinates).max())
    wide = np.ptp(map_2.coordinates.reshape(-1, 2), axis=0).sum()
    return float(1e-6 * (sides.sum() + wide) + 1e-13 * farthest + 1e-8)


def _painted(
    map_1: SegmentMap, kinds: _Kinds, grid: Grid, shape: tuple[int, int], parameters: Parameters, threads: Crew
) -> NDArray[np.float32]:
    """The tables, (kinds, headings, rows, columns)."""
    tables = np.empty((len(kinds.halves), HEADINGS, *shape), np.float32)
    limit = parameters.segment_distance_threshold * parameters.point_distance_tolerance
    rate = math.log(parameters.distance_penalty) / parameters.point_distance_tolerance

    def paint(block: slice) -> None:
        _search_kernels.paint(tables, block.start, block.stop, map_1.coordinates, kinds.halves, grid, limit, rate)

    threads.run(paint, threads.blocks(len(kinds.halves) * HEADINGS, PAINTED))
    return tables


def _looked_up(
    tables: NDArray[np.float32],
    kinds: _Kinds,
    map_2: SegmentMap,
    poses: FloatArray,
    rotations: int,
    grid: Grid,
    threads: Crew,
) -> NDArray[np.float32]:
    """The sum of what the tables hold for each segment of map 2, for every candidate."""
    order, starts = _search_kernels.by_rotation(poses, rotations)
    middles = 0.5 * (map_2.coordinates[:, :2] + map_2.coordinates[:, 2:])
    middle = middles.mean(axis=0)
    sums = np.empty(len(poses), np.float32)

    def look_up(block: slice) -> None:
        first, last = np.searchsorted(starts, (block.start, block.stop))
        _search_kernels.look_up(
            tables, kinds.of, middles - middle, map_2.headings, middle, poses, order, starts, first, last, grid, sums
        )

    threads.run(look_up, threads.blocks(len(poses), LOOKED_UP))
    return sums
