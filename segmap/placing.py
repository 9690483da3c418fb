"""Any pose of two maps: judged like a candidate, laid by pairs of segments, settled to the best nearby.

For poses no search on the pair found: those another program claims, and those a person lays by hand.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from segmap.errors import MapError
from segmap.evaluation import evaluate, matching_values
from segmap.matches import Candidate
from segmap.parameters import Parameters
from segmap.pose import FloatArray, Pose2, wrap
from segmap.segments import SegmentMap
from segmap.verification import Verified, Views, judged, verify, views
from segmap.visibility import evidence, look, score

__all__ = ["REACH", "Tie", "judged_at", "laid", "settled"]

Tie = tuple[int, int]
"""a segment of map 1, and the segment of map 2 that is to lie on it"""

REACH = 0.6, math.radians(12.0)
"""metres and radians; what lies farther from a pose is not nearby"""
SHIFTS, TURNS = (0.0, 0.15, -0.15, 0.3, -0.3), (0.0, 4.0, -4.0, 8.0, -8.0)
"""metres and degrees around the pose; from where to look for the best nearby"""
CLIMB = (0.08, 0.03, 0.01, 0.003, 0.001)
"""metres, and radians in a map of one metre: the steps of the climb to the best value"""
ROUNDS = 12
"""steps of each size at most"""
CLEARLY = 0.1
"""share of its score by which a pose is clearly better"""
ALONG = 1e-3
"""weight of the places along the segments, against those across: it decides only where nothing else does"""


def judged_at(
    map_1: SegmentMap, map_2: SegmentMap, T_1_2: Pose2, parameters: Parameters, mode: str, index: int
) -> Candidate:
    """Any pose as a candidate of place ``index``: its value, and in verified mode its evidence."""
    value = float(matching_values(map_1, map_2, T_1_2, parameters)[1].sum())
    plain = Candidate(T_1_2, value, (0, 0), (0, 0), index)
    seen = views(map_1, map_2, parameters) if mode == "verified" else None
    found = None if seen is None else judged(seen, np.array([index]), np.array([tuple(T_1_2)]), parameters)
    if found is None or not len(found.rows) or not parameters.use_sights:
        return plain
    return replace(plain, score=float(found.merits[0]), evidence=evidence(found.totals[0]), uncertainty=found.held[0])


def laid(map_1: SegmentMap, map_2: SegmentMap, ties: Sequence[Tie], parameters: Parameters) -> Pose2:
    """The pose ``T_1_2`` that lays segments of map 2 on the lines of segments of map 1.

    Two pairs that are not parallel determine it, as an angle does (III-A); where all are parallel, the middles
    of the segments decide how far along. Which way round, the value says.

    Raises:
        MapError: there is no pair, or no such segment.
    """
    _refuse_unknown(map_1, map_2, ties)
    walls = np.array([map_1.coordinates[i] for i, _ in ties])
    others = np.array([map_2.coordinates[j] for _, j in ties])
    turn = _turn(walls, others)
    poses = [_shifted(walls, others, wrap(turn + half)) for half in (0.0, math.pi)]
    worth = [matching_values(map_1, map_2, pose, parameters)[1].sum() for pose in poses]
    return poses[int(worth[1] > worth[0])]


def _refuse_unknown(map_1: SegmentMap, map_2: SegmentMap, ties: Sequence[Tie]) -> None:
    if not ties:
        raise MapError("A pose takes at least one pair of segments, better two: choose them.")
    for i, j in ties:
        if not (0 <= i < len(map_1) and 0 <= j < len(map_2)):
            raise MapError(f"There is no pair of segments {i} and {j}: the maps have {len(map_1)} and {len(map_2)}.")


def _turn(walls: FloatArray, others: FloatArray) -> float:
    """Radians, up to half a turn, that make lines parallel; the longer ones count for more."""
    double = 2.0 * (_headings(walls) - _headings(others))
    weights = np.minimum(_lengths(walls), _lengths(others))
    return 0.5 * math.atan2(float(weights @ np.sin(double)), float(weights @ np.cos(double)))


def _headings(segments: FloatArray) -> FloatArray:
    headings: FloatArray = np.arctan2(segments[:, 3] - segments[:, 1], segments[:, 2] - segments[:, 0])
    return headings


def _lengths(segments: FloatArray) -> FloatArray:
    lengths: FloatArray = np.hypot(segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1])
    return lengths


def _shifted(walls: FloatArray, others: FloatArray, theta: float) -> Pose2:
    """The pose of a heading whose segments lie nearest to the lines they belong to, by least squares."""
    middles = (others[:, :2] + others[:, 2:]) / 2.0
    gaps = (walls[:, :2] + walls[:, 2:]) / 2.0 - Pose2(0.0, 0.0, theta) @ middles
    along = _headings(walls)
    across = np.column_stack((-np.sin(along), np.cos(along)))
    weights = across[:, :, None] * across[:, None, :] + ALONG * np.eye(2)
    x, y = np.linalg.solve(weights.sum(axis=0), np.einsum("kij,kj->i", weights, gaps))
    return Pose2(float(x), float(y), theta)


def settled(map_1: SegmentMap, map_2: SegmentMap, T_1_2: Pose2, parameters: Parameters, mode: str) -> Pose2:
    """The best pose near ``T_1_2``, at most ``REACH`` away: by score in verified mode, by value in paper mode.

    A local search: refinement from a grid of poses around it, as verified mode refines candidates, then in
    paper mode a climb to the best value. Where nothing nearby is better, the pose stays what it is.
    """
    seen = views(map_1, map_2, parameters)
    around = _around(T_1_2)
    found = None if seen is None else verify(seen, around, parameters)
    if mode == "verified" and parameters.use_sights and seen is not None and found is not None:
        return _best_seen(T_1_2, seen, found, parameters)
    poses = around if found is None else np.concatenate((around, found.poses))
    return _best_matching(map_1, map_2, T_1_2, poses, parameters)


def _around(T_1_2: Pose2) -> FloatArray:
    """Poses (k, 3) around one, itself the first."""
    shifts = product(SHIFTS, SHIFTS, TURNS)
    return np.array([(T_1_2.x + x, T_1_2.y + y, wrap(T_1_2.theta + math.radians(turn))) for x, y, turn in shifts])


def _nearby(T_1_2: Pose2, poses: FloatArray) -> FloatArray:
    """Those of some poses (k, 3) that are within reach."""
    distances = [T_1_2.distance(Pose2(*pose)) for pose in poses.tolist()]
    near: FloatArray = poses[[shift <= REACH[0] and turn <= REACH[1] for shift, turn in distances]]
    return near


def _best_seen(T_1_2: Pose2, seen: Views, found: Verified, parameters: Parameters) -> Pose2:
    """The best refined pose within reach. The score tells poses apart only beyond the tolerance of lines of sight,
    so the pose itself is kept only where it scores clearly more.
    """
    poses = np.concatenate(([tuple(T_1_2)], _nearby(T_1_2, found.poses)))
    scores = score(look(*seen.seen, poses, parameters), parameters)
    scores[0] -= CLEARLY * abs(scores[0])
    best = int(np.argmax(scores[::-1]))  # from the end: of equal ones not the pose itself
    return Pose2(*map(float, poses[::-1][best]))


def _best_matching(
    map_1: SegmentMap, map_2: SegmentMap, T_1_2: Pose2, poses: FloatArray, parameters: Parameters
) -> Pose2:
    """The best value within reach, climbing from the best of some poses by ever smaller steps."""
    reach = max(1.0, float(np.abs(map_2.coordinates).max(initial=0.0)))

    def values(poses: FloatArray) -> FloatArray:
        return np.nan_to_num(evaluate(map_1, map_2, poses, parameters), nan=-1.0)

    near = np.concatenate(([tuple(T_1_2)], _nearby(T_1_2, poses)))
    held = values(near)
    best, worth = near[np.argmax(held)], float(held.max())
    for step in CLIMB:
        for _ in range(ROUNDS):
            tried = np.array([best + move for move in _moves(step, step / reach)])
            tried = _nearby(T_1_2, tried)
            held = values(tried) if len(tried) else np.array([-1.0])
            if held.max() <= worth:
                break
            best, worth = tried[np.argmax(held)], float(held.max())
    return Pose2(float(best[0]), float(best[1]), wrap(float(best[2])))


def _moves(shift: float, turn: float) -> list[FloatArray]:
    """One step along, or around, every axis."""
    steps = product((0.0, shift, -shift), (0.0, shift, -shift), (0.0, turn, -turn))
    return [np.array(step) for step in steps if any(step)]
