"""Candidates -> upper bounds of their values, from tables made once for a pair of maps.

:mod:`segmap._bound_kernels` says why they are bounds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from segmap import _bound_kernels, _search_kernels
from segmap._bound_kernels import Grid
from segmap._search_kernels import Tables
from segmap._threads import Crew
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray
from segmap.segments import SegmentMap

__all__ = ["Bounds"]

HEADINGS = 32
"""bins of half a turn"""
KINDS = 4
"""most kinds of segments of map 2 by length, each up to twice as long as the next"""
CELL = (1.4, 3.0)
"""least and greatest side of a cell, in distances at which segments cease to match"""
COARSE = 1e8
"""pairs of segments of all candidates together up to which cells have the greatest side"""
CELLS = 1 << 23
"""most cells of all tables of a pair together"""
ROTATIONS = (256, 1024)
"""fewest and most bins of a whole turn into which candidates are sorted"""
PAINTED, LOOKED_UP, CLOSER = 8, 1 << 16, 4096
"""tables painted, bounds looked up and closer ones found between two looks at whether to stop"""
LEAST_CLOSER = 64
"""fewer closer bounds are not worth a thread"""


@dataclass(frozen=True, eq=False)
class _Kinds:
    """Segments of map 2 in kinds of about one length."""

    of: IntArray
    """shape (segments,): the kind of each"""
    halves: FloatArray
    """shape (kinds, 2): least and greatest half length, metres"""


class Bounds:
    """Upper bounds of the values of some candidates ``T_1_2``, rows of ``poses`` (k, 3). Both maps need segments."""

    def __init__(
        self, map_1: SegmentMap, map_2: SegmentMap, poses: FloatArray, parameters: Parameters, threads: Crew
    ) -> None:
        self._maps = map_1.coordinates, map_2.coordinates
        self._poses = poses
        self._measure = _limit(parameters), _rate(parameters)
        self._above = 1.0 + 1.2e-7 * (len(map_1) + len(map_2) + 8)  # what sums in single precision may lack
        self._threads = threads
        self._tables = _tables(map_1, map_2, len(poses), parameters, threads)

    def of_all(self) -> FloatArray:
        """What no value exceeds, discarded or not, (k,), metres; zero only where nothing matches."""
        order, starts = _search_kernels.by_rotation(self._poses, self._tables.rotations)
        sums = np.empty(len(self._poses), np.float32)

        def look_up(block: slice) -> None:
            first, last = np.searchsorted(starts, (block.start, block.stop))
            _search_kernels.look_up(self._tables, self._poses, order, starts, first, last, sums)

        self._threads.run(look_up, self._threads.blocks(len(sums), LOOKED_UP))
        return sums * np.float64(self._above)

    def outlasting(self, rows: IntArray, least: float) -> IntArray:
        """The rows whose value can be ``least`` and above, after a closer look."""
        enough = least / self._above - 1e-9

        def outlast(block: slice) -> NDArray[np.bool_]:
            lasting: NDArray[np.bool_] = _search_kernels.outlast(
                self._tables, self._poses, rows[block], *self._maps, *self._measure, enough
            )
            return lasting

        kept = self._threads.run(outlast, self._threads.blocks(len(rows), CLOSER, LEAST_CLOSER))
        return rows[np.concatenate([np.empty(0, bool), *kept])]


def _tables(map_1: SegmentMap, map_2: SegmentMap, candidates: int, parameters: Parameters, threads: Crew) -> Tables:
    kinds = _kinds(map_2.lengths)
    grid, shape = _grid(map_1, map_2, candidates, parameters, len(kinds.halves))
    painted = np.empty((len(kinds.halves), HEADINGS, *shape), np.float32)

    def paint(block: slice) -> None:
        _bound_kernels.paint(
            painted,
            block.start,
            block.stop,
            map_1.coordinates,
            kinds.halves,
            grid,
            _limit(parameters),
            _rate(parameters),
        )

    threads.run(paint, threads.blocks(len(kinds.halves) * HEADINGS, PAINTED))
    middles = 0.5 * (map_2.coordinates[:, :2] + map_2.coordinates[:, 2:])
    middle = middles.mean(axis=0)
    return Tables(
        painted.reshape(-1, shape[0] * shape[1]),
        HEADINGS,
        *shape,
        grid,
        kinds.of,
        middles - middle,
        middle,
        map_2.headings,
        _rotations(candidates),
    )


def _limit(parameters: Parameters) -> float:
    """The distance at which segments cease to match, metres."""
    return parameters.segment_distance_threshold * parameters.point_distance_tolerance


def _rate(parameters: Parameters) -> float:
    """The logarithm of the penalty for a metre of distance."""
    return math.log(parameters.distance_penalty) / parameters.point_distance_tolerance


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
    limit = _limit(parameters)
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
    return max(least, most * min(1.0, COARSE / pairs) ** (1 / 3))


def _rounding(map_1: SegmentMap, map_2: SegmentMap, sides: FloatArray) -> float:
    """Metres by which a middle may be off, in single precision here and in double precision in the value."""
    farthest = max(np.abs(map_1.coordinates).max(), np.abs(map_2.coordinates).max())
    wide = np.ptp(map_2.coordinates.reshape(-1, 2), axis=0).sum()
    return float(1e-6 * (sides.sum() + wide) + 1e-13 * farthest + 1e-8)
