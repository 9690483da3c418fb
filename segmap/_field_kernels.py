"""The inner loops over fields: what sensors see, drawn on a grid once, and looked up for many candidates.

Same rules as :mod:`segmap._kernels`. A field answers about as :mod:`segmap._sight_kernels` does, to half a cell,
at a small part of the time, however many sensors a map has.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from segmap._sight_kernels import CLASSES, CONTRADICTED, SHADOWED, SUPPORTED, UNSEEN, Sighting
from segmap._stepping import step_down
from segmap.pose import FloatArray

__all__ = ["Field", "draw", "look", "normal_equations", "refine"]

NONE = -1

_compiled = njit(cache=True, nogil=True, error_model="numpy")
_inlined = njit(cache=True, nogil=True, error_model="numpy", inline="always")


class Field(NamedTuple):
    """What the sensors of a map see, by cell of a grid in the map's frame."""

    classes: NDArray[Any]
    """(rows, columns): how they see a point in the middle of the cell"""
    nearest: NDArray[Any]
    """(rows, columns): the nearest piece of surface within reach, -1: none"""
    pieces: FloatArray
    """(n, 7): x1, y1, x2, y2 of pieces of surface between neighbouring returns; normal and offset of their line"""
    frame: FloatArray
    """(3,): x and y of the corner of the first cell, metres; cells to a metre"""
    mean: float
    """metres: the width of all returns of one scan, where the map is of several; infinite where it is of one"""


@_compiled
def draw(sighting: Sighting, frame, rows, columns, tolerance, gap, depth, reach):  # type: ignore[no-untyped-def]
    """The field of a map on ``rows`` x ``columns`` cells; pieces of surface are looked for within ``reach`` metres."""
    classes = np.full((rows, columns), UNSEEN, np.int8)
    nearest = np.full((rows, columns), NONE, np.int32)
    distances = np.full((rows, columns), reach, np.float32)
    pieces = _pieces(sighting, gap)
    for s in range(len(sighting.sensors)):
        _draw_sight(classes, sighting.beams, sighting.sensors[s], frame, depth)
    for s in range(len(sighting.sensors)):
        _draw_returns(classes, sighting.beams, sighting.sensors[s], frame, tolerance)
    for k in range(len(pieces)):
        _draw_piece(classes, nearest, distances, pieces, k, frame, tolerance, reach)
    return Field(classes, nearest, pieces, frame, sighting.mean if len(sighting.sensors) > 1 else np.inf)


@_inlined
def _beside(beam, step, sensor):  # type: ignore[no-untyped-def]
    """The row of the beam ``step`` = 1 or -1 on among all beams; -1 where the sensor has none there."""
    count = int(sensor[7])
    beam += step
    if beam < 0 or beam >= count:
        if (count + 0.5) * abs(sensor[5]) < 2.0 * math.pi:
            return NONE
        beam = (beam + count) % count
    return int(sensor[6]) + beam


@_compiled
def _pieces(sighting, gap):  # type: ignore[no-untyped-def]
    """The surface from return to return where it goes on, each with the line over one more on either side."""
    beams = sighting.beams
    pieces = np.empty((len(beams), 7))
    count = 0
    for s in range(len(sighting.sensors)):
        sensor = sighting.sensors[s]
        for k in range(int(sensor[7])):
            a = int(sensor[6]) + k
            b = _beside(k, 1, sensor)
            if b < 0 or not _joined(beams, a, b, gap):
                continue
            before = _beside(k, -1, sensor)
            after = _beside(b - int(sensor[6]), 1, sensor)
            start = before if before >= 0 and _joined(beams, before, a, gap) else a
            end = after if after >= 0 and _joined(beams, b, after, gap) else b
            _set_piece(pieces[count], beams, sensor, a, b, start, end)
            count += 1
    return pieces[:count].copy()


@_inlined
def _joined(beams, a, b, gap):  # type: ignore[no-untyped-def]
    squared = (beams[a, 0] - beams[b, 0]) ** 2 + (beams[a, 1] - beams[b, 1]) ** 2
    return squared > 0.0 and (squared < gap * gap or beams[a, 5] > 0.0)  # false for NaN


@_compiled
def _set_piece(piece, beams, sensor, a, b, start, end):  # type: ignore[no-untyped-def]
    """The piece from return a to return b, on the line from ``start`` to ``end``, in the map's frame."""
    cosine, sine, x, y = sensor[0], sensor[1], sensor[2], sensor[3]
    piece[0] = cosine * beams[a, 0] - sine * beams[a, 1] + x
    piece[1] = sine * beams[a, 0] + cosine * beams[a, 1] + y
    piece[2] = cosine * beams[b, 0] - sine * beams[b, 1] + x
    piece[3] = sine * beams[b, 0] + cosine * beams[b, 1] + y
    ex = beams[end, 0] - beams[start, 0]
    ey = beams[end, 1] - beams[start, 1]
    length = max(math.sqrt(ex * ex + ey * ey), 1e-12)
    nx = -ey / length
    ny = ex / length
    offset = 0.5 * (nx * (beams[start, 0] + beams[end, 0]) + ny * (beams[start, 1] + beams[end, 1]))
    piece[4] = cosine * nx - sine * ny
    piece[5] = sine * nx + cosine * ny
    piece[6] = offset + piece[4] * x + piece[5] * y


@_compiled
def _draw_sight(classes, beams, sensor, frame, depth):  # type: ignore[no-untyped-def]
    """What a sensor sees through, and what is close behind a surface it sees, along rays a cell apart or less."""
    for k in range(int(sensor[7])):
        b = _beside(k, 1, sensor)
        if b < 0:
            continue
        near, far = beams[int(sensor[6]) + k, 2], beams[b, 2]
        if math.isnan(near) or math.isnan(far):
            continue
        near, far = min(near, far), max(near, far)
        rays = math.ceil((far + depth) * abs(sensor[5]) * frame[2])
        for r in range(rays):
            angle = sensor[4] + sensor[5] * (k + (r + 0.5) / rays)
            x = math.cos(angle)
            y = math.sin(angle)
            dx = sensor[0] * x - sensor[1] * y
            dy = sensor[1] * x + sensor[0] * y
            _draw_ray(classes, sensor, dx, dy, 0.0, near, frame, CONTRADICTED)
            _draw_ray(classes, sensor, dx, dy, far, far + depth, frame, SHADOWED)


@_compiled
def _draw_ray(classes, sensor, dx, dy, start, end, frame, kind):  # type: ignore[no-untyped-def]
    """Mark the cells along a ray from ``start`` to ``end`` metres; what speaks louder stays."""
    scale = frame[2]
    x = (sensor[2] + dx * start - frame[0]) * scale
    y = (sensor[3] + dy * start - frame[1]) * scale
    for _ in range(int((end - start) * scale) + 1):
        row = int(y)
        column = int(x)
        inside = x >= 0.0 and y >= 0.0 and row < classes.shape[0] and column < classes.shape[1]
        if inside and classes[row, column] > kind:
            classes[row, column] = kind
        x += dx
        y += dy


@_compiled
def _draw_returns(classes, beams, sensor, frame, tolerance):  # type: ignore[no-untyped-def]
    """A surface at each return, alone or not."""
    for k in range(int(sensor[6]), int(sensor[6]) + int(sensor[7])):
        if math.isnan(beams[k, 2]):
            continue
        x = (sensor[0] * beams[k, 0] - sensor[1] * beams[k, 1] + sensor[2] - frame[0]) * frame[2]
        y = (sensor[1] * beams[k, 0] + sensor[0] * beams[k, 1] + sensor[3] - frame[1]) * frame[2]
        radius = tolerance * frame[2]
        for row in range(max(0, int(y - radius)), min(classes.shape[0], int(y + radius) + 1)):
            for column in range(max(0, int(x - radius)), min(classes.shape[1], int(x + radius) + 1)):
                if (row + 0.5 - y) ** 2 + (column + 0.5 - x) ** 2 <= radius * radius:
                    classes[row, column] = SUPPORTED


@_compiled
def _draw_piece(classes, nearest, distances, pieces, k, frame, tolerance, reach):  # type: ignore[no-untyped-def]
    """A piece of surface: support within the tolerance of it, and nearest to a cell unless one before is."""
    scale = frame[2]
    ax = (pieces[k, 0] - frame[0]) * scale
    ay = (pieces[k, 1] - frame[1]) * scale
    bx = (pieces[k, 2] - frame[0]) * scale
    by = (pieces[k, 3] - frame[1]) * scale
    ex = bx - ax
    ey = by - ay
    squared = ex * ex + ey * ey
    margin = reach * scale
    for row in range(max(0, int(min(ay, by) - margin)), min(classes.shape[0], int(max(ay, by) + margin) + 1)):
        for column in range(max(0, int(min(ax, bx) - margin)), min(classes.shape[1], int(max(ax, bx) + margin) + 1)):
            dx = column + 0.5 - ax
            dy = row + 0.5 - ay
            share = min(1.0, max(0.0, (dx * ex + dy * ey) / squared))
            distance = math.sqrt((dx - share * ex) ** 2 + (dy - share * ey) ** 2) / scale
            if distance < distances[row, column]:
                distances[row, column] = distance
                nearest[row, column] = k
                if distance <= tolerance:
                    classes[row, column] = SUPPORTED


@_compiled
def look(field_1: Field, field_2: Field, points_1: FloatArray, points_2: FloatArray, poses: FloatArray) -> FloatArray:
    """For each ``T_1_2`` of poses (k, 3): metres of beam width in each class, (k, 4), both ways together.

    ``points`` (m, 3) are returns of each map and their widths.
    """
    totals = np.zeros((len(poses), CLASSES))
    for k in range(len(poses)):
        cosine = math.cos(poses[k, 2])
        sine = math.sin(poses[k, 2])
        x = poses[k, 0]
        y = poses[k, 1]
        _add_classes(totals[k], points_2, field_2.mean, cosine, sine, x, y, field_1)
        back_x = -cosine * x - sine * y
        back_y = sine * x - cosine * y
        _add_classes(totals[k], points_1, field_1.mean, cosine, -sine, back_x, back_y, field_2)
    return totals


@_compiled
def _add_classes(totals, points, mean, cosine, sine, x, y, field):  # type: ignore[no-untyped-def]
    """Add the metres of points by class; of several scans, no more is unseen than one would have."""
    classes = field.classes
    left, low, scale = field.frame
    x = (x - left) * scale
    y = (y - low) * scale
    cosine *= scale
    sine *= scale
    rows, columns = classes.shape
    unseen = 0.0
    judged = 0.0
    for q in range(len(points)):
        column = cosine * points[q, 0] - sine * points[q, 1] + x
        row = sine * points[q, 0] + cosine * points[q, 1] + y
        kind = UNSEEN
        if 0.0 <= column < columns and 0.0 <= row < rows:
            kind = classes[int(row), int(column)]
        if kind == UNSEEN:
            unseen += points[q, 2]
        else:
            totals[kind] += points[q, 2]
            judged += points[q, 2]
    totals[UNSEEN] += min(unseen, max(0.0, mean - judged))


# --- refinement: robust point-to-line least squares, both ways -----------------------------------


@_compiled
def normal_equations(
    field_1: Field,
    field_2: Field,
    points_1: FloatArray,
    points_2: FloatArray,
    pose: FloatArray,
    gate: float,
    normal: FloatArray,
    rhs: FloatArray,
) -> float:
    """Points of 2 against the surfaces of 1, and points of 1 against those of 2, at ``T_1_2`` (3,).

    Fills ``normal`` (3, 3) with J^T W J and ``rhs`` (3,) with -J^T W r of the distances r, metres; returns the
    sum of the weights W.
    """
    cosine = math.cos(pose[2])
    sine = math.sin(pose[2])
    x = pose[0]
    y = pose[1]
    sums = np.zeros(10)
    _accumulate(points_2, (cosine, sine, x, y), (1.0, 0.0, x, y), 1.0, field_1, gate, sums)
    back = cosine, -sine, -cosine * x - sine * y, sine * x - cosine * y
    _accumulate(points_1, back, (cosine, sine, 0.0, 0.0), -1.0, field_2, gate, sums)
    normal[0, 0], normal[1, 1], normal[2, 2] = sums[0], sums[3], sums[5]
    normal[0, 1] = normal[1, 0] = sums[1]
    normal[0, 2] = normal[2, 0] = sums[2]
    normal[1, 2] = normal[2, 1] = sums[4]
    rhs[:] = -sums[6:9]
    return sums[9]


@_compiled
def _accumulate(points, moved, turned, sign, field, gate, sums):  # type: ignore[no-untyped-def]
    """Add what holds some points, moved into the frame of a field: six of J^T W J, three of J^T W r, one of W.

    ``turned`` (cosine, sine, x, y) and ``sign`` say how a normal of the field and an arm from (x, y) become slopes
    by the pose.
    """
    s0 = s1 = s2 = s3 = s4 = s5 = s6 = s7 = s8 = s9 = 0.0
    nearest = field.nearest
    pieces = field.pieces
    left, low, scale = field.frame
    rows, columns = nearest.shape
    for q in range(len(points)):
        x = moved[0] * points[q, 0] - moved[1] * points[q, 1] + moved[2]
        y = moved[1] * points[q, 0] + moved[0] * points[q, 1] + moved[3]
        column = (x - left) * scale
        row = (y - low) * scale
        if not (0.0 <= column < columns and 0.0 <= row < rows):
            continue
        k = nearest[int(row), int(column)]
        if k < 0:
            continue
        weight = _weight(x - pieces[k, 0], y - pieces[k, 1], pieces, k, gate)
        nx = pieces[k, 4]
        ny = pieces[k, 5]
        residual = nx * x + ny * y - pieces[k, 6]
        a = sign * (turned[0] * nx - turned[1] * ny)
        b = sign * (turned[1] * nx + turned[0] * ny)
        c = sign * (ny * (x - turned[2]) - nx * (y - turned[3]))
        s0 += weight * a * a
        s1 += weight * a * b
        s2 += weight * a * c
        s3 += weight * b * b
        s4 += weight * b * c
        s5 += weight * c * c
        s6 += weight * a * residual
        s7 += weight * b * residual
        s8 += weight * c * residual
        s9 += weight
    sums += np.array((s0, s1, s2, s3, s4, s5, s6, s7, s8, s9))


@_inlined
def _weight(dx, dy, pieces, k, gate):  # type: ignore[no-untyped-def]
    """The robust weight of a point, given from the start of a piece: none past its ends or beyond the gate."""
    ex = pieces[k, 2] - pieces[k, 0]
    ey = pieces[k, 3] - pieces[k, 1]
    along = (dx * ex + dy * ey) / (ex * ex + ey * ey)
    share = min(1.0, max(0.0, along))
    squared = ((dx - share * ex) ** 2 + (dy - share * ey) ** 2) / (gate * gate)
    return (1.0 - min(1.0, squared)) ** 2 if abs(along - 0.5) <= 1.0 else 0.0


@_compiled
def refine(
    field_1: Field,
    field_2: Field,
    points_1: FloatArray,
    points_2: FloatArray,
    poses: FloatArray,
    steps: int,
    first_gate: float,
    last_gate: float,
) -> FloatArray:
    """Each ``T_1_2`` of poses (k, 3) after some steps of robust point-to-line least squares with a shrinking gate."""
    refined = poses.copy()
    normal = np.empty((3, 3))
    rhs = np.empty(3)
    for k in range(len(poses)):
        for step in range(steps):
            gate = first_gate * (last_gate / first_gate) ** (step / max(1, steps - 1))
            total = normal_equations(field_1, field_2, points_1, points_2, refined[k], gate, normal, rhs)
            if total < 3.0:
                break
            step_down(normal, rhs, refined[k])
    return refined
