"""The inner loops of refinement against every beam: the slow twin of :mod:`segmap._field_kernels`.

Same rules as :mod:`segmap._kernels`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from segmap._sight_kernels import Sighting, _beam_of, _wrapped
from segmap._stepping import step_down
from segmap.pose import FloatArray

__all__ = ["normal_equations", "refine"]

NEIGHBOURS = 3
"""beams to either side of a point's own in which refinement looks for its surface"""

_compiled = njit(cache=True, nogil=True, error_model="numpy")
_inlined = njit(cache=True, nogil=True, error_model="numpy", inline="always")


@_compiled
def _surface_line(x, y, beam, beams, sensors, s, gate, gap, line):  # type: ignore[no-untyped-def]
    """The line of the surface nearest to a point of the sensor's frame: ``line`` = nx, ny, offset; its distance."""
    nearest = gate
    for step in range(-NEIGHBOURS, NEIGHBOURS + 1):
        a = _wrapped(beam + step, sensors, s)
        b = _wrapped(beam + step + 1, sensors, s)
        if a < 0 or b < 0 or math.isnan(beams[a, 2]) or math.isnan(beams[b, 2]):
            continue
        ex = beams[b, 0] - beams[a, 0]
        ey = beams[b, 1] - beams[a, 1]
        squared = ex * ex + ey * ey
        if squared == 0.0 or (squared > gap * gap and beams[a, 5] == 0.0):
            continue
        dx = x - beams[a, 0]
        dy = y - beams[a, 1]
        share = (dx * ex + dy * ey) / squared
        if share < -0.5 or share > 1.5:
            continue
        share = min(1.0, max(0.0, share))
        distance = math.sqrt((dx - share * ex) ** 2 + (dy - share * ey) ** 2)
        if distance < nearest:
            nearest = distance
            _line_through(beam + step, beams, sensors, s, gap, line)
    return nearest


@_compiled
def _line_through(beam, beams, sensors, s, gap, line):  # type: ignore[no-untyped-def]
    """The line through two neighbouring returns, over one more on either side where the surface goes on."""
    a = _wrapped(beam, sensors, s)
    b = _wrapped(beam + 1, sensors, s)
    before = _wrapped(beam - 1, sensors, s)
    after = _wrapped(beam + 2, sensors, s)
    if before >= 0 and _near(beams, before, a, gap):
        a = before
    if after >= 0 and _near(beams, b, after, gap):
        b = after
    ex = beams[b, 0] - beams[a, 0]
    ey = beams[b, 1] - beams[a, 1]
    length = max(math.sqrt(ex * ex + ey * ey), 1e-12)
    line[0] = -ey / length
    line[1] = ex / length
    line[2] = 0.5 * (line[0] * (beams[a, 0] + beams[b, 0]) + line[1] * (beams[a, 1] + beams[b, 1]))


@_inlined
def _near(beams, a, b, gap):  # type: ignore[no-untyped-def]
    """Whether the surface goes on from one return to the next."""
    squared = (beams[a, 0] - beams[b, 0]) ** 2 + (beams[a, 1] - beams[b, 1]) ** 2
    return squared < gap * gap or beams[a, 5] > 0.0  # false for NaN


@_compiled
def _accumulate(points, moved, jacobians, beams, sensors, gate, gap, normal, rhs):  # type: ignore[no-untyped-def]
    """Add the robust normal equations of points moved into the frame of some sensors; the sum of weights.

    ``jacobians`` (m, 2, 3) are the derivatives of the moved points by x, y and theta of the pose.
    """
    line = np.empty(3)
    total = 0.0
    for k in range(len(points)):
        for s in range(len(sensors)):
            dx = moved[k, 0] - sensors[s, 2]
            dy = moved[k, 1] - sensors[s, 3]
            x = sensors[s, 0] * dx + sensors[s, 1] * dy
            y = sensors[s, 0] * dy - sensors[s, 1] * dx
            distance = _surface_line(x, y, _beam_of(x, y, sensors, s), beams, sensors, s, gate, gap, line)
            if distance >= gate:
                continue
            residual = line[0] * x + line[1] * y - line[2]
            weight = (1.0 - (distance / gate) ** 2) ** 2
            nx = sensors[s, 0] * line[0] - sensors[s, 1] * line[1]
            ny = sensors[s, 1] * line[0] + sensors[s, 0] * line[1]
            total += weight
            for i in range(3):
                slope = nx * jacobians[k, 0, i] + ny * jacobians[k, 1, i]
                rhs[i] -= weight * slope * residual
                for j in range(3):
                    normal[i, j] += weight * slope * (nx * jacobians[k, 0, j] + ny * jacobians[k, 1, j])
            break
    return total


@_compiled
def normal_equations(
    sighting_1: Sighting,
    sighting_2: Sighting,
    pose: FloatArray,
    gate: float,
    gap: float,
    normal: FloatArray,
    rhs: FloatArray,
) -> float:
    """Points of 2 against the surfaces of 1, and points of 1 against those of 2, at ``T_1_2`` (3,).

    Fills ``normal`` (3, 3) with J^T W J and ``rhs`` (3,) with -J^T W r of the distances r, metres; returns the
    sum of the weights W.
    """
    cosine = math.cos(pose[2])
    sine = math.sin(pose[2])
    normal[:] = 0.0
    rhs[:] = 0.0
    total = 0.0
    for way in range(2):
        points = sighting_2.points if way == 0 else sighting_1.points
        moved = np.empty((len(points), 2))
        jacobians = np.empty((len(points), 2, 3))
        for k in range(len(points)):
            if way == 0:
                moved[k, 0] = cosine * points[k, 0] - sine * points[k, 1] + pose[0]
                moved[k, 1] = sine * points[k, 0] + cosine * points[k, 1] + pose[1]
                jacobians[k] = np.array(((1.0, 0.0, pose[1] - moved[k, 1]), (0.0, 1.0, moved[k, 0] - pose[0])))
            else:
                dx = points[k, 0] - pose[0]
                dy = points[k, 1] - pose[1]
                moved[k, 0] = cosine * dx + sine * dy
                moved[k, 1] = cosine * dy - sine * dx
                jacobians[k] = np.array(((-cosine, -sine, moved[k, 1]), (sine, -cosine, -moved[k, 0])))
        seen = sighting_1 if way == 0 else sighting_2
        total += _accumulate(points, moved, jacobians, seen.beams, seen.sensors, gate, gap, normal, rhs)
    return total


@_compiled
def refine(
    sighting_1: Sighting,
    sighting_2: Sighting,
    poses: FloatArray,
    steps: int,
    first_gate: float,
    last_gate: float,
    gap: float,
) -> FloatArray:
    """Each ``T_1_2`` of poses (k, 3) after some steps of robust point-to-line least squares with a shrinking gate."""
    refined = poses.copy()
    normal = np.empty((3, 3))
    rhs = np.empty(3)
    for k in range(len(poses)):
        for step in range(steps):
            gate = first_gate * (last_gate / first_gate) ** (step / max(1, steps - 1))
            total = normal_equations(sighting_1, sighting_2, refined[k], gate, gap, normal, rhs)
            if total < 3.0:
                break
            step_down(normal, rhs, refined[k])
    return refined
