"""Walls that all but meet, made to meet."""

from __future__ import annotations

import math

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from segmap.pose import FloatArray, IntArray
from segmap.segments import LEAST_LENGTH

__all__ = ["met"]

REACH = 0.2
"""metres; an end moves no farther"""
SHARE = 0.35
"""of its wall's length; nor farther than this"""
BEND = math.sin(math.radians(15.0))
"""sine; walls at smaller angles go on rather than meet"""
BRANCH = 0.5
"""sine; at smaller angles a wall does not end at another's side"""


def met(edges: FloatArray, spread: float) -> FloatArray:
    """Edges (n, 4) with ends that are near each other where their lines meet, or half-way where one goes on.

    Then ends near the side of another edge are moved along their own line to it. No edge turns by more than
    ``spread`` metres at its ends, and none is moved farther than a share of its length.
    """
    if len(edges) < 2:
        return edges
    joined, used = _joined(edges, spread)
    return _branched(joined, used)


def _joined(edges: FloatArray, spread: float) -> tuple[FloatArray, NDArray[np.bool_]]:
    """End to end, the nearest first; each end once. End 2 i is the start of edge i, end 2 i + 1 its end."""
    ends = edges.reshape(-1, 2).copy()
    used = np.zeros(len(ends), bool)
    pairs = cKDTree(ends).query_pairs(2.0 * REACH, output_type="ndarray")
    pairs = pairs[pairs[:, 0] // 2 != pairs[:, 1] // 2]
    points, moves = _meeting(edges, pairs, spread)
    for row in np.lexsort((pairs[:, 1], pairs[:, 0], moves)).tolist():
        a, b = pairs[row]
        if math.isfinite(moves[row]) and not (used[a] or used[b]):
            ends[[a, b]] = points[row]
            used[[a, b]] = True
    return ends.reshape(-1, 4), used


def _meeting(edges: FloatArray, pairs: IntArray, spread: float) -> tuple[FloatArray, FloatArray]:
    """Where two ends would meet, (k, 2), and how far the farther one has to move; inf: too far."""
    ends, ways = edges.reshape(-1, 2), _ways(edges)
    lengths = np.hypot(*(edges[:, 2:] - edges[:, :2]).T)
    (a, b), (i, j) = pairs.T, (pairs // 2).T
    sine = _cross(ways[i], ways[j])
    with np.errstate(divide="ignore", invalid="ignore"):
        share = _cross(ends[b] - ends[a], ways[j]) / sine
        corner = ends[a] + share[:, None] * ways[i]
    goes_on = (np.abs(sine) < BEND) & (a % 2 != b % 2) & ((ways[i] * ways[j]).sum(axis=1) > 0.0)
    half_way = (ends[a] + ends[b]) / 2.0
    aside = np.maximum(*(np.abs(_cross(half_way - ends[e], ways[w])) for e, w in ((a, i), (b, j))))
    goes_on &= aside <= spread / 2.0
    points = np.where(goes_on[:, None], half_way, corner)
    moves = np.stack([np.hypot(*(points - ends[e]).T) for e in (a, b)])
    most = np.minimum(REACH, np.stack((SHARE * lengths[i], SHARE * lengths[j])))
    fits = (goes_on | (np.abs(sine) >= BEND)) & (moves <= most).all(axis=0)
    return points, np.where(fits, moves.max(axis=0), np.inf)


def _branched(edges: FloatArray, used: NDArray[np.bool_]) -> FloatArray:
    """Ends that met nothing, moved along their line to the nearest side they all but reach, or pass a little."""
    ends, ways = edges.reshape(-1, 2).copy(), _ways(edges)
    lengths = np.hypot(*(edges[:, 2:] - edges[:, :2]).T)
    lines, points = shapely.linestrings(edges.reshape(-1, 2, 2)), shapely.points(ends)
    end, side = shapely.STRtree(lines).query(points, predicate="dwithin", distance=REACH)
    other = (end // 2 != side) & ~used[end] & (np.abs(_cross(ways[end // 2], ways[side])) >= BRANCH)
    end, side = end[other], side[other]
    shift = _cross(edges[side, :2] - ends[end], ways[side]) / _cross(ways[end // 2], ways[side])
    hits = ends[end] + shift[:, None] * ways[end // 2]
    place = ((hits - edges[side, :2]) * ways[side]).sum(axis=1)
    fits = (np.abs(shift) <= np.minimum(REACH, SHARE * lengths[end // 2])) & (place >= 0.0) & (place <= lengths[side])
    for row in np.lexsort((side, end, np.abs(shift))).tolist():
        if fits[row] and not used[end[row]]:
            ends[end[row]] = hits[row]
            used[end[row]] = True
    return ends.reshape(-1, 4)


def _ways(edges: FloatArray) -> FloatArray:
    """Unit directions."""
    way = edges[:, 2:] - edges[:, :2]
    return way / np.maximum(np.hypot(*way.T), LEAST_LENGTH)[:, None]


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
