"""DP-SLAM logs, line by line."""

from __future__ import annotations

import pytest

from segmap.logs import read_log
from segmap.pose import Pose2


def read(*lines: str):
    return read_log("\n".join(lines).encode(), "loop.log")


def test_scans():
    """A scan takes the pose of the odometry line before it."""
    log = read("Odometry 1 2 0.5", "Laser 3 1 2 3", "Laser 3 1 2 4", "Odometry 2 2 0.5", "Laser 3 2 2 3")
    assert (log.format, log.problems) == ("DP-SLAM", ())
    assert [scan.logged_pose for scan in log] == [Pose2(1, 2, 0.5), None, Pose2(2, 2, 0.5)]
    assert log[1].ranges.tolist() == [1.0, 2.0, 4.0]


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("Laser 3 1 2", "announces 3 readings and holds 2"),
        ("Laser 2 1 2 3", "announces 2 readings and holds 3"),
        ("Laser 2 1 b", "reading 1 is 'b'"),
        ("Odometry 1 2", "needs x, y and theta"),
        ("Odometry 1 2 c", "coordinate 2 is 'c'"),
        ("Lasre 1 2", "'Lasre' starts no record"),
    ],
)
def test_bad_lines(line, reason):
    """A bad line is left out with its number and a reason; no scan takes the pose of another's line."""
    log = read("Odometry 1 2 0.5", line, "Laser 1 2")
    assert (len(log), log[0].ranges.tolist()) == (1, [2.0])
    assert [(problem.line, reason in problem.reason) for problem in log.problems] == [(2, True)]
    assert (log[0].logged_pose is None) == (line.split()[0] in ("Laser", "Odometry"))
