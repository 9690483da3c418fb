"""How well a trajectory agrees with relations that people checked (Kuemmerle et al. 2009).

The error of a relation ``T_1_2`` is ``T_1_2^-1 (T_w_1^-1 T_w_2)``, what is left between it and the poses of the
trajectory at its two times. No common frame is needed, and an error early on does not count for all that follows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from segmap.errors import LogError
from segmap.logs.stamps import SAME_TIME, nearest_stamps
from segmap.logs.tables import Relation, RelationsFile, Trajectory
from segmap.pose import FloatArray, Pose2

__all__ = ["Agreement", "against_relations"]


@dataclass(frozen=True, eq=False)
class Agreement:
    """Errors of a trajectory against relations; standard deviations are of the errors about their mean."""

    relations: int
    matched: int
    """whose two times have a pose in the trajectory; only these count"""
    translation_mean_m: float
    translation_std_m: float
    rotation_mean_deg: float
    rotation_std_deg: float
    errors: FloatArray = field(repr=False)
    """(matched, 2), metres and radians, in the order of the relations"""


def against_relations(
    trajectory: Trajectory, file: RelationsFile, mount: Pose2 | None = None, within: float = SAME_TIME
) -> Agreement:
    """Compare a trajectory with relations; times that differ by at most ``within`` seconds are the same.

    ``mount`` is the pose of what the trajectory tells of, the laser, in the frame of what the relations tell
    of, the robot; None: they are the same.

    Raises:
        LogError: the times of no relation match.
    """
    moments = np.array([(r.time_1, r.time_2) for r in file.relations])
    places = nearest_stamps(trajectory.times, moments.ravel(), within).reshape(-1, 2)
    matched = np.flatnonzero((places >= 0).all(axis=1))
    if not len(matched):
        raise LogError(_no_match(trajectory, file, moments))
    back = (mount or Pose2.identity()).inverse()
    poses = [pose @ back for pose in trajectory.poses]
    errors = np.array([_error(file.relations[i], poses, *places[i]) for i in matched])
    (distance, angle), (distances, angles) = errors.mean(axis=0), errors.std(axis=0)
    return Agreement(
        relations=len(file.relations),
        matched=len(matched),
        translation_mean_m=float(distance),
        translation_std_m=float(distances),
        rotation_mean_deg=math.degrees(angle),
        rotation_std_deg=math.degrees(angles),
        errors=errors,
    )


def _error(relation: Relation, poses: Sequence[Pose2], first: int, second: int) -> tuple[float, float]:
    left = relation.T_1_2.inverse() @ (poses[first].inverse() @ poses[second])
    return math.hypot(left.x, left.y), abs(left.theta)


def _no_match(trajectory: Trajectory, file: RelationsFile, moments: FloatArray) -> str:
    held = f"{trajectory.times[0]:.3f} to {trajectory.times[-1]:.3f} s"
    return (
        f"No relation of {file.name} ({moments.min():.3f} to {moments.max():.3f} s) has its two times in"
        f" {trajectory.name} ({held}): give the trajectory the time stamps of the log."
    )
