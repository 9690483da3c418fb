"""Candidate -> refined pose, covariance and strength; distinct rivals."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from segmap import _sight_kernels as kernels
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray
from segmap.visibility import SURFACE_GAP, Sighting

__all__ = ["Uncertainty", "distinct", "refined", "uncertainty"]

RANGE_NOISE = 0.03
"""metres; standard deviation of a return from the surface that stands for it"""
CORRELATION = 10.0
"""returns that err together: neighbours share their surface, so they tell less than independent ones would"""


@dataclass(frozen=True)
class Uncertainty:
    """How well the geometry holds a pose."""

    covariance: tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
    """of x, y (metres) and theta (radians) of ``T_1_2``"""
    weakest: float
    """standard deviation along the weakest direction, metres: large along a corridor"""
    strongest: float
    """standard deviation along the strongest direction, metres"""
    weak_heading: float
    """radians, direction of the weakest in frame 1, in [0, pi)"""


def refined(
    seen_1: Sighting, seen_2: Sighting, poses: FloatArray, steps: int, first_gate: float, last_gate: float
) -> tuple[FloatArray, FloatArray]:
    """Poses (k, 3) after robust point-to-line least squares, both ways, and their normal matrices (k, 3, 3).

    A return farther than the gate from every surface near its beam does not count; the gate shrinks from
    ``first_gate`` to ``last_gate`` metres over the steps.
    """
    return kernels.refine(seen_1, seen_2, np.ascontiguousarray(poses), steps, first_gate, last_gate, SURFACE_GAP)


def distinct(poses: FloatArray, order: IntArray, distance: float, angle: float, most: int) -> IntArray:
    """The best of each cluster of poses: rows of ``order``, best first, farther apart than the limits."""
    return kernels.distinct(poses, np.ascontiguousarray(order), distance, angle, most)


def uncertainty(normal: FloatArray, parameters: Parameters) -> Uncertainty:
    """Covariance of a refined pose from its normal matrix (3, 3), and its strength by direction."""
    weak = 1.0 / parameters.refine_gate**2  # nothing is known better than the gate without any wall
    information = normal / (CORRELATION * RANGE_NOISE**2) + np.diag((weak, weak, weak))
    covariance = np.linalg.inv(information)
    variances, directions = np.linalg.eigh(covariance[:2, :2])
    return Uncertainty(
        tuple(tuple(float(entry) for entry in row) for row in covariance),  # type: ignore[arg-type]
        math.sqrt(variances[1]),
        math.sqrt(variances[0]),
        math.atan2(directions[1, 1], directions[0, 1]) % math.pi,
    )
