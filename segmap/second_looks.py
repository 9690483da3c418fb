"""Placed scans -> those that all around them see better elsewhere nearby: a few pairs misled them together.

Two scans that share one wall know little of their turn, and pairs that share the same wall err alike. What tells
is everything that the scans around see, together.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from segmap.consensus import JOINT_GATES, RETURNS, sightings
from segmap.parameters import Parameters
from segmap.pose import FloatArray, Pose2
from segmap.refinement import refined
from segmap.scans import ScanId
from segmap.segments import SegmentMap
from segmap.spreading import Matches, Pair
from segmap.visibility import look, score, sighting, thinned

__all__ = ["better_places"]

AROUND = 6
"""scans that look at each together"""
SAID = 4
"""candidates of each match that may be right after all, the best ones"""
NEAR = 0.5, math.radians(15.0)
"""metres and radians; what lies farther from where a scan is, the graph has ruled out"""
SAME = 0.2, math.radians(3.0)
"""metres and radians; what is nearer the graph weighs better: the scans around have drifted a little themselves"""
TWICE = 0.05, math.radians(1.0)
"""metres and radians; of places nearer to each other one is looked at"""
MOST = 12
"""places that are looked at, of each scan"""
STEPS = 6
CLEARLY = 0.5, 0.1
"""metres, and share of its score, by which another place must be better"""


def better_places(
    maps: Mapping[ScanId, SegmentMap],
    keys: Sequence[ScanId],
    poses: Mapping[ScanId, Pose2],
    matches: Matches,
    parameters: Parameters,
) -> Iterator[tuple[ScanId, Pose2, tuple[ScanId, ...]]]:
    """The keyframes of a component that lie clearly better elsewhere nearby: where, and by whose joint view.

    Looked at are the places that candidates of their pairs say, from where the other scans are.
    """
    said = _matches_by_scan(keys, matches)
    states = np.array([tuple(poses[key]) for key in keys]).reshape(-1, 3)
    for i, key in enumerate(keys):
        places = list(_places(key, said[key], poses, matches))[:MOST]
        around = tuple(keys[k] for k in _nearest(states, i))
        better = _better(maps, key, places, around, poses, parameters) if places and around else None
        if better is not None:
            yield key, better, around


def _matches_by_scan(keys: Sequence[ScanId], matches: Matches) -> dict[ScanId, list[Pair]]:
    said: dict[ScanId, list[Pair]] = {key: [] for key in keys}
    for pair in sorted(matches):
        if all(scan in said for scan in pair):
            said[pair[0]].append(pair)
            said[pair[1]].append(pair)
    return said


def _places(key: ScanId, pairs: Sequence[Pair], poses: Mapping[ScanId, Pose2], matches: Matches) -> Iterator[Pose2]:
    """Where else nearby candidates put a scan."""
    given: list[Pose2] = []
    for first, second in pairs:
        for candidate in matches[first, second].ranked[:SAID]:
            T = poses[first] @ candidate.T_1_2 if key == second else poses[second] @ candidate.T_1_2.inverse()
            elsewhere = _within(T, poses[key], NEAR) and not _within(T, poses[key], SAME)
            if elsewhere and not any(_within(T, other, TWICE) for other in given):
                given.append(T)
                yield T


def _within(T: Pose2, other: Pose2, limits: tuple[float, float]) -> bool:
    distance, turn = T.distance(other)
    return distance < limits[0] and turn < limits[1]


def _nearest(states: FloatArray, i: int) -> list[int]:
    """The few scans nearest to one in place and heading, a metre for a radian."""
    shift, turn = states[:, :2] - states[i, :2], states[:, 2] - states[i, 2]
    far = np.hypot(*shift.T) + np.abs((turn + np.pi) % (2.0 * np.pi) - np.pi)
    far[i] = np.inf
    order = np.argsort(far, kind="stable")[:AROUND]
    return [int(k) for k in order if k != i]


def _better(
    maps: Mapping[ScanId, SegmentMap],
    key: ScanId,
    places: Sequence[Pose2],
    around: Sequence[ScanId],
    poses: Mapping[ScanId, Pose2],
    parameters: Parameters,
) -> Pose2 | None:
    """The best of some places, if the joint view of the scans around has it clearly better than where the scan is."""
    back = poses[around[0]].inverse()
    view = sighting(SegmentMap.joined(maps[scan].moved(back @ poses[scan]) for scan in around))
    seen = sightings(maps, [key]).get(key)
    if view is None or seen is None:
        return None
    view, here = thinned(view, RETURNS), back @ poses[key]
    tried = np.array([tuple(back @ T) for T in (poses[key], *places)])
    found = np.concatenate(([tuple(here)], refined(view, seen, tried, STEPS, *JOINT_GATES)))
    scores = score(look(view, seen, found, parameters), parameters)
    best, now = int(np.argmax(scores)), float(scores[0])
    T = Pose2(*map(float, found[best]))
    if scores[best] <= now + max(CLEARLY[0], CLEARLY[1] * abs(now)) or _within(T, here, SAME):
        return None
    return poses[around[0]] @ T
