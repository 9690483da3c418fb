"""Poses of scans as a TUM trajectory: ``time x y z qx qy qz qw`` a line, what evo and others read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from segmap.export.components import Content, ExportFormat, MapComponent, told_of
from segmap.pose import Pose2

__all__ = ["TUM", "left_out", "trajectory", "write_tum"]


def write_tum(content: Content) -> bytes:
    """The poses of the largest component; the scans of the others have other frames, and are listed in comments."""
    largest = _largest(content.components)
    scans = sorted(largest.poses) if largest else []
    poses = [largest.poses[scan] for scan in scans] if largest else []
    times = [content.times.get(scan) for scan in scans]
    return trajectory(poses, times, [*told_of(content.metadata), *left_out(content.components)])


def left_out(components: Sequence[MapComponent]) -> list[str]:
    """A line for each component whose scans are not in the trajectory, as its frame is another."""
    largest = _largest(components)
    return [
        f"not in this frame: {component.name}, scans {', '.join(map(str, sorted(component.scans)))}"
        for component in components
        if component is not largest
    ]


def _largest(components: Sequence[MapComponent]) -> MapComponent | None:
    return max(components, key=lambda component: len(component.scans), default=None)


def trajectory(poses: Sequence[Pose2], times: Sequence[float | None], remarks: Sequence[str] = ()) -> bytes:
    """The poses of some scans in one frame, in the order they were taken, as the bytes of a TUM file.

    ``times`` are seconds; where one is missing, or they do not grow, scans are numbered from 0
    instead, and the file says so. ``remarks`` become comments at its beginning.

    >>> print(trajectory([Pose2(1.0, 2.0, 0.0)], [0.5]).decode(), end="")
    # time x y z qx qy qz qw; seconds, metres
    0.500000 1.000000 2.000000 0.000000 0.000000000 0.000000000 0.000000000 1.000000000
    """
    stamps = [time for time in times if time is not None]
    grows = len(stamps) == len(times) and all(a < b for a, b in pairwise(stamps))
    head = "time x y z qx qy qz qw; seconds, metres" if grows else "number x y z qx qy qz qw; scans numbered, metres"
    comments = [f"# {' '.join(line.split())}" for line in (*remarks, head)]
    rows = [_row(stamp, pose) for stamp, pose in zip(stamps if grows else range(len(poses)), poses, strict=True)]
    return "".join(f"{line}\n" for line in (*comments, *rows)).encode("utf-8")


def _row(stamp: float, pose: Pose2) -> str:
    turn = 0.0, 0.0, math.sin(pose.theta / 2.0), math.cos(pose.theta / 2.0)
    place = " ".join(f"{number + 0.0:.6f}" for number in (pose.x, pose.y, 0.0))
    return f"{stamp:.6f} {place} {' '.join(f'{number + 0.0:.9f}' for number in turn)}"


TUM = ExportFormat(
    name="tum",
    suffix=".tum",
    media_type="text/plain",
    title="TUM",
    use="the poses of the scans of the largest component",
    holds="Trajectory",
    write=write_tum,
)
