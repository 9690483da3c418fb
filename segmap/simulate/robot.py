"""Where a robot goes, and where it believes it is."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

from segmap.pose import Pose2, wrap
from segmap.simulate.laser import Noise

__all__ = ["odometry", "walk"]


def walk(waypoints: Sequence[tuple[float, float]], noise: Noise, step: float = 1.0, turn: float = 0.5) -> list[Pose2]:
    """The places where a robot stops and scans on its way along some points.

    It moves at most about ``step`` metres, and turns on the spot at most ``turn`` radians, from one
    scan to the next, and is never quite where it wants to be. Poses are rounded to a millimetre
    and 0.0001 radians, so that the truth can be written down exactly.
    """
    heading = _heading(waypoints[0], waypoints[1])
    poses = [Pose2(*waypoints[0], heading)]
    for start, end in pairwise(waypoints):
        change = wrap(_heading(start, end) - heading)
        heading = _heading(start, end)
        poses += _turn(start, heading, change, turn)
        poses += _leg(start, end, step)
    return [_disturbed(pose, noise) for pose in poses]


def _heading(start: tuple[float, float], end: tuple[float, float]) -> float:
    return math.atan2(end[1] - start[1], end[0] - start[0])


def _turn(place: tuple[float, float], heading: float, change: float, turn: float) -> Iterable[Pose2]:
    """On the spot, to ``heading``; the last of it is done on the way."""
    count = math.ceil(abs(change) / turn - 1e-9)
    return [Pose2(*place, heading - change * (count - i) / count) for i in range(1, count)]


def _leg(start: tuple[float, float], end: tuple[float, float], step: float) -> Iterable[Pose2]:
    dx, dy = end[0] - start[0], end[1] - start[1]
    count = math.ceil(math.sqrt(dx * dx + dy * dy) / step - 1e-9)
    heading = _heading(start, end)
    return [Pose2(start[0] + dx * i / count, start[1] + dy * i / count, heading) for i in range(1, count + 1)]


def _disturbed(pose: Pose2, noise: Noise) -> Pose2:
    return _rounded(pose @ Pose2(noise.between(-0.1, 0.1), noise.between(-0.06, 0.06), noise.between(-0.08, 0.08)))


def _rounded(pose: Pose2) -> Pose2:
    return Pose2(round(pose.x, 3) + 0.0, round(pose.y, 3) + 0.0, round(pose.theta, 4) + 0.0)


def odometry(poses: Sequence[Pose2], noise: Noise) -> list[Pose2]:
    """What poor wheels make of a way: from the origin, a little too long, and pulling to one side."""
    believed = [Pose2.identity()]
    for before, after in pairwise(poses):
        moved = before.inverse() @ after
        length = math.sqrt(moved.x * moved.x + moved.y * moved.y)
        slip = Pose2(
            moved.x * noise.between(1.0, 1.08),
            moved.y * noise.between(0.9, 1.1),
            moved.theta * noise.between(0.94, 1.0) + length * noise.between(-0.005, 0.025),
        )
        believed.append(believed[-1] @ slip)
    return [_rounded(pose) for pose in believed]
