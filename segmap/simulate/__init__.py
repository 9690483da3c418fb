"""Worlds, a laser and robots: sample logs and tests with known truth.

>>> from segmap.pose import Pose2
>>> room = World.build("room", [(0.0, 0.0, 4.0, 3.0)])
>>> scan = Laser().scan(room, Pose2(1.0, 1.0, 0.0), Noise(seed=1))
>>> len(scan), round(float(scan.ranges[90]), 1)
(180, 3.0)
"""

from __future__ import annotations

from segmap.simulate.laser import Laser, Noise
from segmap.simulate.robot import odometry, walk
from segmap.simulate.samples import INDEX, SAMPLES, Sample, Session, write_samples
from segmap.simulate.world import World, box, cast, chair, disc, outline

__all__ = [
    "INDEX",
    "SAMPLES",
    "Laser",
    "Noise",
    "Sample",
    "Session",
    "World",
    "box",
    "cast",
    "chair",
    "disc",
    "odometry",
    "outline",
    "walk",
    "write_samples",
]
