"""Pieces of segments -> walls: the straight lines that most of them lie on, the best held first."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from segmap.fusion import _wall_kernels as kernels
from segmap.fusion._wall_kernels import Pieces
from segmap.fusion.pieces import PIECE, Cut, grid
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray
from segmap.segments import LEAST_LENGTH

__all__ = ["Wall", "walls"]

LONG = 2.0
"""metres; the direction of longer segments is no better"""
PARALLEL, ALIKE, ROUGHLY = (math.cos(math.radians(degrees)) for degrees in (15.0, 12.0, 25.0))
"""cosines: of what crowds together, of what lies on a wall, of what a wall stands for"""
SECTORS, AROUND = 36, 3
"""of the headings; a line is sought in its sector and so many on either side"""
NEAR, CLAIM, BAND, CELL = 1.6, 2.4, 4.0, 0.4
"""spreads: what lies on a wall, what it stands for, what it is compared with, in cells of which width"""
STEP = 0.05
"""metres along a wall"""
MOST_SPREAD, OUTLIER, ROUNDS = 2.4, 2.5, 5
"""where poses are worse than ``wall_spread`` says, walls scatter by up to so much more; found from what lies within
so many standard deviations, in so many rounds"""
RULES = 0.5
"""of the weight at the best place beside it: with less a line is not where the wall is"""
BOW = 0.6
"""spreads; a wall that strays farther from its line is bent"""
SMOOTH = 0.5
"""metres over which a bend is averaged"""
BLOCK = 256
"""seeds between two looks at whether to stop"""

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Wall:
    """A straight stretch of wall."""

    edge: FloatArray
    """(4,): x1, y1, x2, y2, metres; free space is on its left"""
    own: IntArray
    """the pieces that lie on it"""
    claimed: IntArray
    """the pieces it stands for, its own included"""


def walls(cut: Cut, parameters: Parameters, check: Callable[[], None] | None = None) -> list[Wall]:
    """Take the best held line with all the pieces it stands for, then the next one among the rest, and so on.

    ``wall_spread`` is how far the pieces of one wall scatter. A wall ends where its pieces are farther apart than
    ``cluster_distance``, or where more pieces lie beside it than on it.
    """
    pieces, found = cut.pieces, list[Wall]()
    free = np.ones(len(pieces.middles), bool)
    sectors = _Sectors(pieces)
    for number, seed in enumerate(_by_promise(cut, parameters.wall_spread).tolist()):
        if check is not None and number % BLOCK == 0:
            check()
        if free[seed]:
            rows = sectors.around(seed)
            stretch = _stretch(pieces.take(rows), free[rows], int(np.searchsorted(rows, seed)), parameters)
            found += [Wall(wall.edge, rows[wall.own], rows[wall.claimed]) for wall in stretch]
            for wall in found[len(found) - len(stretch) :]:
                free[wall.claimed] = False
            free[seed] = False
    return found


def _by_promise(cut: Cut, spread: float) -> IntArray:
    """All pieces, those first that many others lie with and that are of long segments."""
    if not len(cut.pieces.middles):
        return np.empty(0, np.int64)
    cell = PIECE / 2.0 + BAND * spread
    crowd = kernels.crowding(cut.pieces, grid(cut.pieces.middles, cell), spread, PARALLEL)
    return np.argsort(-crowd * np.minimum(cut.whole.lengths[cut.segments], LONG), kind="stable")


class _Sectors:
    """Pieces by heading."""

    def __init__(self, pieces: Pieces) -> None:
        headings = np.arctan2(pieces.along[:, 1], pieces.along[:, 0])
        self._sector = np.floor(headings * SECTORS / (2.0 * math.pi)).astype(np.int64) % SECTORS
        self._pieces = pieces
        self._members: dict[int, IntArray] = {}

    def around(self, piece: int) -> IntArray:
        """The pieces whose headings are near that of one, those that may run either way included; ascending."""
        sector = int(self._sector[piece])
        if sector not in self._members:
            apart = (self._sector - sector) % SECTORS
            near = np.minimum(apart, SECTORS - apart) <= AROUND
            self._members[sector] = np.flatnonzero(near | self._pieces.either)
        return self._members[sector]


# --- one line ---------------------------------------------------------------------------------------


def _stretch(pieces: Pieces, free: Mask, seed: int, parameters: Parameters) -> list[Wall]:
    """The wall that one piece is on, in straight parts; none where more lies beside the best line than on it."""
    line = np.concatenate((pieces.middles[seed], pieces.along[seed]))
    spread, gap = _scatter(line, pieces, free, parameters.wall_spread), parameters.cluster_distance
    line = kernels.fitted(line, pieces, free, spread, NEAR * spread, gap, ALIKE)
    along, beside = _places(line, pieces)
    alike = _alike(line, pieces)
    near = free & (alike >= ALIKE) & (np.abs(beside) <= NEAR * spread)
    span = _span(line, pieces, free, near, along, float(along[seed]), spread, gap)
    if span is None or abs(beside[seed]) > NEAR * spread:
        return []
    within = (along >= span[0] - STEP) & (along <= span[1] + STEP)
    own = np.flatnonzero(near & within)
    claimed = np.flatnonzero(free & (alike >= ROUGHLY) & (np.abs(beside) <= CLAIM * spread) & within | near & within)
    ends = _ends(along[own], pieces.lengths[own], span)
    if not len(own) or ends[1] - ends[0] <= LEAST_LENGTH:
        return []
    corners = _bent(along[own], beside[own], pieces.weights[own] * pieces.lengths[own], ends, spread)
    return _parts(line, corners, along, own, claimed)


def _scatter(line: FloatArray, pieces: Pieces, free: Mask, least: float) -> float:
    """How far pieces beside the middle of a line scatter about it: a standard deviation without the outliers."""
    along, beside = _places(line, pieces)
    level = free & (_alike(line, pieces) >= ALIKE) & (np.abs(along) <= pieces.lengths / 2.0)
    offsets, weights, spread = beside[level], pieces.weights[level], MOST_SPREAD * least
    centre = 0.0
    for _ in range(ROUNDS):
        inside = np.abs(offsets - centre) <= OUTLIER * spread
        if not inside.any():
            return least
        total = weights[inside].sum()
        centre = float(weights[inside] @ offsets[inside] / total)
        spread = float(np.sqrt(weights[inside] @ (offsets[inside] - centre) ** 2 / total))
        spread = min(max(spread, least), MOST_SPREAD * least)
    return spread


def _places(line: FloatArray, pieces: Pieces) -> tuple[FloatArray, FloatArray]:
    """t and n of all pieces."""
    dx, dy = (pieces.middles - line[:2]).T
    return dx * line[2] + dy * line[3], dy * line[2] - dx * line[3]


def _alike(line: FloatArray, pieces: Pieces) -> FloatArray:
    """Cosine between the line and each piece."""
    cosines = pieces.along @ line[2:]
    return np.where(pieces.either, np.abs(cosines), cosines)


def _span(
    line: FloatArray, pieces: Pieces, free: Mask, near: Mask, along: FloatArray, seed: float, spread: float, gap: float
) -> tuple[float, float] | None:
    """From where to where around the seed, t, the line is where most of the pieces lie."""
    if not near.any():
        return None
    start = float((along[near] - pieces.lengths[near]).min())
    bins = int(((along[near] + pieces.lengths[near]).max() - start) / STEP) + 1
    half = round(BAND / CELL)
    beside = kernels.profile(line, pieces, free, ALIKE, start, STEP, bins, CELL * spread, half)
    smooth = _moving_sum(beside, 2)
    on_it = smooth[:, half - 1 : half + 2].max(axis=1)
    ruled = np.flatnonzero((on_it > 0.0) & (on_it >= RULES * smooth.max(axis=1)))
    runs = np.split(ruled, np.flatnonzero(np.diff(ruled) * STEP > gap) + 1)
    for run in runs:
        if len(run) and start + run[0] * STEP - STEP <= seed <= start + (run[-1] + 1) * STEP + STEP:
            return start + float(run[0]) * STEP, start + float(run[-1] + 1) * STEP
    return None


def _moving_sum(values: FloatArray, reach: int) -> FloatArray:
    """Along the second axis: each with ``reach`` on either side."""
    width = values.shape[1]
    padded = np.pad(values, ((0, 0), (reach, reach)))
    return np.sum([padded[:, k : k + width] for k in range(2 * reach + 1)], axis=0)


def _ends(along: FloatArray, lengths: FloatArray, span: tuple[float, float]) -> tuple[float, float]:
    """From where to where pieces lie, within a span."""
    if not len(along):
        return 0.0, 0.0
    first, last = (along - lengths / 2.0).min(), (along + lengths / 2.0).max()
    return max(float(first), span[0]), min(float(last), span[1])


# --- bends ------------------------------------------------------------------------------------------


def _bent(
    along: FloatArray, beside: FloatArray, weights: FloatArray, ends: tuple[float, float], spread: float
) -> FloatArray:
    """Corners (k, 2) as t and n: two on the line where the wall is straight, more where it is bent."""
    straight = np.array([[ends[0], 0.0], [ends[1], 0.0]])
    if ends[1] - ends[0] < 2.0 * SMOOTH:
        return straight
    count = int((ends[1] - ends[0]) / (SMOOTH / 2.0))
    middles = ends[0] + (np.arange(count) + 0.5) * (ends[1] - ends[0]) / count
    near = np.abs(along[:, None] - middles) <= SMOOTH / 2.0
    total = weights @ near
    held = total > 0.0
    strays = (weights * beside) @ near[:, held] / total[held]
    if not held.any() or np.abs(strays).max() <= BOW * spread:
        return straight
    course = np.column_stack((middles[held], strays))
    course = np.vstack(([ends[0], strays[0]], course, [ends[1], strays[-1]]))
    return shapely.get_coordinates(shapely.simplify(shapely.LineString(course), BOW * spread, preserve_topology=False))


def _parts(line: FloatArray, corners: FloatArray, along: FloatArray, own: IntArray, claimed: IntArray) -> list[Wall]:
    """A wall for each straight part, with the pieces beside it."""
    direction, across = line[2:], np.array((-line[3], line[2]))
    points = line[:2] + corners[:, :1] * direction + corners[:, 1:] * across
    borders = corners[1:-1, 0]
    part_own, part_claimed = (np.searchsorted(borders, along[rows]) for rows in (own, claimed))
    return [
        Wall(np.concatenate(points[k : k + 2]), own[part_own == k], claimed[part_claimed == k])
        for k in range(len(points) - 1)
    ]
