"""Candidate -> refined pose, covariance and strength; distinct rivals."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from segmap import _sight_kernels as kernels
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray, Pose2
from segmap.segments import SegmentMap
from segmap.visibility import SURFACE_GAP, Sighting, thinned

__all__ = ["Uncertainty", "distinct", "information", "refined", "uncertainty"]

RANGE_NOISE = 0.03
"""metres; standard deviation of a return from the surface that stands for it"""
CORRELATION = 10.0
"""returns that err together: neighbours share their surface, so they tell less than independent ones would"""
WITNESSES = 180
"""returns of each map that say how well its pose is held"""
WALL_GATE = 0.1
"""metres; a return farther from every segment of the other map holds nothing"""


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
) -> FloatArray:
    """Poses (k, 3) after robust point-to-line least squares, both ways.

    A return farther than the gate from every surface near its beam does not count; the gate shrinks from
    ``first_gate`` to ``last_gate`` metres over the steps.
    """
    return kernels.refine(seen_1, seen_2, np.ascontiguousarray(poses), steps, first_gate, last_gate, SURFACE_GAP)


def distinct(poses: FloatArray, order: IntArray, distance: float, angle: float, most: int) -> IntArray:
    """The best of each cluster of poses: rows of ``order``, best first, farther apart than the limits."""
    return kernels.distinct(poses, np.ascontiguousarray(order), distance, angle, most)


def uncertainty(
    map_1: SegmentMap, map_2: SegmentMap, seen_1: Sighting, seen_2: Sighting, T_1_2: Pose2, parameters: Parameters
) -> Uncertainty:
    """How well two maps, and what their sensors saw, hold ``T_1_2``."""
    held = information(map_1, map_2, seen_1, seen_2, T_1_2, parameters) / (CORRELATION * RANGE_NOISE**2)
    weak = 1.0 / parameters.refine_gate**2  # nothing is known better than the gate without any wall
    covariance = np.linalg.inv(held + np.diag((weak, weak, weak)))
    variances, directions = np.linalg.eigh(covariance[:2, :2])
    return Uncertainty(
        tuple(tuple(float(entry) for entry in row) for row in covariance),  # type: ignore[arg-type]
        math.sqrt(variances[1]),
        math.sqrt(variances[0]),
        _half_turn(math.atan2(directions[1, 1], directions[0, 1])),
    )


def _half_turn(heading: float) -> float:
    """The heading of a line, in [0, pi)."""
    turned = heading % math.pi
    return 0.0 if turned >= math.pi else turned  # rounding can land on the open end


def information(
    map_1: SegmentMap, map_2: SegmentMap, seen_1: Sighting, seen_2: Sighting, T_1_2: Pose2, parameters: Parameters
) -> FloatArray:
    """How firmly walls hold ``T_1_2``: the normal matrix (3, 3) of returns against the segments of the other map.

    Segments, because the surface between two neighbouring returns has no direction to speak of: it follows
    their noise, and would hold a pose even along an empty corridor. A segment is sure of its direction
    only to ``split_tolerance`` across its length, and what that could feign is taken off.
    """
    points_1, points_2 = (thinned(seen, WITNESSES).points[:, :2].copy() for seen in (seen_1, seen_2))
    held = _held(T_1_2 @ points_2, map_1, T_1_2, parameters.split_tolerance)
    held += _held(points_1, map_2.moved(T_1_2), T_1_2, parameters.split_tolerance)
    strengths, directions = np.linalg.eigh(held)
    return (directions * np.maximum(strengths, 0.0)) @ directions.T


def _held(points: FloatArray, walls: SegmentMap, T_1_2: Pose2, split_tolerance: float) -> FloatArray:
    """The part of the normal matrix of points (m, 2) near the segments of a map, all in frame 1."""
    if not len(walls):
        return np.zeros((3, 3))
    nearest, distances = kernels.nearest_segments(points, walls.coordinates)
    weights = np.maximum(0.0, 1.0 - (distances / WALL_GATE) ** 2) ** 2
    lengths = walls.lengths[nearest]
    unsure = weights * np.minimum(1.0, split_tolerance / lengths) ** 2
    along = (walls.coordinates[nearest, 2:] - walls.coordinates[nearest, :2]) / lengths[:, None]
    across = np.stack((-along[:, 1], along[:, 0]), axis=-1)
    arms = points - (T_1_2.x, T_1_2.y)
    slopes, feigned = _slopes(across, arms), _slopes(along, arms)
    return (slopes.T * weights) @ slopes - (feigned.T * unsure) @ feigned


def _slopes(directions: FloatArray, arms: FloatArray) -> FloatArray:
    """How a point at the end of its arm moves along a direction with x, y and theta of the pose, shape (m, 3)."""
    return np.column_stack((directions, directions[:, 1] * arms[:, 0] - directions[:, 0] * arms[:, 1]))
