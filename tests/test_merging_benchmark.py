"""The script that measures merging, on a walk through a room whose truth is known."""

import importlib
import math
from dataclasses import replace
from pathlib import Path

import pytest
import simulated

from segmap.pose import Pose2
from segmap.scans import LaserLog

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def script():
    """The script, with its folder on the path as when it is run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "benchmarks"))
        yield importlib.import_module("merging")


@pytest.fixture(scope="module")
def log():
    """Scans along a walk, each with the pose it was taken from."""
    poses = [Pose2(1.0 + 0.06 * i, 2.0 + 0.4 * math.sin(0.3 * i), 0.12 * i) for i in range(40)]
    scans = (replace(simulated.noisy(simulated.room(), T, i, 12.0), logged_pose=T) for i, T in enumerate(poses))
    return LaserLog("room", tuple(scans))


def cells(table):
    """The rows of a table without the header, as text."""
    rows = [line for line in table.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in rows[2:]]


def test_methods_have_a_row_each(script, log):
    """Calls, seconds, components, wrong neighbours, doubles: for every method in both modes."""
    stretch = script.Stretch("room", log, 0, 2, 6)
    verified, paper = script.methods([stretch])
    assert verified.startswith("**verified mode**")
    assert paper.startswith("**paper mode**")
    rows = cells(verified)
    assert [row[1] for row in rows] == list(script.METHODS)
    assert [int(row[2]) for row in rows] == [5, 13, 5]  # the tree skips
    for row in rows:
        assert row[0] == "room 0 to 10, every 2."
        assert row[5:8] == ["1", "6", "0"]
        assert float(row[-1]) < 0.1


def test_wrong_neighbours_are_counted(script, log):
    """A component with one scan a metre off has two neighbours placed wrong."""
    stretch = script.Stretch("room", log, 0, 1, 5)
    scans = tuple(stretch.ids)
    poses = {scan: stretch.truth(scans[0], scan) for scan in scans}
    part = script.Component("", scans, poses, script.SegmentMap.empty())
    assert script._wrong(part, stretch) == 0
    poses[scans[2]] = Pose2(1.0, 0.0, 0.0) @ poses[scans[2]]
    assert script._wrong(part, stretch) == 2


def test_every_new_scan_is_timed(script, log, monkeypatch):
    """A row for each scan but the first, a column for each method; where no scans in a row integrate it says so."""
    monkeypatch.setitem(script.LOGS, "room", ("", 2))
    monkeypatch.setattr(script, "NEW", 3)
    tables = list(script.online({"room": log}, repeats=1))
    assert len(tables) == 3
    assert all("no 3 scans in a row integrate" in table or len(cells(table)) == 2 for table in tables)
    assert [row[0] for row in cells(tables[2])] == ["scan 2", "scan 4"]
    assert all(float(cell) > 0.0 for row in cells(tables[2]) for cell in row[1:])


def test_pairs_of_local_maps_are_told_right_or_wrong(script, log, monkeypatch):
    """Four maps of one room: every pair overlaps, and what is accepted is right; a wrong pose is put in brackets."""
    monkeypatch.setitem(script.LOGS, "room", ("", 1))
    monkeypatch.setattr(script, "LOCAL", 4)
    (table,) = script.robots({"room": log})
    rows = cells(table)
    assert [row[0] for row in rows] == ["L1, L2", "L1, L3", "L1, L4", "L2, L3", "L2, L4", "L3, L4"]
    assert [int(row[1]) for row in rows] == [2, 0, 0, 2, 0, 2]
    assert all(float(row[2]) > 50.0 for row in rows)
    assert all("accepted" in row[-3] and row[-3][0] != "(" for row in rows)
    assert script._told("5 m", Pose2(0.1, 0.0, 0.0), Pose2.identity()) == "5 m"
    assert script._told("5 m", Pose2(0.9, 0.0, 0.0), Pose2.identity()) == "(5 m)"
    assert script._told("0 m", None, Pose2.identity()) == "(0 m)"


def test_whole_logs_before_and_after(script, log):
    """Doubles along walls are counted, and gone."""
    (row,) = cells(script.fusion({"room": log}))
    assert row[:2] == ["room", "40"]
    assert float(row[4]) > 100.0
    assert float(row[7]) < 0.5
