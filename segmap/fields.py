"""What the sensors of a map see, drawn on a grid: thousands of candidates are looked up in it in a millisecond.

A field answers as :mod:`segmap.visibility` does, to half a cell. It finds and refines candidates; what is
said of them in the end is said by the lines of sight themselves.
"""

from __future__ import annotations

import math

import numpy as np

from segmap import _field_kernels as kernels
from segmap._field_kernels import Field
from segmap.parameters import Parameters
from segmap.pose import FloatArray
from segmap.visibility import SURFACE_GAP, Sighting

__all__ = ["Field", "field", "look_up", "refined"]

CELL = 0.1
"""metres; half the tolerance of sight"""
MOST_CELLS = 1 << 18
"""the cells of larger maps are larger"""


def field(seen: Sighting, parameters: Parameters) -> Field:
    """The field of a map, over all its returns and what is near them."""
    margin = max(parameters.refine_gate, parameters.shadow_depth, parameters.sight_tolerance)
    places = np.concatenate((seen.points[:, :2], seen.sensors[:, 2:4]))
    low, high = places.min(axis=0) - margin, places.max(axis=0) + margin
    cell = max(CELL, math.sqrt(float(np.prod(high - low)) / MOST_CELLS))
    columns, rows = (int(count) for count in np.ceil((high - low) / cell))
    reach = parameters.refine_gate
    drawn: Field = kernels.draw(
        seen,
        np.array((low[0], low[1], 1.0 / cell)),
        rows,
        columns,
        parameters.sight_tolerance,
        SURFACE_GAP,
        parameters.shadow_depth,
        reach,
    )
    return drawn


def look_up(
    field_1: Field, field_2: Field, points_1: FloatArray, points_2: FloatArray, poses: FloatArray
) -> FloatArray:
    """For each ``T_1_2`` of poses (k, 3), about what :func:`segmap.visibility.look` says of points (m, 3), (k, 4)."""
    totals: FloatArray = kernels.look(field_1, field_2, points_1, points_2, np.ascontiguousarray(poses))
    return totals


def refined(
    field_1: Field,
    field_2: Field,
    points_1: FloatArray,
    points_2: FloatArray,
    poses: FloatArray,
    steps: int,
    first_gate: float,
    last_gate: float,
) -> FloatArray:
    """Poses (k, 3) after robust point-to-line least squares, both ways.

    A return farther than the gate from the surface nearest to its cell does not count; the gate shrinks from
    ``first_gate`` to ``last_gate`` metres over the steps.
    """
    return kernels.refine(
        field_1, field_2, points_1, points_2, np.ascontiguousarray(poses), steps, first_gate, last_gate
    )
