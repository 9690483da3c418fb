"""Candidate -> line-of-sight support and conflict: what the beams of one map say of the points of the other.

A scan is not only segments: each beam says that the space before its return is empty. Under a candidate,
a return of one map is *supported* where the other map's sensors see a surface at it, *contradicted* where
they see through it, *shadowed* where it lies close behind a surface they see, and *unseen* otherwise. Each
return weighs as many metres as its beam is wide there, so that a near wall does not outvote the far end of
a corridor. What several scans of a map saw weighs as if one of them had seen it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from segmap import _sight_kernels as kernels
from segmap._hold_kernels import look_closely as look_beside_walls
from segmap._sight_kernels import Sighting
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray, Pose2
from segmap.segments import SegmentMap, Sight

__all__ = [
    "CLASS_NAMES",
    "Evidence",
    "Sighting",
    "classes",
    "evidence",
    "look",
    "look_closely",
    "score",
    "sensors",
    "sighting",
    "thinned",
]

CLASS_NAMES = ("supported", "contradicted", "shadowed", "unseen")
"""the classes by number, and the columns of totals"""

WIDEST = 0.5
"""metres; no return weighs more"""
SURFACE_GAP = 0.5
"""metres; two neighbouring returns closer than this are taken as one surface"""
GRAZING_GAP = 4.0
"""metres; and so are two closer than this, where a beam's neighbour shows that it grazes a wall:"""
GRAZING_RATIO = 2.5
"""the gap beside is at least this part of theirs,"""
GRAZING_ACROSS = 0.04
"""metres; and the return beyond it is this close to their line"""
WALLS = 12
"""longest segments of each map, along which its walls run"""
WALL_REACH = 0.15
"""metres; what is nearer to the line of a wall is of the wall"""
SAME_PLACE = 0.2
"""metres; returns of several scans of a map this close to a surface that others see are of that surface"""


@dataclass(frozen=True)
class Evidence:
    """What lines of sight say of a candidate, in metres of wall as wide as the beams that met it."""

    supported: float
    contradicted: float
    shadowed: float
    """close behind a surface that the other map sees"""
    unseen: float
    off_two: float = 0.0
    """supported off the two strongest walls: more than a corridor has; known of candidates of verified mode"""
    off_three: float = 0.0
    """supported off the three strongest walls: more than most of a plain room has"""

    @property
    def agreement(self) -> float:
        """Share of what both maps could judge that is supported, in 0..1; 0 where there is nothing to judge."""
        judged = self.supported + self.contradicted + self.shadowed
        return self.supported / judged if judged > 0.0 else 0.0

    @property
    def consistency(self) -> float:
        """Share of what is supported or seen through that is supported, in 0..1; 0 where there is nothing."""
        judged = self.supported + self.contradicted
        return self.supported / judged if judged > 0.0 else 0.0

    @property
    def overlap(self) -> float:
        """Share of all returns that are supported, in 0..1."""
        total = self.supported + self.contradicted + self.shadowed + self.unseen
        return self.supported / total if total > 0.0 else 0.0


def sighting(segment_map: SegmentMap, max_range: float | None = None) -> Sighting | None:
    """What the scans of a map saw, in arrays; None where the map knows of no scan.

    Returns beyond ``max_range`` metres are none.
    """
    sights = [_limited(sight, max_range) for sight in segment_map.sights]
    sights = [sight for sight in sights if np.isfinite(sight.scan.ranges).any()]
    if not sights:
        return None
    points = np.concatenate([_points(sight) for sight in sights])
    beams, eyes = sensors(sights)
    mean = float(points[:, 2].sum()) / len(eyes)
    if len(eyes) > 1:
        points[:, 2] /= kernels.witnesses(points, beams, eyes, SAME_PLACE, SURFACE_GAP)
    return Sighting(points, beams, eyes, mean)


def sensors(sights: Sequence[Sight]) -> tuple[FloatArray, FloatArray]:
    """The beams and the sensors of some sights, one at least, as a :class:`Sighting` has them."""
    beams = np.concatenate([_beams(sight) for sight in sights])
    starts = np.cumsum([0] + [len(sight.scan) for sight in sights])
    return beams, np.array([_sensor(sight, start) for sight, start in zip(sights, starts, strict=False)])


def _limited(sight: Sight, max_range: float | None) -> Sight:
    if max_range is None or not (sight.scan.ranges > max_range).any():
        return sight
    return Sight(sight.T_map_sensor, replace(sight.scan, max_range=np.nextafter(max_range, np.inf)))


def _points(sight: Sight) -> FloatArray:
    points, beams = sight.scan.returns()
    widths = np.minimum(sight.scan.ranges[beams] * abs(sight.scan.angle_step), WIDEST)
    return np.column_stack((sight.T_map_sensor @ points, widths))


def _beams(sight: Sight) -> FloatArray:
    ranges, angles, ring = sight.scan.ranges, sight.scan.angles, sight.scan.all_round
    x, y = ranges * np.cos(angles), ranges * np.sin(angles)
    around = np.stack([_neighbour(ranges, step, ring) for step in (-1, 0, 1, 2)])
    bulge = np.cos(min(abs(sight.scan.angle_step), np.pi) / 2.0)  # the line between two returns passes in front of both
    return np.column_stack(
        (
            x,
            y,
            ranges,
            bulge * np.fmin.reduce(around, axis=0, initial=np.inf),
            np.fmax.reduce(around, axis=0, initial=-np.inf),
            _grazes(np.stack([_neighbour(x, step, ring) + 1j * _neighbour(y, step, ring) for step in (-1, 0, 1, 2)])),
        )
    )


def _grazes(around: NDArray[np.complex128]) -> FloatArray:
    """1 where a wall at a grazing angle goes on from each beam's return to the next one's, 0 elsewhere, (n,).

    The returns of one wall are the farther apart the farther away they are, each gap not much longer than the one
    before; where the surface ends they jump. ``around`` (4, n): the places before, of, after and two after a beam.
    """
    before, chord, after = np.diff(around, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        length = np.abs(chord)
        goes_on = np.zeros(len(chord), bool)
        for beside in (before * chord.conj() / length, after * chord.conj() / length):
            goes_on |= (beside.real * GRAZING_RATIO > length) & (np.abs(beside.imag) < GRAZING_ACROSS)
        return (goes_on & (length < GRAZING_GAP)).astype(np.float64)


def _neighbour(entries: FloatArray, step: int, ring: bool) -> FloatArray:
    """The entry of the beam ``step`` beams on, NaN beyond the last one."""
    beams = np.arange(len(entries)) + step
    shifted = entries[beams % len(entries)]
    return shifted if ring else np.where((beams >= 0) & (beams < len(entries)), shifted, np.nan)


def _sensor(sight: Sight, start: int) -> tuple[float, ...]:
    T, scan = sight.T_map_sensor, sight.scan
    return np.cos(T.theta), np.sin(T.theta), T.x, T.y, scan.first_angle, scan.angle_step, float(start), len(scan)


def thinned(seen: Sighting, most: int) -> Sighting:
    """The same sensors with at most about ``most`` points each, evenly taken; each stands for those left out."""
    stride = max(1, round(len(seen.points) / (most * len(seen.sensors))))
    if stride == 1:
        return seen
    points = seen.points[stride // 2 :: stride].copy()
    points[:, 2] *= stride
    return seen._replace(points=points)


def look(seen_1: Sighting, seen_2: Sighting, poses: FloatArray, parameters: Parameters) -> FloatArray:
    """For each ``T_1_2`` of poses (k, 3): metres supported, contradicted, shadowed and unseen, (k, 4)."""
    totals: FloatArray = kernels.look(
        seen_1, seen_2, poses, parameters.sight_tolerance, SURFACE_GAP, parameters.shadow_depth
    )
    return totals


def look_closely(
    maps: tuple[SegmentMap, SegmentMap], seen: tuple[Sighting, Sighting], poses: FloatArray, parameters: Parameters
) -> FloatArray:
    """The totals of :func:`look`, and the metres supported off the two and off the three strongest walls, (k, 6).

    One room or corridor is much like another: what tells them apart is what is not on their plain walls.
    """
    options = parameters.sight_tolerance, SURFACE_GAP, parameters.shadow_depth, WALL_REACH
    found: FloatArray = look_beside_walls(*seen, _longest(maps[0]), _longest(maps[1]), poses, *options)
    return found[:, [*range(kernels.CLASSES), kernels.CLASSES + 1, kernels.CLASSES + 2]]


def _longest(segment_map: SegmentMap) -> FloatArray:
    rows: FloatArray = segment_map.coordinates[np.argsort(-segment_map.lengths, kind="stable")[:WALLS]]
    return rows


def score(totals: FloatArray, parameters: Parameters) -> FloatArray:
    """What candidates are ranked by, metres: support less what speaks against it; of (k, 4) totals or more, (k,)."""
    weights = (1.0, -parameters.conflict_weight, -parameters.shadow_weight, -parameters.unseen_weight)
    return totals[:, : kernels.CLASSES] @ np.array(weights)


def evidence(totals: FloatArray) -> Evidence:
    """One row of totals, by name; with what is off the walls, if it is there."""
    return Evidence(*totals.tolist())


def classes(seen_1: Sighting, seen_2: Sighting, T_1_2: Pose2, parameters: Parameters) -> tuple[IntArray, IntArray]:
    """The class of each point of map 1 and of each of map 2 under a candidate, for drawing."""
    options = parameters.sight_tolerance, SURFACE_GAP, parameters.shadow_depth
    return _classified(seen_1, seen_2, T_1_2.inverse(), options), _classified(seen_2, seen_1, T_1_2, options)


def _classified(seen: Sighting, by: Sighting, T_by_seen: Pose2, options: tuple[float, float, float]) -> IntArray:
    cosine, sine = float(np.cos(T_by_seen.theta)), float(np.sin(T_by_seen.theta))
    found: IntArray = kernels.classify(
        seen.points, cosine, sine, T_by_seen.x, T_by_seen.y, by.beams, by.sensors, *options
    )
    return found
