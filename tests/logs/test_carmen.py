"""CARMEN logs, line by line."""

from __future__ import annotations

import math

import numpy as np
import pytest

from segmap.errors import LogError
from segmap.logs import read_log
from segmap.pose import Pose2


def read(*lines: str):
    return read_log("\n".join(lines).encode(), "robot.log")


def test_flaser(flaser):
    """An FLASER record keeps its ranges, its laser pose, its time and its line."""
    log = read("# CARMEN Logfile", flaser(1.0, 2.0, 3.0))
    assert (log.name, log.format, len(log), log.problems) == ("robot.log", "CARMEN", 1, ())
    scan = log[0]
    assert scan.ranges.tolist() == [1.0, 2.0, 3.0]
    assert (scan.logged_pose, scan.time, scan.line) == (Pose2(1.0, 2.0, 0.5), 12.5, 2)


@pytest.mark.parametrize(
    ("beams", "first", "step"),
    [(180, -90, 1), (181, -90, 1), (360, -90, 0.5), (361, -90, 0.5), (401, -50, 0.25), (1, -90, 180)],
)
def test_flaser_angles(flaser, beams, first, step):
    """The number of readings says where an FLASER beam looks."""
    scan = read(flaser(*np.linspace(1.0, 2.0, beams)))[0]
    assert math.degrees(scan.first_angle) == pytest.approx(first)
    assert math.degrees(scan.angle_step) == pytest.approx(step)


@pytest.mark.parametrize(
    ("rest", "pose", "time"),
    [
        ("", None, None),
        ("1 2 0.5", Pose2(1, 2, 0.5), None),
        ("1 2 0.5 1 2 0.6", Pose2(1, 2, 0.5), None),
        ("1 2 0.5 1 2 0.6 7 host", Pose2(1, 2, 0.5), 7.0),
        ("81.9 1 2 0.5 1 2 0.6 7 host 8", Pose2(1, 2, 0.5), 7.0),
        ("1 2 nan 1 2 0.6 7 host 8", None, 7.0),
    ],
)
def test_flaser_endings(flaser, rest, pose, time):
    """Writers differ in what follows the readings; what is there is taken."""
    scan = read(flaser(1.0, 2.0, rest=rest))[0]
    assert (scan.logged_pose, scan.time) == (pose, time)


def test_robotlaser(robotlaser):
    """A ROBOTLASER1 record says itself where its beams look and how far."""
    scan = read(robotlaser(1.0, 2.0, 3.0, remissions=(10, 20, 30)))[0]
    assert (scan.first_angle, scan.angle_step, scan.max_range) == (-1.5, 0.01, 50.0)
    assert (scan.logged_pose, scan.time) == (Pose2(1.0, 2.0, 0.5), 12.5)
    assert scan.ranges.tolist() == [1.0, 2.0, 3.0]


def test_every_laser_counts(flaser, robotlaser):
    """Front, rear and numbered lasers are scans alike, in file order."""
    log = read(flaser(1.0), flaser(2.0, word="RLASER"), robotlaser(3.0), robotlaser(4.0, word="ROBOTLASER2"))
    assert [scan.ranges.tolist() for scan in log] == [[1.0], [2.0], [3.0], [4.0]]


@pytest.mark.parametrize("rest", ["", "12.5 host 13"])
def test_old_third_laser(flaser, rest):
    """LASER3 and its like have readings and a time, and no pose."""
    log = read(flaser(1.0, 2.0), f"LASER3 181 {'2.5 ' * 181} {rest}")
    assert (len(log), log.problems) == (2, ())
    assert (log[1].logged_pose, log[1].time) == (None, 12.5 if rest else None)
    assert math.degrees(log[1].angle_step) == pytest.approx(1.0)


@pytest.mark.parametrize("word", ["ROBOTLASER2", "RAWLASER4"])
def test_records_without_a_mode_of_remission(robotlaser, word):
    """Earlier CARMEN wrote one word less before the readings; both are told apart by what follows."""
    new = robotlaser(1.25, 2.5, 3.75, word=word, remissions=(1, 2))
    words = new.split()
    old, twin = (read(line)[0] for line in (" ".join((*words[:7], *words[8:])), new))
    assert old.ranges.tolist() == [1.25, 2.5, 3.75]
    assert (old.first_angle, old.angle_step, old.max_range) == (twin.first_angle, twin.angle_step, twin.max_range)
    assert (old.time, old.logged_pose) == (twin.time, twin.logged_pose)


def test_raw_records(robotlaser):
    """A raw record is a scan, unless the log has the same sweep with a pose."""
    raw = robotlaser(1.0, 2.0, word="RAWLASER1")
    log = read(raw)
    assert (len(log), log[0].time, log[0].logged_pose) == (1, 12.5, None)
    assert [scan.logged_pose is None for scan in read(raw, robotlaser(1.0, 2.0))] == [False]


def test_graph_log(robotlaser):
    """The vertices and edges of a graph log are no problem."""
    assert read("VERTEX2 0 1 2 3", robotlaser(1.0), "EDGE2 1 0 1 2 3 1 0 1 1 0 0").problems == ()


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("FLASER", "ends before the number of readings"),
        ("FLASER x 1 2", "the number of readings is 'x'"),
        ("FLASER -3 1 2", "the number of readings is '-3'"),
        ("FLASER 99999999999999 1 2", "the number of readings is '99999999999999'"),
        ("FLASER 180 1 2 3", "announces 180 readings and holds 3"),
        ("FLASER 3 1 1_0 3 1 2 3", "reading 1 is '1_0', not a number"),
        ("FLASER 3 1 two 3 1 2 3", "reading 1 is 'two', not a number"),
        ("FLASER 3 1 2 3 1 2", "ends with 2 words after its readings"),
        ("FLASER 3 1 2 3 2 0.5 1 2 0.6 7 host 8", "the time is 'host'"),
        ("FLASER 1 1 x 2 3", "coordinate 0 is 'x'"),
        ("FLASER 1 " + "\x00<b>" * 20 + " 2 3", "reading 0 is "),
        ("ROBOTLASER1 0 -1.5 3 0.01 50 0.1 0", "ends before the number of readings"),
        ("ROBOTLASER1 0 -1.5 3 nan 50 0.1 0 1 1 0 " + "0 " * 11 + "7 host 8", "the angle step is 'nan'"),
        ("ROBOTLASER1 0 -1.5 3 0 50 0.1 0 2 1 1 0 " + "0 " * 11 + "7 host 8", "angle step of a scan must not be 0"),
        ("ROBOTLASER1 0 -1.5 3 0.01 50 0.1 0 1 1", "ends before the number of remissions"),
        ("ROBOTLASER1 0 -1.5 3 0.01 50 0.1 0 1 1 0 1 2 3", "ends with 3 words after its readings instead of 14"),
        ("LASER3 1 2 3 4 5 6", "ends with 4 words after its readings instead of 3"),
        ("FLASRE 3 1 2 3", "'FLASRE' starts no record of this format"),
    ],
)
def test_bad_lines(flaser, line, reason):
    """A bad line is left out with its number and a reason, and costs nothing else."""
    log = read(flaser(1.0), line, flaser(2.0))
    assert [scan.ranges[0] for scan in log] == [1.0, 2.0]
    (problem,) = log.problems
    assert problem.line == 2
    assert reason in problem.reason
    assert str(problem).isprintable()


def test_many_bad_lines(flaser):
    """The first hundred problems are told, the others counted."""
    log = read(flaser(1.0), *["FLASER bad"] * 250)
    assert len(log) == 1
    assert len(log.problems) == 101
    assert "150 more problems" in str(log.problems[-1])


def test_unknown_words(flaser):
    """A word nobody knows is told once, not for each line."""
    log = read(flaser(1.0), *["WHEELS 1 2 3"] * 50, *["wheels 1 2 3"] * 50)
    assert [problem.line for problem in log.problems] == [2, 52]


def test_strange_ranges(flaser):
    """Zero, negative, infinite, absurd and tiny readings, and NaN, are beams without a return."""
    scan = read("FLASER 8 1 0 -2 inf nan 1e9 0.019 2")[0]
    assert np.isnan(scan.ranges).tolist() == [False, True, True, True, True, True, True, False]


def test_millimetres():
    """Ranges that cannot be metres are told of, with the remedy."""
    assert "convert them to metres" in str(read("FLASER 4 1200 2300 900 8191").problems[0])
    assert read("FLASER 4 1.2 81.91 81.91 81.91").problems == ()


def test_too_many_beams(flaser):
    """A record with more beams than any laser has is left out."""
    log = read(flaser(1.0), "FLASER 100001 " + "1 " * 100_001)
    assert len(log) == 1
    assert "100001 beams" in str(log.problems[0])


def test_no_scans():
    """A log without laser records is a log of no scans that says so."""
    log = read("# CARMEN Logfile", "ODOM 1 2 3 4 5 6 7 host 8")
    assert (len(log), log.no_return) == (0, None)
    assert "without laser scans" in str(log.problems[0])


@pytest.mark.parametrize(
    "content", [b"hello\nworld\n", b"VERTEX9 0 0 0 0\n", bytes(range(256)), b"\x89PNG\r\n\x1a\n" + bytes(64), b"FLASER"]
)
def test_no_log(content):
    """A file of another kind is refused in one sentence that says what was expected."""
    with pytest.raises(
        LogError, match=r"^notes\.txt is no laser log .* (line 1 starts with|it is binary).* Expected .*CARMEN"
    ) as error:
        read_log(content, "notes.txt")
    assert str(error.value).isprintable()
