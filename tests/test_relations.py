"""The relations metric."""

from __future__ import annotations

import math

import numpy as np
import pytest

from segmap.errors import LogError
from segmap.logs.tables import Relation, RelationsFile, Trajectory, read_relations, read_trajectory
from segmap.pose import Pose2
from segmap.relations import against_relations

POSES = (Pose2(1.0, 2.0, 0.5), Pose2(3.0, 2.5, -1.0), Pose2(4.0, -1.0, 3.0))
TIMES = np.array([10.0, 11.0, 12.0])


def relations(*rows: tuple[float, float, Pose2]) -> RelationsFile:
    return RelationsFile("a.relations", tuple(Relation(a, b, T, i) for i, (a, b, T) in enumerate(rows, start=1)))


def trajectory(poses=POSES) -> Trajectory:
    return Trajectory("a.tum", TIMES, tuple(poses))


def between(i: int, j: int) -> Pose2:
    return POSES[i].inverse() @ POSES[j]


def test_no_error_where_they_agree():
    """A trajectory agrees with relations taken from it, wherever it lies, forwards and backwards in time."""
    file = relations((10.0, 11.0, between(0, 1)), (12.0, 10.0, between(2, 0)))
    elsewhere = [Pose2(-5.0, 8.0, 2.0) @ pose for pose in POSES]
    found = against_relations(trajectory(elsewhere), file)
    assert (found.relations, found.matched) == (2, 2)
    assert found.errors == pytest.approx(np.zeros((2, 2)), abs=1e-9)


def test_errors_are_what_is_left_over():
    """An error of 0.3 m and 0.4 m is 0.5 m whichever way the robot looks; mean and standard deviation of all."""
    off = Pose2(0.3, 0.4, -0.1)
    file = relations((10.0, 11.0, between(0, 1) @ off.inverse()), (11.0, 12.0, between(1, 2)))
    found = against_relations(trajectory(), file)
    assert found.errors[:, 0].tolist() == pytest.approx([0.5, 0.0], abs=1e-9)
    assert (found.translation_mean_m, found.translation_std_m) == pytest.approx((0.25, 0.25))
    assert (found.rotation_mean_deg, found.rotation_std_deg) == pytest.approx((math.degrees(0.05),) * 2)


def test_times_match_within_two_milliseconds():
    """Relations with a time farther than 2 ms from any pose are counted and left out."""
    file = relations((10.0019, 10.9981, between(0, 1)), (10.003, 11.0, between(0, 1)), (11.0, 99.0, between(0, 1)))
    found = against_relations(trajectory(), file)
    assert (found.relations, found.matched) == (3, 1)


def test_nothing_matches():
    """Where no times match it is said which times there are."""
    with pytest.raises(
        LogError, match=r"No relation .*1\.000 to 2\.000 s.*10\.000 to 12\.000 s.*time stamps of the log"
    ):
        against_relations(trajectory(), relations((1.0, 2.0, Pose2.identity())))


def test_where_the_laser_is_mounted():
    """Relations of the robot and a trajectory of its laser agree once the mount is known, and not before."""
    mount = Pose2(-0.04, 0.1, 0.3)
    lasers = [pose @ mount for pose in POSES]
    file = relations((10.0, 11.0, between(0, 1)), (11.0, 12.0, between(1, 2)))
    assert against_relations(trajectory(lasers), file, mount).errors == pytest.approx(np.zeros((2, 2)), abs=1e-9)
    assert against_relations(trajectory(lasers), file).translation_mean_m > 0.05


@pytest.mark.parametrize(("name", "matched", "most"), [("intel", 473, 0.05), ("fr079", 136, 0.06)])
def test_poses_of_the_real_graph_logs(datasets, name, matched, most):
    """The poses written in the graph logs agree with the checked relations to a few centimetres."""
    poses = read_trajectory(datasets / name / f"{name}-graph.log.gz")
    found = against_relations(poses, read_relations(datasets / name / f"{name}.relations.gz"))
    assert found.matched == matched
    assert 0.01 < found.translation_mean_m < most
    assert found.rotation_mean_deg < 1.0
