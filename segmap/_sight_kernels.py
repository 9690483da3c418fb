"""The inner loops over beams: lines of sight. Same rules as :mod:`segmap._kernels`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from segmap.pose import FloatArray, IntArray

__all__ = [
    "CLASSES",
    "CONTRADICTED",
    "SHADOWED",
    "SUPPORTED",
    "UNSEEN",
    "Sighting",
    "classify",
    "distinct",
    "look",
    "witnesses",
]

SUPPORTED, CONTRADICTED, SHADOWED, UNSEEN = range(4)
CLASSES = 4

_compiled = njit(cache=True, nogil=True, error_model="numpy")
_inlined = njit(cache=True, nogil=True, error_model="numpy", inline="always")


class Sighting(NamedTuple):
    """What some sensors saw of a map, in arrays."""

    points: FloatArray
    """(m, 3): x, y of returns in the map's frame, and the width of the beam there, metres, shared by the returns of
    as many sensors as saw that place"""
    beams: FloatArray
    """(n, 6): of every beam of every sensor, x, y in the sensor's frame and range (NaN: no return), the least and
    the largest range of the surface around it, one beam before to two after (inf and -inf: none), and 1 where
    the surface goes on to the next beam's return however far that is, 0 otherwise"""
    sensors: FloatArray
    """(s, 8): cosine, sine, x, y of the sensor's pose; first angle, angle step; first beam, number of beams"""
    mean: float
    """metres: the width of all returns of one scan, as the mean of the scans"""


@_inlined
def _beam_of(x, y, sensors, s):  # type: ignore[no-untyped-def]
    """The beam at or just before the direction of a point of the sensor's frame; negative: before the first."""
    turn = 2.0 * math.pi / abs(sensors[s, 5])
    beam = (math.atan2(y, x) - sensors[s, 4]) / sensors[s, 5]
    beam -= turn * math.floor(beam / turn)
    if beam >= sensors[s, 7] and beam - sensors[s, 7] > turn - beam - 1.0:  # nearer to the first than to the last
        beam -= turn
    return math.floor(beam)


@_inlined
def _wrapped(beam, sensors, s):  # type: ignore[no-untyped-def]
    """The row of a beam among all beams; -1 where the sensor has none there."""
    count = int(sensors[s, 7])
    if beam < 0 or beam >= count:
        if (count + 0.5) * abs(sensors[s, 5]) < 2.0 * math.pi:
            return -1
        beam = (beam + count) % count
    return int(sensors[s, 6]) + beam


@_compiled
def _surface_distance(x, y, beam, beams, sensors, s, gap):  # type: ignore[no-untyped-def]
    """Squared distance of a point from the surface seen around a beam: returns, joined where it goes on."""
    nearest = np.inf
    for step in range(-1, 3):
        a = _wrapped(beam + step, sensors, s)
        if a < 0 or math.isnan(beams[a, 2]):
            continue
        dx = x - beams[a, 0]
        dy = y - beams[a, 1]
        nearest = min(nearest, dx * dx + dy * dy)
        b = _wrapped(beam + step + 1, sensors, s) if step < 2 else -1
        if b < 0 or math.isnan(beams[b, 2]):
            continue
        ex = beams[b, 0] - beams[a, 0]
        ey = beams[b, 1] - beams[a, 1]
        squared = ex * ex + ey * ey
        if 0.0 < dx * ex + dy * ey < squared and (squared < gap * gap or beams[a, 5] > 0.0):
            nearest = min(nearest, (dx * ey - dy * ex) ** 2 / squared)
    return nearest


@_compiled
def _seen_by(x, y, beams, sensors, s, tolerance, gap, depth):  # type: ignore[no-untyped-def]
    """How one sensor sees a point of the map: one of the classes."""
    dx = x - sensors[s, 2]
    dy = y - sensors[s, 3]
    local_x = sensors[s, 0] * dx + sensors[s, 1] * dy
    local_y = sensors[s, 0] * dy - sensors[s, 1] * dx
    beam = _beam_of(local_x, local_y, sensors, s)
    a = _wrapped(beam, sensors, s)
    b = _wrapped(beam + 1, sensors, s)
    if a < 0 and b < 0:
        return UNSEEN
    distance = math.sqrt(local_x * local_x + local_y * local_y)
    around = max(a, int(sensors[s, 6]))
    within = beams[around, 3] - tolerance <= distance <= beams[around, 4] + tolerance
    if within and _surface_distance(local_x, local_y, beam, beams, sensors, s, gap) <= tolerance * tolerance:
        return SUPPORTED
    if a < 0 or b < 0:
        return UNSEEN
    before = beams[a, 2]
    after = beams[b, 2]
    if distance < before and distance < after:  # false for NaN, beams without a return
        return CONTRADICTED
    if distance > before and distance > after and distance - max(before, after) < depth:
        return SHADOWED
    return UNSEEN


@_compiled
def _class_of(x, y, beams, sensors, tolerance, gap, depth):  # type: ignore[no-untyped-def]
    """How all sensors together see a point: supported by one outweighs contradicted by another, and so on."""
    seen = UNSEEN
    for s in range(len(sensors)):
        seen = min(seen, _seen_by(x, y, beams, sensors, s, tolerance, gap, depth))
        if seen == SUPPORTED:
            break
    return seen


@_compiled
def classify(
    points: FloatArray,
    cosine: float,
    sine: float,
    x: float,
    y: float,
    beams: FloatArray,
    sensors: FloatArray,
    tolerance: float,
    gap: float,
    depth: float,
) -> IntArray:
    """The class of each point (m, 3) of another map, moved by a pose into the frame of the sensors."""
    classes = np.empty(len(points), np.int64)
    for k in range(len(points)):
        px = cosine * points[k, 0] - sine * points[k, 1] + x
        py = sine * points[k, 0] + cosine * points[k, 1] + y
        classes[k] = _class_of(px, py, beams, sensors, tolerance, gap, depth)
    return classes


@_compiled
def look(
    sighting_1: Sighting, sighting_2: Sighting, poses: FloatArray, tolerance: float, gap: float, depth: float
) -> FloatArray:
    """For each ``T_1_2`` of poses (k, 3): metres of beam width in each class, (k, 4), both ways together.

    Of a map of several scans everything that is judged counts, and no more is unseen than one scan would have.
    """
    totals = np.zeros((len(poses), CLASSES))
    kinds_1 = np.empty(len(sighting_1.points), np.int64)
    kinds_2 = np.empty(len(sighting_2.points), np.int64)
    for k in range(len(poses)):
        _look_at(sighting_1, sighting_2, poses[k], tolerance, gap, depth, totals[k], kinds_1, kinds_2)
    return totals


@_compiled
def _look_at(sighting_1, sighting_2, pose, tolerance, gap, depth, totals, kinds_1, kinds_2):  # type: ignore[no-untyped-def]
    """Add the metres by class, and set the class of each point of both maps, at one pose."""
    cosine = math.cos(pose[2])
    sine = math.sin(pose[2])
    x = pose[0]
    y = pose[1]
    _add_classes(totals, kinds_2, sighting_2, cosine, sine, x, y, sighting_1, tolerance, gap, depth)
    back_x = -cosine * x - sine * y
    back_y = sine * x - cosine * y
    _add_classes(totals, kinds_1, sighting_1, cosine, -sine, back_x, back_y, sighting_2, tolerance, gap, depth)


@_compiled
def _add_classes(totals, kinds, seen, cosine, sine, x, y, by, tolerance, gap, depth):  # type: ignore[no-untyped-def]
    """Add the metres of one map's points, moved into the frame of another map's sensors, by class."""
    points = seen.points
    before = totals[UNSEEN]
    judged = 0.0
    for q in range(len(points)):
        px = cosine * points[q, 0] - sine * points[q, 1] + x
        py = sine * points[q, 0] + cosine * points[q, 1] + y
        found = _class_of(px, py, by.beams, by.sensors, tolerance, gap, depth)
        kinds[q] = found
        totals[found] += points[q, 2]
        judged += points[q, 2] if found != UNSEEN else 0.0
    if len(seen.sensors) > 1:
        totals[UNSEEN] = min(totals[UNSEEN], before + max(0.0, seen.mean - judged))


@_compiled
def witnesses(points: FloatArray, beams: FloatArray, sensors: FloatArray, tolerance: float, gap: float) -> FloatArray:
    """How many of a map's sensors see a surface at each of its points (m, 3), (m,), at least 1."""
    counts = np.ones(len(points))
    for k in range(len(points)):
        seen = 0
        for s in range(len(sensors)):
            if _seen_by(points[k, 0], points[k, 1], beams, sensors, s, tolerance, gap, 0.0) == SUPPORTED:
                seen += 1
        counts[k] = max(1, seen)
    return counts


@_compiled
def distinct(poses: FloatArray, order: IntArray, distance: float, angle: float, most: int) -> IntArray:
    """The first ``most`` of ``order`` that are each farther than ``distance`` or ``angle`` from all before."""
    kept = np.empty(min(most, len(order)), np.int64)
    count = 0
    for k in order:
        if count == len(kept):
            break
        alone = True
        for i in range(count):
            other = poses[kept[i]]
            dx = poses[k, 0] - other[0]
            dy = poses[k, 1] - other[1]
            turn = abs(poses[k, 2] - other[2]) % (2.0 * math.pi)
            if dx * dx + dy * dy < distance * distance and min(turn, 2.0 * math.pi - turn) < angle:
                alone = False
                break
        if alone:
            kept[count] = k
            count += 1
    return kept[:count]
