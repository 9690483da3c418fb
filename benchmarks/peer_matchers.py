"""The peers as matchers: from two scans' ranges to a pose, with no starting guess; each peer's module is handed in.

small_gicp: point-to-plane ICP from many starting headings, at one place or several; the best by how many returns
of either scan have one of the other nearby. open3d: RANSAC on FPFH features, then point-to-plane ICP. Both think
in space: returns are thinned and lifted to three layers, so that a wall is upright and its normals lie level;
returns that lie flat would have normals pointing up, and only point-to-point ICP would be left.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from types import ModuleType
from typing import Any

import numpy as np

from segmap.pose import FloatArray, Pose2
from segmap.scans import LaserScan

Run = Callable[[LaserScan, LaserScan], Pose2 | None]
"""finds ``T_1_2`` of two scans"""

SEED = 0
VOXEL = 0.1
"""metres; returns nearer to each other are thinned, and layers are so far apart"""


def lifted(points: FloatArray, height: float = 0.0) -> FloatArray:
    """Points (n, 2) at a height, (n, 3)."""
    return np.column_stack((points, np.full(len(points), height)))


def layered(points: FloatArray) -> FloatArray:
    """Points (n, 2) in three layers, (3 n, 3): what they lie on becomes an upright wall."""
    return np.concatenate([lifted(points, height) for height in (-VOXEL, 0.0, VOXEL)])


def matrix(pose: Pose2) -> FloatArray:
    """A pose as a rigid motion of space, (4, 4)."""
    T = np.eye(4)
    T[:2, :2] = [[math.cos(pose.theta), -math.sin(pose.theta)], [math.sin(pose.theta), math.cos(pose.theta)]]
    T[:2, 3] = pose.x, pose.y
    return T


def flat(T: FloatArray) -> Pose2 | None:
    """The pose of a rigid motion of space; None where it leaves the plane or turns it over."""
    return Pose2(T[0, 3], T[1, 3], math.atan2(T[1, 0], T[0, 0])) if T[2, 2] > 0.9 else None


# --- small_gicp -----------------------------------------------------------------------------------

GATES = 1.0, 0.3
"""metres, farthest correspondence: first, and then"""
ICP_STEPS, NEIGHBOURS = 20, 10
NEAR = 0.2
"""metres; a return this near to one of the other scan counts, less the farther it is"""
HERE = ((0.0, 0.0),)
AROUND = (*HERE, (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))
"""metres, starting places"""


@dataclass(frozen=True, eq=False)
class _Cloud:
    wall: Any
    """small_gicp.PointCloud of three layers with normals"""
    wall_tree: Any
    line: Any
    """small_gicp.PointCloud of the middle layer"""
    points: FloatArray
    """shape (n, 3), of the middle layer"""


def small_gicp_matcher(sg: ModuleType, headings: int, places: Sequence[tuple[float, float]]) -> Run:
    """Point-to-plane ICP from every heading at every place; the best by mutual nearness."""
    starts = [Pose2(x, y, 2.0 * math.pi * k / headings) for k, (x, y) in product(range(headings), places)]

    def run(scan_1: LaserScan, scan_2: LaserScan) -> Pose2 | None:
        first, second = (_cloud(sg, scan.returns()[0]) for scan in (scan_1, scan_2))
        found = [pose for start in starts if (pose := _icp(sg, first, second, start)) is not None]
        return max(found, key=partial(_nearness, first, second), default=None)

    return run


def _cloud(sg: ModuleType, points: FloatArray) -> _Cloud:
    thinned = np.asarray(sg.voxelgrid_sampling(lifted(points), VOXEL).points())[:, :2]
    wall, line = sg.PointCloud(layered(thinned)), sg.PointCloud(lifted(thinned))
    tree = sg.KdTree(wall)
    sg.estimate_normals(wall, tree, NEIGHBOURS)
    return _Cloud(wall, tree, line, lifted(thinned))


def _icp(sg: ModuleType, first: _Cloud, second: _Cloud, start: Pose2) -> Pose2 | None:
    T = matrix(start)
    for gate in GATES:
        T = sg.align(
            first.wall,
            second.line,
            first.wall_tree,
            T,
            registration_type="PLANE_ICP",
            max_correspondence_distance=gate,
            max_iterations=ICP_STEPS,
            num_threads=1,
        ).T_target_source
    return flat(T)


def _nearness(first: _Cloud, second: _Cloud, pose: Pose2) -> float:
    """How near the returns of either scan are to the other's, 0 to 2."""
    there, back = matrix(pose), matrix(pose.inverse())
    return _near(first.wall_tree, second.points, there) + _near(second.wall_tree, first.points, back)


def _near(tree: Any, points: FloatArray, T: FloatArray) -> float:
    _, squared = tree.batch_nearest_neighbor_search(points @ T[:3, :3].T + T[:3, 3], num_threads=1)
    return float(np.maximum(0.0, 1.0 - np.asarray(squared) / NEAR**2).mean())


# --- open3d ---------------------------------------------------------------------------------------

NORMAL_RADIUS, NORMAL_NEIGHBOURS = 0.3, 30
FEATURE_RADIUS, FEATURE_NEIGHBOURS = 2.0, 300
"""metres, and points: what a feature describes"""
AGREES, SAME_LENGTH, SAME_NORMAL = 0.15, 0.9, 0.5
"""metres, share, radians: what a sample must hold to"""
FINAL_GATE, FINAL_STEPS = 0.3, 30


def open3d_matcher(o3d: ModuleType, tries: int, confidence: float) -> Run:
    """RANSAC on features, then point-to-plane ICP."""
    registration = o3d.pipelines.registration

    def run(scan_1: LaserScan, scan_2: LaserScan) -> Pose2 | None:
        (wall_1, features_1), (wall_2, features_2) = (_features(o3d, s.returns()[0]) for s in (scan_1, scan_2))
        o3d.utility.random.seed(SEED)
        guess = registration.registration_ransac_based_on_feature_matching(
            wall_2,
            wall_1,
            features_2,
            features_1,
            False,  # mutual filter
            AGREES,
            registration.TransformationEstimationPointToPoint(False),
            3,
            [
                registration.CorrespondenceCheckerBasedOnEdgeLength(SAME_LENGTH),
                registration.CorrespondenceCheckerBasedOnDistance(AGREES),
                registration.CorrespondenceCheckerBasedOnNormal(SAME_NORMAL),
            ],
            registration.RANSACConvergenceCriteria(tries, confidence),
        )
        pose = flat(guess.transformation)
        return None if pose is None else _settled(registration, wall_1, wall_2, pose)

    return run


def _features(o3d: ModuleType, points: FloatArray) -> tuple[Any, Any]:
    """The upright walls of a scan with normals towards the sensor, and their FPFH features."""
    search = o3d.geometry.KDTreeSearchParamHybrid
    thinned = np.asarray(_open3d_cloud(o3d, lifted(points)).voxel_down_sample(VOXEL).points)[:, :2]
    wall = _open3d_cloud(o3d, layered(thinned))
    wall.estimate_normals(search(NORMAL_RADIUS, NORMAL_NEIGHBOURS))
    wall.orient_normals_towards_camera_location(np.zeros(3))
    features = o3d.pipelines.registration.compute_fpfh_feature(wall, search(FEATURE_RADIUS, FEATURE_NEIGHBOURS))
    return wall, features


def _open3d_cloud(o3d: ModuleType, points: FloatArray) -> Any:
    cloud = o3d.geometry.PointCloud()
    cloud.points = o3d.utility.Vector3dVector(points)
    return cloud


def _settled(registration: Any, wall_1: Any, wall_2: Any, pose: Pose2) -> Pose2 | None:
    estimation = registration.TransformationEstimationPointToPlane()
    criteria = registration.ICPConvergenceCriteria(max_iteration=FINAL_STEPS)
    return flat(
        registration.registration_icp(wall_2, wall_1, FINAL_GATE, matrix(pose), estimation, criteria).transformation
    )
