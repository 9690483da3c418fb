"""The merged map on its way from one state of the pose graph to the next: what a decision moved, as it moves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

from app.content import Content
from app.map_looks import Motion
from segmap.pose import FloatArray, Pose2, wrap
from segmap.scans import ScanId

__all__ = ["FRAMES", "FRAME_SECONDS", "on_the_way"]

FRAMES, FRAME_SECONDS = 12, 0.05
MOVED = 0.01, 0.002
"""metres and radians; scans that move less do not seem to move"""
MOST_WALLS = 4000
"""segments of scans; where there are more only the trajectory moves"""


def on_the_way(before: Content, after: Content, walls_of: Callable[[ScanId], FloatArray]) -> Iterator[Content]:
    """Pictures between two states of the map, slow at both ends; none where nothing moves, or it was not looked at."""
    starts = _starts(before, after) if before.stage == after.stage == "map" and after.map.motion is None else {}
    if not starts:
        return
    ends = {scan: pose for part in after.components for scan, pose in part.poses.items()}
    walls = _walls(after, walls_of)
    for frame in range(1, FRAMES):
        share = frame / FRAMES
        eased = share * share * (3.0 - 2.0 * share)
        poses = {scan: _between(start, ends[scan], eased) for scan, start in starts.items()}
        yield replace(after, map=replace(after.map, motion=Motion(poses, walls)))


def _starts(before: Content, after: Content) -> Mapping[ScanId, Pose2]:
    """Where the scans that move were, in the frames of their components now; empty where none does."""
    frames = {part.scans[0]: part.poses for part in before.components}
    starts = {}
    for part in after.components:
        held = frames.get(part.scans[0], {})
        starts.update(
            {scan: held[scan] for scan, pose in part.poses.items() if scan in held and _far(held[scan], pose)}
        )
    return starts


def _far(pose: Pose2, other: Pose2) -> bool:
    metres, radians = pose.distance(other)
    return metres > MOVED[0] or radians > MOVED[1]


def _between(start: Pose2, end: Pose2, share: float) -> Pose2:
    turn = float(wrap(end.theta - start.theta))
    return Pose2(start.x + share * (end.x - start.x), start.y + share * (end.y - start.y), start.theta + share * turn)


def _walls(content: Content, walls_of: Callable[[ScanId], FloatArray]) -> Mapping[ScanId, FloatArray]:
    """The segments of all scans that are shown, or none where they are too many to be moved."""
    walls: dict[ScanId, FloatArray] = {}
    count = 0
    for scan in content.places:
        walls[scan] = walls_of(scan)
        count += len(walls[scan])
        if count > MOST_WALLS:
            return {}
    return walls
