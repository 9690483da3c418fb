"""Bags of ROS 1 and ROS 2, as the writers of rosbags write them; cut, damaged, hostile ones."""

from __future__ import annotations

import bz2
import gzip
import io
import sqlite3
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from bags import ECHOES, FIRST, ROS_1, ROS_2, SCAN, laser_scan, multi_echo, ranges, texts, write_ros1, write_ros2

from segmap.errors import LogError
from segmap.logs import Limits, read_log, read_logs
from segmap.logs.laser_messages import laser_record
from segmap.logs.text import MalformedError

KINDS = ("ros1", "ros1 BZ2", "ros1 LZ4", "SQLITE3", "SQLITE3 zstd", "MCAP", "MCAP zstd")
Write = Callable[..., bytes]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """A bag of a kind with the messages that ``make`` gives for the types of its ROS."""
    made = iter(range(100))

    def write(kind: str, make: Callable) -> bytes:
        place = tmp_path / f"bag-{next(made)}"
        name, _, packed = kind.partition(" ")
        if name == "ros1":
            return write_ros1(place.with_suffix(".bag"), make(ROS_1), packed or None)
        return write_ros2(place, make(ROS_2), name, bool(packed))

    return write


def scans(store, topics=("/scan",), count=5):
    """Scans of some topics in turn, between messages of another kind."""
    messages = []
    for number in range(count):
        messages += [(topic, SCAN, laser_scan(store, number + 100 * k)) for k, topic in enumerate(topics)]
        messages += texts(store, 2)
    return messages


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_bag_gives_the_scans_that_were_recorded(write, kind):
    """Ranges, angles, limits and time stamps of every scan, in the order they were recorded."""
    log = read_log(write(kind, scans), "run.bag")
    assert (log.name, log.topic, len(log), log.problems) == ("run.bag", "/scan", 5, ())
    for number, scan in enumerate(log):
        np.testing.assert_array_equal(scan.ranges, ranges(number).astype(float))
        assert scan.first_angle == -1.5
        assert scan.angle_step == pytest.approx(3.0 / 180)
        assert (scan.max_range, scan.time, scan.line) == (30.0, 1000.5 + number, number + 1)
        assert scan.logged_pose is None


@pytest.mark.parametrize("kind", ["ros1", "SQLITE3", "MCAP"])
def test_topics_are_logs_of_their_own(write, kind):
    """Two lasers are two logs; one of them can be chosen; none is chosen by itself."""
    content = write(kind, lambda store: scans(store, ("/front/scan", "/rear")))
    front, rear = read_logs(content, "run.bag")
    assert [(log.name, log.topic, len(log)) for log in (front, rear)] == [
        ("run.bag front.scan", "/front/scan", 5),
        ("run.bag rear", "/rear", 5),
    ]
    chosen = read_log(content, "run.bag", topic="/rear")
    assert chosen[0].ranges.tolist() == rear[0].ranges.tolist() == ranges(100).tolist()
    with pytest.raises(LogError, match=r"several laser topics, /front/scan \(5 scans\), /rear \(5 scans\): choose one"):
        read_log(content, "run.bag")
    with pytest.raises(LogError, match=r"run\.bag has no laser topic /top: it has /front/scan \(5 scans\)"):
        read_log(content, "run.bag", topic="/top")


@pytest.mark.parametrize("kind", ["ros1", "SQLITE3", "MCAP"])
def test_the_first_echo_counts(write, kind):
    """Of a laser with several echoes a beam, the first is its reading; a beam without echo has none."""
    log = read_log(write(kind, lambda store: [("/echoes", ECHOES, multi_echo(store, 0))]))
    expected = FIRST.astype(float)
    expected[1] = np.nan
    np.testing.assert_array_equal(log[0].ranges, expected)


@pytest.mark.parametrize("kind", ["ros1", "SQLITE3", "MCAP"])
def test_what_is_no_return(write, kind):
    """Infinite, nearer than the nearest, at the farthest or beyond, and NaN: beams without a return."""
    readings = np.array([np.inf, 0.04, 30.0, 31.0, np.nan, 0.0, 2.0, -1.0], np.float32)
    log = read_log(write(kind, lambda store: [("/scan", SCAN, laser_scan(store, 0, readings))]))
    assert np.isfinite(log[0].ranges).tolist() == [False] * 6 + [True, False]


@pytest.mark.parametrize("kind", ["ros1", "SQLITE3", "MCAP"])
def test_a_bag_without_scans_says_so(write, kind):
    """Messages of other kinds are no scans."""
    log = read_log(write(kind, lambda store: texts(store, 3)))
    assert len(log) == 0
    assert "without laser scans" in str(log.problems[0])


@pytest.mark.parametrize("kind", ["ros1", "SQLITE3", "MCAP"])
def test_a_message_without_time_has_the_time_of_its_recording(write, kind):
    """A driver that writes no time stamp leaves the recorder's."""

    def make(store):
        scan = laser_scan(store, 0)
        scan.header.stamp.sec = scan.header.stamp.nanosec = 0
        return [("/scan", SCAN, scan)]

    assert read_log(write(kind, make))[0].time == 2000.0


@pytest.mark.parametrize("kind", ["ros1", "SQLITE3", "MCAP"])
def test_impossible_scans_cost_only_themselves(write, kind):
    """A scan whose angles do not move is left out, with its number."""

    def make(store):
        wrong = laser_scan(store, 1, angle_increment=0.0)
        return [("/scan", SCAN, scan) for scan in (laser_scan(store, 0), wrong, laser_scan(store, 2))]

    log = read_log(write(kind, make))
    assert [scan.time for scan in log] == [1000.5, 1002.5]
    assert str(log.problems[0]).startswith("message 2: The angle step of a scan must not be 0")


@pytest.mark.parametrize("kind", KINDS)
def test_what_came_before_a_cut_is_kept(write, kind):
    """Wherever a bag ends, the scans before the end are read, and the cut is told; a database is refused as cut."""
    content = write(kind, lambda store: scans(store, count=40))
    for share in np.linspace(0.2, 0.9999, 23):
        part = content[: int(share * len(content))]
        if kind.startswith("SQLITE3"):
            with pytest.raises(LogError, match=r"cut\.bag is cut off: \d+ of \d+ bytes are there"):
                read_log(part, "cut.bag")
            continue
        log = read_log(part, "cut.bag")
        assert all((scan.ranges == ranges(number)).all() for number, scan in enumerate(log))
        assert log.problems or len(log) == 40


@pytest.mark.parametrize("kind", ["ros1", "MCAP"])
def test_a_recording_that_never_ended_is_read(write, kind):
    """A robot that lost power writes no index: all scans before are there."""
    content = write(kind, lambda store: scans(store, count=40))
    end = content.rindex(ranges(37).tobytes()) + len(ranges(37).tobytes())
    log = read_log(content[:end])
    assert len(log) >= 37
    assert "cut off" in str(log.problems[-1])


def test_sources(write, tmp_path):
    """A path, bytes and streams, plain or gzipped, give the same scans, whatever the name."""
    for kind in ("ros1", "SQLITE3", "MCAP"):
        content = write(kind, scans)
        path = tmp_path / "photo #1?.png"
        path.write_bytes(content)
        packed = tmp_path / "packed"
        packed.write_bytes(gzip.compress(content))
        sources = (path, str(path), content, io.BytesIO(content), gzip.compress(content), packed)
        assert {len(read_log(source)) for source in sources} == {5}


def test_a_database_is_read_where_it_lies(write, tmp_path):
    """Nothing is written beside a bag, and it stays as it is; a limit of size holds for it too."""
    path = tmp_path / "only" / "run.db3"
    path.parent.mkdir()
    path.write_bytes(content := write("SQLITE3", scans))
    assert len(read_log(path)) == 5
    assert [file.name for file in path.parent.iterdir()] == ["run.db3"]
    assert path.read_bytes() == content
    for source in (path, content):
        with pytest.raises(LogError, match="holds more than 4096 bytes"):
            read_log(source, limits=Limits(size=4096))


def test_the_folder_of_a_bag(tmp_path):
    """ROS 2 makes a folder for each bag: it stands for the one file of messages in it, not for several."""
    write_ros2(tmp_path / "run", scans(ROS_2), "MCAP")
    assert len(read_log(tmp_path / "run")) == 5
    (tmp_path / "run" / "run_1.mcap").write_bytes(b"")
    with pytest.raises(LogError, match=r"run holds 2 bags: give the files one by one"):
        read_log(tmp_path / "run")


def test_databases_that_are_no_bags(tmp_path):
    """Another database, or one whose tables are views, is refused or told of."""
    columns = "CREATE TABLE topics (id, name, type)"
    endless = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i, 1, 1 FROM n"
    tables = {
        "other": ["CREATE TABLE topics (a)", "CREATE TABLE messages (a)"],
        "view": [columns, f"CREATE VIEW messages (topic_id, timestamp, data) AS {endless}"],
        "strange": [
            columns,
            "CREATE TABLE messages (topic_id, timestamp, data)",
            "INSERT INTO topics VALUES (1, '/scan', 'sensor_msgs/msg/LaserScan'), ('a', 2, NULL)",
            "INSERT INTO messages VALUES (1, 0, NULL), (1, 0, 'text'), (NULL, 'x', x'00'), (1, 2.5, x'28b52ffd00')",
        ],
    }
    for name, statements in tables.items():
        path = tmp_path / f"{name}.db3"
        with sqlite3.connect(path) as database:
            for statement in statements:
                database.execute(statement)
        database.close()
        if name == "strange":
            log = read_log(path)
            assert len(log) == 0
            assert sum("left out" in str(problem) for problem in log.problems) == 3
        else:
            with pytest.raises(LogError, match=r"is a database, but no ROS 2 bag: its table"):
                read_log(path)


def test_bombs_inside_bags():
    """A part that grows beyond all measure is refused, by its size and by its ratio."""

    def record(fields: dict[bytes, bytes], data: bytes) -> bytes:
        header = b"".join(struct.pack("<I", len(n) + 1 + len(v)) + n + b"=" + v for n, v in fields.items())
        return struct.pack("<I", len(header)) + header + struct.pack("<I", len(data)) + data

    bomb = bz2.compress(bytes(64 << 20))
    chunk = record({b"op": b"\x05", b"compression": b"bz2", b"size": struct.pack("<I", 64 << 20)}, bomb)
    with pytest.raises(LogError, match=r"grows \d+ times when decompressed"):
        read_log(b"#ROSBAG V2.0\n" + chunk)
    with pytest.raises(LogError, match="holds more than 32 MiB"):
        read_log(b"#ROSBAG V2.0\n" + chunk, limits=Limits(size=32 << 20, ratio=1e9))


@pytest.mark.parametrize(
    "content",
    [
        b"#ROSBAG V2.0\n" + struct.pack("<I", 0xFFFFFFFF),
        b"#ROSBAG V2.0\n" + struct.pack("<II", 0, 0xFFFFFFFF),
        b"\x89MCAP0\r\n" + struct.pack("<BQ", 5, 2**64 - 1),
        b"\x89MCAP0\r\n" + struct.pack("<BQ", 6, 2**64 - 1) + bytes(100),
        b"\x89MCAP0\r\n" + struct.pack("<BQI", 3, 20, 0xFFFFFFFF) + bytes(100),
        b"SQLite format 3\0 topics messages" + bytes(200),
    ],
)
def test_hostile_sizes(content):
    """Sizes beyond the file reserve no memory and end the reading with a problem, or refuse it."""
    try:
        log = read_log(content)
    except LogError:
        return
    assert len(log) == 0
    assert any(
        "cut off" in str(problem) or "damaged" in str(problem) or "read" in str(problem) for problem in log.problems
    )


def test_other_versions():
    """A bag of an older version is refused with what to do."""
    with pytest.raises(LogError, match=r"old\.bag is a bag of version '1\.2': bring it to 2\.0"):
        read_log(b"#ROSBAG V1.2\n" + bytes(100), "old.bag")


def test_names_of_topics_are_only_text(write):
    """A topic may be called anything that ROS lets through; it stays one printable line."""
    content = write("MCAP", scans)
    log = read_log(content.replace(b"/scan", b"/\x1b<a>"))
    assert log.topic == "/\N{REPLACEMENT CHARACTER}<a>"


@pytest.mark.parametrize("frame", ["", "l", "la", "las", "lase", "laser"])
def test_either_end_may_come_first(frame):
    """A message of ROS 2 says which end of a number comes first; texts of any length keep the numbers aligned."""
    scan = laser_scan(ROS_2, 3)
    scan.header.frame_id = frame
    for little in (True, False):
        message = bytes(ROS_2.serialize_cdr(scan, SCAN, little_endian=little))
        record = laser_record("LaserScan", "cdr", message, "/scan", 1)
        assert record.ranges.tolist() == ranges(3).astype(float).tolist()
        assert (record.time, record.declared_range) == (1003.5, 30.0)


def test_messages_that_are_none():
    """A message of unknown beginnings, or that ends early anywhere, is refused in words."""
    message = bytes(ROS_2.serialize_cdr(laser_scan(ROS_2, 3, FIRST[:4]), SCAN))
    needed = len(message) - 4  # without the intensities, which nobody reads
    for end in range(needed):
        with pytest.raises(MalformedError, match="the message ends too early"):
            laser_record("LaserScan", "cdr", message[:end], "/scan", 1)
    with pytest.raises(MalformedError, match="not written in CDR"):
        laser_record("LaserScan", "cdr", b"\x07" + message[1:], "/scan", 1)
