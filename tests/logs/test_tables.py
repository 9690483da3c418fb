"""Relations and trajectories, good and bad."""

from __future__ import annotations

import gzip

import numpy as np
import pytest

from segmap.errors import LogError
from segmap.export.tum import trajectory
from segmap.logs.stamps import nearest_stamps
from segmap.logs.tables import read_relations, read_trajectory
from segmap.pose import Pose2

RELATIONS = "1.5 2.5 0.4 0.1 0 0 0 0.2\n# remark\n2.5 3.5 0.4 0.1 9 0 0 -0.2\n"


def test_relations_plain_and_compressed():
    """Times, the pose in the plane and the line of each relation."""
    for content in (RELATIONS.encode(), gzip.compress(RELATIONS.encode())):
        file = read_relations(content, "a.relations")
        assert [(r.time_1, r.time_2, r.T_1_2, r.line) for r in file.relations] == [
            (1.5, 2.5, Pose2(0.4, 0.1, 0.2), 1),
            (2.5, 3.5, Pose2(0.4, 0.1, -0.2), 3),
        ]
        assert file.problems == ()


def test_a_trajectory_as_we_write_it():
    """Our own TUM files come back; times are sorted, and of two poses at one time the first counts."""
    poses = [Pose2(1.0, 2.0, 3.0), Pose2(-1.0, 0.5, -2.0)]
    written = trajectory(poses, [10.0, 11.0], ["remark"])
    read = read_trajectory(written + b"9.0 7 7 0 0 0 0 1\n10.0 0 0 0 0 0 0 1\n", "a.tum")
    assert read.times.tolist() == [9.0, 10.0, 11.0]
    assert [pose.distance(other) for pose, other in zip(read.poses[1:], poses, strict=True)] == [
        pytest.approx((0.0, 0.0), abs=1e-6)
    ] * 2


def test_the_poses_of_a_log(small_log):
    """The poses and times that a log's scans were written with serve as a trajectory."""
    read = read_trajectory(small_log.replace(b"12.5 host", b"13.5 host", 1), "run.log")
    assert read.times.tolist() == [12.5, 13.5]
    assert read.poses[0] == Pose2(1.0, 2.0, 0.5)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("1 2 3", "there are 3 numbers instead of 8"),
        ("1 2 3 4 5 6 7 8 9", "9 numbers"),
        ("1 2 3 4 0 0 0 x", "number 8 is 'x'"),
        ("1 nan 3 4 0 0 0 1", "number 2 is 'nan'"),
    ],
)
@pytest.mark.parametrize("read", [read_relations, read_trajectory])
def test_a_bad_row_costs_only_itself(read, line, said):
    """A row that cannot be read is told of with its line."""
    file = read(f"1 2 0 0 0 0 0 1\n{line}\n".encode(), "a.txt")
    (problem,) = file.problems
    assert problem.line == 2
    assert said in problem.reason


@pytest.mark.parametrize(
    ("read", "line", "said"),
    [
        (read_relations, "1 2 0 0 0 0.1 0 0", "leans"),
        (read_trajectory, "1 0 0 0 0.6 0 0 0.8", "leans"),
        (read_trajectory, "1 0 0 0 0 0 0 0.5", "no rotation"),
    ],
)
def test_what_is_not_in_the_plane(read, line, said):
    """Rows that lean, or do not turn properly, are left out; where nothing is left the file is refused."""
    with pytest.raises(LogError, match=f"holds no .*line 1: .*{said}"):
        read(line.encode(), "a.txt")


@pytest.mark.parametrize(
    ("read", "content", "said"),
    [
        (read_relations, b"", "holds no relation: it is empty"),
        (read_trajectory, b"# only remarks\n", "holds no pose: it is empty"),
        (read_trajectory, b"hello\n", "no TUM trajectory .* and as a log: .* no laser log"),
        (read_trajectory, b"Odometry 1 2 3\nLaser 1 2.0\n", "holds no poses with times"),
    ],
)
def test_other_files(read, content, said):
    """An empty file and one of another kind are refused in a sentence that says what was expected."""
    with pytest.raises(LogError, match=said):
        read(content, "a.txt")


def test_the_nearest_stamp_is_that_of_brute_force():
    """Every wanted time gets the nearest stamp, if that is near enough."""
    rng = np.random.default_rng(0)
    stamps, wanted = np.sort(rng.uniform(0.0, 1.0, 200)), rng.uniform(-0.1, 1.1, 500)
    distances = np.abs(stamps[None] - wanted[:, None])
    expected = np.where(distances.min(axis=1) <= 0.002, distances.argmin(axis=1), -1)
    assert nearest_stamps(stamps, wanted).tolist() == expected.tolist()
    assert nearest_stamps(np.empty(0), wanted[:2]).tolist() == [-1, -1]
