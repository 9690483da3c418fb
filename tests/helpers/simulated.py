"""Rooms, corridors and what a laser without noise, or with some, sees in them."""

import math
from functools import cache

import numpy as np

from segmap.parameters import Parameters
from segmap.pose import Pose2, wrap
from segmap.scans import LaserScan
from segmap.segments import SegmentMap, Sight, extract
from segmap.simulate import Laser, Noise, World, box, cast, disc

DEGREE = math.pi / 180.0


@cache
def room() -> World:
    """A room of 6 by 5 m with a niche and three things in it, unlike itself in any other pose."""
    things = [box(1.2, 3.9, 0.8, 0.5, 0.3), box(4.6, 1.1, 0.5, 1.2), disc(2.4, 0.9, 0.25)]
    return World.build("room", [(0.0, 0.0, 6.0, 5.0), (6.0, 3.2, 7.1, 4.4)], shapes=things)


@cache
def other_room() -> World:
    """A room that has nothing of the first one."""
    things = [box(3.0, 6.5, 1.7, 0.4, 0.9), disc(1.1, 2.2, 0.4, 7), box(2.2, 4.1, 0.3, 0.3, 0.2)]
    return World.build("other", [(0.0, 0.0, 3.6, 8.3), (-1.4, 5.0, 0.0, 5.9)], shapes=things)


@cache
def corridor(width: float = 2.0) -> World:
    """Two walls and nothing else for 200 m."""
    return World.build("corridor", [(0.0, 0.0, 200.0, width)])


def exact(world, T, beams=180, first=-math.pi / 2, step=DEGREE, reach=30.0) -> LaserScan:
    """What a laser without noise, rounding or width sees."""
    ranges, _ = cast(world.segments, T, first + step * np.arange(beams))
    return LaserScan(np.where(ranges < reach, ranges, np.nan), first, step)


def noisy(world, T, seed, reach=30.0) -> LaserScan:
    """What a laser as lasers are sees."""
    return Laser(reach=reach).scan(world, T, Noise(seed))


def read_backwards(scan: LaserScan) -> LaserScan:
    """The same measurements, the last beam first: a clockwise scan."""
    last = scan.first_angle + (len(scan) - 1) * scan.angle_step
    return LaserScan(scan.ranges[::-1], last, -scan.angle_step, scan.max_range)


def sight_map(*sights: tuple[Pose2, LaserScan]) -> SegmentMap:
    """A map of scans alone, without segments."""
    return SegmentMap(np.empty((0, 4)), sights=tuple(Sight(T, scan) for T, scan in sights))


def alone(scan: LaserScan) -> SegmentMap:
    """One scan at the origin, without segments."""
    return sight_map((Pose2.identity(), scan))


def pair(world, T_w_1, T_w_2, parameters=None, seed=None, reach=30.0):
    """The maps of two scans of a world, and the true pose of the second in the frame of the first."""
    parameters = parameters or Parameters()
    scans = [
        exact(world, T, reach=reach) if seed is None else noisy(world, T, seed + k, reach)
        for k, T in enumerate((T_w_1, T_w_2))
    ]
    return *(extract(scan, parameters) for scan in scans), T_w_1.inverse() @ T_w_2


def perturbed(truth, count, seed, distance=0.3, angle=8.0 * DEGREE):
    """Poses up to so far from the true one."""
    generator = np.random.default_rng(seed)
    headings, lengths = generator.uniform(0.0, 2.0 * math.pi, count), generator.uniform(0.0, distance, count)
    turns = generator.uniform(-angle, angle, count)
    return np.array(tuple(truth)) + np.column_stack((lengths * np.cos(headings), lengths * np.sin(headings), turns))


def off(poses, truth):
    """Metres and radians between poses (k, 3) and the true one, at most."""
    errors = poses - np.array(tuple(truth))
    return np.hypot(errors[:, 0], errors[:, 1]).max(), np.abs(wrap(errors[:, 2])).max()
