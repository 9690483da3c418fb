"""CSV and JSON of ranges."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from segmap.errors import LogError
from segmap.logs import json_stream, ranges_json, read_log
from segmap.pose import Pose2

RANGES = [2.5, 2.25, 1.0, 3.0]


def csv(*lines: str):
    return read_log("\n".join(lines).encode(), "run.csv")


def same_scan(scan, time=0.5, pose=None) -> None:
    """The scan that every format of these tests writes."""
    assert scan.ranges.tolist() == RANGES
    assert math.degrees(scan.first_angle) == pytest.approx(-90.0)
    assert math.degrees(scan.angle_step) == pytest.approx(2.0)
    assert (scan.time, scan.logged_pose) == (time, pose)


@pytest.mark.parametrize(
    "lines",
    [
        ("time,first_angle_deg,angle_step_deg,ranges", "0.5,-90,2,2.5,2.25,1,3"),
        ("# made by hand", "", "Time, First_Angle_Deg, Angle_Step_Deg, r0, r1, r2, r3", "0.5, -90, 2, 2.5, 2.25, 1, 3"),
        ("time;first_angle_deg;angle_step_deg;ranges", "0,5;-90;2;2,5;2,25;1;3"),
        ("angle_min\tangle_increment\ttime\tranges", f"{-math.pi / 2}\t{math.pi / 90}\t0.5\t2.5\t2.25\t1\t3"),
        ('"r0","r1","r2","r3","time","first_angle_deg","angle_step_deg"', '"2.5","2.25","1","3","0.5","-90","2"'),
        ("\ufefftime,first_angle_deg,angle_step_deg,ranges\r", "0.5,-90,2,2.5,2.25,1,3\r", ""),
    ],
)
def test_csv(lines):
    """Columns by name in any order, separators, comments, quotes and line ends as programs write them."""
    log = csv(*lines)
    assert (log.format, len(log), log.problems) == ("CSV", 1, ())
    same_scan(log[0])


def test_csv_with_everything():
    """Pose, limit of range and sensor; what stands for no return."""
    log = csv(
        "sensor,x,y,theta_deg,max_range,first_angle,angle_step,ranges",
        "front,1,2,90,8,-1.5,0.5,1.0,,nan,inf,8.0,0",
        "rear,1,2,,,-1.5,0.5,1.0,2.0",
    )
    assert [scan.logged_pose for scan in log] == [Pose2(1.0, 2.0, math.pi / 2), None]
    assert np.isfinite(log[0].ranges).tolist() == [True] + [False] * 5
    assert (log[0].max_range, log[1].max_range, log[0].time) == (8.0, math.inf, None)


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        ("0.5,-90", "the row has 2 values, fewer than its header names"),
        ("0.5,-90,2,1.0,two", "reading 1 is 'two', not a number"),
        ("0.5,-90,2,1_0", "reading 0 is '1_0'"),
        ("soon,-90,2,1.0", "the time is 'soon'"),
        ("0.5,,2,1.0", "the scan has no first_angle (radians) and no first_angle_deg"),
        ("0.5,-90,0,1.0,1.0", "angle step of a scan must not be 0"),
    ],
)
def test_bad_rows(row, reason):
    """A bad row is left out with its line and a reason, and costs nothing else."""
    good = "0.5,-90,2,2.5,2.25,1,3"
    log = csv("time,first_angle_deg,angle_step_deg,ranges", good, row, good)
    assert len(log) == 2
    assert str(log.problems[0]).startswith("line 3: ")
    assert reason in str(log.problems[0])


def test_unknown_columns():
    """A column nobody knows is passed over and told of."""
    log = csv("frame,first_angle_deg,angle_step_deg,ranges", "laser,-90,2,2.5,2.25,1,3")
    same_scan(log[0], time=None)
    assert "the column 'frame' means nothing here" in str(log.problems[0])


SCAN = {"time": 0.5, "first_angle_deg": -90, "angle_step_deg": 2, "ranges": RANGES}


@pytest.mark.parametrize(
    "held",
    [
        {"scans": [SCAN]},
        [SCAN],
        SCAN,
        {"first_angle_deg": -90, "angle_step_deg": 2, "scans": [{"time": 0.5, "ranges": RANGES}]},
        {"angle_min": 0, "angle_increment": 1, "scans": [{**SCAN, "angle_min": None, "angle_increment": None}]},
    ],
)
def test_json(held):
    """A document of scans, with or without what holds for all of them, on one line or many."""
    for indent in (None, 2):
        log = read_log(json.dumps(held, indent=indent).encode(), "run.json")
        assert (len(log), log.problems) == (1, ())
        same_scan(log[0])


def test_json_lines():
    """A scan a line; a line that cannot be read costs only itself."""
    lines = [json.dumps({**SCAN, "pose": [1, 2, 0.5]}), "{", "", "7", json.dumps({"ranges": [1]}), json.dumps(SCAN)]
    log = read_log("\n".join(lines).encode())
    assert log.format == "JSON lines"
    assert [scan.logged_pose for scan in log] == [Pose2(1.0, 2.0, 0.5), None]
    assert [problem.line for problem in log.problems] == [2, 4, 5]


def test_json_without_returns():
    """null, NaN and Infinity stand for no return."""
    log = read_log(b'{"first_angle": 0, "angle_step": 1, "scans": [{"ranges": [1.5, null, NaN, Infinity, 0, -1]}]}')
    assert np.isfinite(log[0].ranges).tolist() == [True] + [False] * 5


@pytest.mark.parametrize(
    ("scan", "reason"),
    [
        ({"ranges": 7}, "ranges is no list of numbers"),
        ({"ranges": [1, "2"]}, "ranges holds something that is no number"),
        ({"ranges": [True]}, "ranges holds something that is no number"),
        ({"ranges": [10**400]}, "ranges holds a number that is too large"),
        ({"ranges": [1], "time": "now"}, "time holds something that is no number"),
        ({"ranges": [1], "pose": 7}, "pose is no list of numbers"),
        ({"ranges": [1], "angle_step_deg": math.inf}, "angle_step is inf, not a finite number"),
        ([], "it is no object with ranges"),
    ],
)
def test_bad_scans(scan, reason):
    """A bad scan is left out with its number and a reason."""
    held = {"first_angle_deg": -90, "angle_step_deg": 2, "scans": [SCAN, scan, SCAN]}
    log = read_log(json.dumps(held).encode())
    assert len(log) == 2
    assert str(log.problems[0]) == f"scan 2: {reason}; the scan was left out"


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b'{"ranges": [1, 2', "it is no valid JSON: expecting ',' delimiter, line 1, 17"),
        (b'{"ranges": "\xff"}', "not written in UTF-8"),
        (b'{"ranges": ' + b"[" * 100_000, "it is no JSON that can be read"),
        (b'{"scans": 7, "ranges": []}', "has no list of scans"),
        (b'{"ranges": [' + b"1," * (1 << 24) + b"1]}", "it holds one value of more than 16 MiB"),
    ],
)
def test_bad_documents(content, reason):
    """What is no JSON, or too much of it, is refused in a sentence with the remedy."""
    with pytest.raises(LogError, match=r"^run\.json ") as refused:
        read_log(content, "run.json")
    assert reason in str(refused.value)
    assert str(refused.value).isprintable()


SCANS = st.lists(
    st.builds(
        lambda values, more: {"ranges": values, **more},
        st.lists(st.one_of(st.none(), st.floats(), st.integers(-3, 300)), max_size=6),
        st.sampled_from([{}, {"time": 2.5}, {"sensor": 'b"\\é\U0001f916'}, {"pose": [1, 2, 0.5]}, {"x": "no"}]),
    ),
    max_size=5,
)
COMMON = st.sampled_from(
    [{}, {"first_angle_deg": -90, "angle_step_deg": 2}, {"remark": {"é": [1, {}]}, "max_range": 8}]
)


@given(SCANS, COMMON, st.sampled_from([None, 1]), st.booleans(), st.integers(0, 400), st.sampled_from([1, 7, 4096]))
def test_a_large_document_is_read_as_a_small_one(scans, common, indent, escaped, cut, piece):
    """Scan by scan or at once, whole or cut off anywhere: the same scans and problems, or both are refused."""
    held = json.dumps({**common, "scans": scans}, indent=indent, ensure_ascii=escaped).encode()
    content = held[: len(held) - cut if cut < len(held) else None]
    with pytest.MonkeyPatch.context() as patch:
        at_once = _told(content)
        patch.setattr(ranges_json, "DOCUMENT", 1)
        patch.setattr(json_stream, "PIECE", piece)
        assert _told(content) == at_once


def _told(content):
    try:
        log = read_log(content, "run.json")
    except LogError as error:
        return str(error).replace("',' or '}'", "',' delimiter").replace("',' or ']'", "',' delimiter")
    return [(str(scan.ranges), scan.time, scan.logged_pose) for scan in log], log.problems


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (
            b'{"scans": [{"ranges": []}], "max_range": 8}',
            "says max_range after its scans: in a large",
        ),
        (b'{"scans": [], "scans": [{"ranges": []}]}', "has two lists of scans"),
        (b'{"ranges": [],\n"scans": 7}', "has no list of scans"),
        (b'{\n"ranges": []}\n ]', "extra data, line 3, 2"),
        (b'{"ranges": [],\n7: 8}', "expecting property name enclosed in double quotes, line 2, 1"),
        (b'[{"ranges": []}\n{}]', "expecting ',' or ']', line 2, 1"),
        (b'[{"ranges": "\xff"}]', "not written in UTF-8"),
        (b'{"ranges": ' + b"[" * 100_000, "it is no JSON that can be read"),
    ],
)
def test_bad_large_documents(monkeypatch, content, reason):
    """What is wrong in a large document, and in which line."""
    monkeypatch.setattr(ranges_json, "DOCUMENT", 1)
    with pytest.raises(LogError, match=r"^run\.json ") as refused:
        read_log(content, "run.json")
    assert reason in str(refused.value)
