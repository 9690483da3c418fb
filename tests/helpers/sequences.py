"""A small room seen from several places, as sequences of scans of known truth."""

from functools import partial

import numpy as np
from worlds import room

from segmap.merging import merge
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.segments import Order, SegmentMap, Source

WORLD = SegmentMap.joined(
    [room(5.0, 3.0), SegmentMap(np.array([[0.5, -0.4, 1.3, -0.4], [1.3, -0.4, 1.3, 0.3], [-1.0, 0.2, -1.6, 0.9]]))]
)
POSES = [Pose2(0.0, 0.0, 0.0), Pose2(0.4, 0.1, 0.3), Pose2(0.8, -0.1, 0.5), Pose2(1.0, 0.2, -0.2), Pose2(0.7, 0.4, 1.1)]
P = Parameters()
EVERY = P.replace(tree_skip=False, bridging=False)
ELSEWHERE = SegmentMap(np.array([[0.0, 0.0, 0.6, 0.0], [0.6, 0.0, 0.9, 0.7]]), Order.BEAMS)
by_all = partial(merge, map_heuristic="all")
"""all angles of partial maps too: these are small"""


def seen(index, T_world_scan, log=0):
    """The world as a scan from a pose."""
    coordinates = WORLD.moved(T_world_scan.inverse()).coordinates
    sources = tuple((Source(log, index, i),) for i in range(len(coordinates)))
    return SegmentMap(coordinates, Order.BEAMS, sources=sources)


def sequence(poses=POSES, log=0):
    """A scan of the world from each pose."""
    return {ScanId(log, i): seen(i, T, log) for i, T in enumerate(poses)}


def truth(a, b):
    """``T_a_b`` of two scans of the sequence."""
    return POSES[a.scan].inverse() @ POSES[b.scan]


def ids(*scans):
    return tuple(ScanId(0, scan) for scan in scans)


def nodes_of(result):
    return [node for component in result.components for node in component.tree.nodes()]


def steps_of(result):
    return [node.step for node in nodes_of(result) if node.step]


def assert_true(result, poses=POSES):
    """Every scan of every component lies where it truly does."""
    for component in result.components:
        first = poses[component.scans[0].scan]
        for scan, pose in component.poses.items():
            assert max(pose.distance(first.inverse() @ poses[scan.scan])) < 1e-6


def broken():
    """The sequence with a scan of another place in it."""
    return {**sequence(), ScanId(0, 2): ELSEWHERE}
