"""Candidate -> refined pose, covariance and strength; distinct rivals."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from segmap._hold_kernels import hold
from segmap._refine_kernels import refine
from segmap._sight_kernels import distinct as distinct_rows
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray, Pose2
from segmap.segments import SegmentMap
from segmap.visibility import SURFACE_GAP, Sighting, thinned

__all__ = ["Uncertainty", "distinct", "information", "of_covariance", "refined", "uncertainties", "uncertainty"]

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
    return refine(seen_1, seen_2, np.ascontiguousarray(poses), steps, first_gate, last_gate, SURFACE_GAP)


def distinct(poses: FloatArray, order: IntArray, distance: float, angle: float, most: int) -> IntArray:
    """The best of each cluster of poses: rows of ``order``, best first, farther apart than the limits."""
    return distinct_rows(poses, np.ascontiguousarray(order), distance, angle, most)


def uncertainty(
    map_1: SegmentMap, map_2: SegmentMap, seen_1: Sighting, seen_2: Sighting, T_1_2: Pose2, parameters: Parameters
) -> Uncertainty:
    """How well two maps, and what their sensors saw, hold ``T_1_2``."""
    return uncertainties(map_1, map_2, seen_1, seen_2, np.array([tuple(T_1_2)]), parameters)[0]


def uncertainties(
    map_1: SegmentMap, map_2: SegmentMap, seen_1: Sighting, seen_2: Sighting, poses: FloatArray, parameters: Parameters
) -> list[Uncertainty]:
    """How well two maps, and what their sensors saw, hold each ``T_1_2`` of poses (k, 3)."""
    held = information(map_1, map_2, seen_1, seen_2, poses, parameters) / (CORRELATION * RANGE_NOISE**2)
    weak = 1.0 / parameters.refine_gate**2  # nothing is known better than the gate without any wall
    covariances = np.linalg.inv(held + weak * np.eye(3))
    return [of_covariance(covariance) for covariance in covariances]


def of_covariance(covariance: FloatArray) -> Uncertainty:
    """How well a pose of this covariance (3, 3) is known."""
    variances, directions = np.linalg.eigh(covariance[:2, :2])
    return Uncertainty(
        tuple(tuple(row) for row in covariance.tolist()),  # type: ignore[arg-type]
        math.sqrt(variances[1]),
        math.sqrt(variances[0]),
        _half_turn(math.atan2(directions[1, 1], directions[0, 1])),
    )


def _half_turn(heading: float) -> float:
    """The heading of a line, in [0, pi)."""
    turned = heading % math.pi
    return 0.0 if turned >= math.pi else turned  # rounding can land on the open end


def information(
    map_1: SegmentMap, map_2: SegmentMap, seen_1: Sighting, seen_2: Sighting, poses: FloatArray, parameters: Parameters
) -> FloatArray:
    """How firmly walls hold each ``T_1_2`` of poses (k, 3): the normal matrices (k, 3, 3) of returns against the
    segments of the other map.

    Segments, because the surface between two neighbouring returns has no direction to speak of: it follows
    their noise, and would hold a pose even along an empty corridor. A segment is sure of its direction
    only to ``split_tolerance`` across its length, and what that could feign is taken off.
    """
    points_1, points_2 = (thinned(seen, WITNESSES).points for seen in (seen_1, seen_2))
    walls = map_1.coordinates, map_2.coordinates
    held = hold(points_1, points_2, *walls, poses, WALL_GATE, parameters.split_tolerance).sum(axis=1)
    strengths, directions = np.linalg.eigh(held)
    return (directions * np.maximum(strengths, 0.0)[:, None, :]) @ directions.swapaxes(1, 2)
