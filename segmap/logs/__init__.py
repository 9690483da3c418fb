"""Laser logs: a file becomes a :class:`~segmap.scans.LaserLog`, its format found by content, not by name.

To add a format, write a module with a :class:`~segmap.logs.records.Format` and name it in ``FORMATS``.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice

import numpy as np

from segmap.errors import LogError, ScanError
from segmap.logs.carmen import CARMEN
from segmap.logs.dpslam import DP_SLAM
from segmap.logs.mcap import MCAP
from segmap.logs.no_return import LONGEST, SHORTEST, NoReturn, no_return
from segmap.logs.pose_graphs import PoseGraphFile, holds_pose_graph, is_pose_graph, read_pose_graph
from segmap.logs.ranges_csv import RANGES_CSV
from segmap.logs.ranges_json import RANGES_JSON, RANGES_JSON_LINES
from segmap.logs.records import Format, Problems, Record
from segmap.logs.rosbag1 import ROS_1_BAG
from segmap.logs.rosbag2 import ROS_2_BAG
from segmap.logs.segment_maps import MapPart, MapsFile, holds_maps, is_maps, read_maps
from segmap.logs.shelf import Shelf
from segmap.logs.source import ANY_SIZE, Limits, LogFile, LogSource, bag_in, base_name, name_of
from segmap.logs.text import printable, shown
from segmap.scans import LaserLog, LaserScan

__all__ = [
    "ANY_SIZE",
    "FORMATS",
    "ROS_2_BAG",
    "Limits",
    "LogSource",
    "MapPart",
    "MapsFile",
    "PoseGraphFile",
    "bag_in",
    "base_name",
    "holds_maps",
    "holds_pose_graph",
    "read_log",
    "read_logs",
    "read_maps",
    "read_pose_graph",
]

FORMATS: tuple[Format, ...] = (
    ROS_1_BAG,
    ROS_2_BAG,
    MCAP,
    RANGES_CSV,
    RANGES_JSON_LINES,
    RANGES_JSON,
    CARMEN,
    DP_SLAM,
)
"""Every format read; the first that recognises a file reads it, and those with a mark of their own come first."""

SQLITE = b"SQLite format 3\0"
READINGS = 4_000_000
"""enough of a log to find what stands for "no return"; of a larger one scans are taken evenly"""
FAR = 100.0
"""metres; a log most of whose readings are farther is not in metres"""
PACKED = {
    b"PK\x03\x04": "a zip archive",
    b"BZh": "compressed with bzip2",
    b"\xfd7zXZ": "compressed with xz",
    b"\x28\xb5\x2f\xfd": "compressed with zstd",
    b"7z\xbc\xaf": "a 7z archive",
    b"\x1f\x8b": "compressed twice",
}
TAR, TAR_AT = b"ustar", 257


def read_log(
    source: LogSource, name: str | None = None, limits: Limits | None = None, topic: str | None = None
) -> LaserLog:
    """Read a laser log from a path, bytes or a binary stream, plain or gzipped.

    Scan i is the i-th laser record that can be read, in file order, from 0. A record that cannot
    be read is left out and told of in ``problems`` (at most 100, and how many more), and never
    costs the others; what was read of a damaged or cut off file is kept. A log without scans is
    a log of length 0 with a problem that says so. ``name`` stands for the file in messages, and
    its last part names the log; it is never opened. ``topic`` chooses one of a bag's laser topics.

    Raises:
        LogError: the file cannot be opened, is of no known format, or grows beyond ``limits``; it
            is a bag of several laser topics, and none was chosen; or it has no such topic.
    """
    logs = read_logs(source, name, limits)
    held = {log.topic: log for log in logs if log.topic}
    if topic is None and len(logs) == 1:
        return logs[0]
    told = ", ".join(f"{log.topic} ({len(log)} scans)" for log in held.values()) or "none"
    file = base_name(name or name_of(source))
    if topic is None:
        raise LogError(f"{file} holds several laser topics, {told}: choose one of them, as in {file}#{logs[0].topic}.")
    if topic not in held:
        raise LogError(f"{file} has no laser topic {printable(topic)}: it has {told}.")
    return held[topic]


def read_logs(source: LogSource, name: str | None = None, limits: Limits | None = None) -> tuple[LaserLog, ...]:
    """The same for all that a file holds: a bag of several laser topics gives a log for each, in order of appearance.

    Raises:
        LogError: the file cannot be opened, is of no known format, or grows beyond ``limits``.
    """
    with LogFile(source, name, limits) as file:
        head = file.head()
        if not head.strip():
            return (_empty(file, Problems()),)
        format = _format_of(head, file)
        problems = Problems(unit=format.unit)
        shelf = Shelf()
        records = [shelf.put(record) for record in islice(format.records(file, problems), file.limits.scans + 1)]
        if len(records) > file.limits.scans:
            raise LogError(f"{file.name} holds more than {file.limits.scans} scans: split it and read each part.")
        records = format.chosen(records)
        if file.damage:
            problems.add(_last_line(records), _damage(file, format))
    if not records:
        return (_log(file.name, format, records, problems, shelf),)
    by_topic: dict[str, list[Record]] = defaultdict(list)
    for record in _spent(records):
        by_topic[record.sensor if format.topics else ""].append(record)
    return _logs(file.name, format, by_topic, problems, shelf)


def _logs(
    name: str, format: Format, by_topic: Mapping[str, list[Record]], problems: Problems, shelf: Shelf
) -> tuple[LaserLog, ...]:
    """A log for each topic; what concerns the file is told with the first one."""
    logs = []
    for topic, records in by_topic.items():
        called = name if len(by_topic) == 1 else f"{name} {topic.strip('/').replace('/', '.')}"
        logs.append(_log(called, format, records, problems, shelf, topic))
        problems = Problems(unit=format.unit)
    return tuple(logs)


def _log(
    name: str, format: Format, records: list[Record], problems: Problems, shelf: Shelf, topic: str = ""
) -> LaserLog:
    """The log of some records, which are let go one by one."""
    _check_unit(records, problems, shelf)
    silence = _silence(records)
    shelf.rest()
    no_return = _main(records, silence)
    scans = _scans(shelf.passing(_spent(records)), silence, problems)
    shelf.rest()
    if not scans:
        problems.add(1, f"{name} is a {format.name} log without laser scans: choose a log that has some")
    return LaserLog(name, scans, format.name, no_return, problems.all(), topic)


def _spent(records: list[Record]) -> Iterator[Record]:
    """The records in order; the list lets each go, so that a large log is not held twice."""
    records.reverse()
    while records:
        yield records.pop()


def _empty(file: LogFile, problems: Problems) -> LaserLog:
    if file.damage:
        raise LogError(f"{file.name} is {file.damage} from its beginning: fetch the file again.")
    problems.add(1, f"{file.name} is empty: choose a log that holds laser scans")
    return LaserLog(file.name, (), "", None, problems.all())


def _format_of(head: bytes, file: LogFile) -> Format:
    _refuse_packed(head, file.name)
    format = next((format for format in FORMATS if format.recognises(head)), None)
    if head.startswith(SQLITE) and format is not ROS_2_BAG:
        raise LogError(f"{file.name} is a database, but no ROS 2 bag: a project is opened alone, with segmap serve.")
    if format is not None:
        return format
    if is_maps(head):
        raise LogError(f"{file.name} holds segment maps, not laser scans: give it where maps are asked for.")
    if is_pose_graph(head):
        raise LogError(f"{file.name} holds a pose graph without laser scans: give the log it was made from.")
    cut = f", and the file is {file.damage}" if file.damage else ""
    start = head.split(b"\n", 1)[0].strip()
    found = "it is binary" if b"\0" in head else f"line 1 starts with {shown(start)}"
    *others, last = (format.expects for format in FORMATS)
    expected = f"{', '.join(others)} or {last}"
    raise LogError(
        f"{file.name} is no laser log that segmap reads: {found}{cut}. Expected {expected}, plain or gzipped."
    )


def _refuse_packed(head: bytes, name: str) -> None:
    """Archives are told of before what lies in them in the clear is taken for a log."""
    found = [packed for magic, packed in PACKED.items() if head.startswith(magic)]
    if head[TAR_AT:].startswith(TAR):
        found.append("a tar archive")
    if found:
        raise LogError(f"{name} is {found[0]}: unpack it and give the log inside.")


def _last_line(records: Sequence[Record]) -> int:
    return records[-1].line if records else 1


def _damage(file: LogFile, format: Format) -> str:
    return (
        f"the compressed data are {file.damage} after this {format.unit};"
        " what came before was read: fetch the file again"
    )


def _check_unit(records: Sequence[Record], problems: Problems, shelf: Shelf) -> None:
    """Ranges in millimetres would pass for walls hundreds of metres away."""
    readings = sum(len(record.ranges) for record in records)
    far = sum(int(np.count_nonzero(record.ranges > FAR)) for record in shelf.passing(records))
    if 2 * far > readings:
        problems.add(records[0].line, f"most readings of this log are above {FAR:g}: convert them to metres")


def _silence(records: Sequence[Record]) -> Mapping[tuple[str, int], NoReturn]:
    """What stands for "nothing seen", for each laser: the same name and number of beams."""
    lasers: dict[tuple[str, int], list[Record]] = defaultdict(list)
    for record in records:
        lasers[_laser(record)].append(record)
    return {laser: _silence_of(those) for laser, those in lasers.items()}


def _laser(record: Record) -> tuple[str, int]:
    return record.sensor, len(record.ranges)


def _silence_of(records: Sequence[Record]) -> NoReturn:
    declared = [record.declared_range for record in records if record.declared_range is not None]
    every = sum(len(record.ranges) for record in records) // READINGS + 1
    return no_return([record.ranges for record in records[::every]], max(declared, default=None))


def _main(records: Sequence[Record], silence: Mapping[tuple[str, int], NoReturn]) -> float | None:
    """The reading of the laser with most scans."""
    lasers = Counter(_laser(record) for record in records).most_common(1)
    return silence[lasers[0][0]].reading if lasers else None


def _scans(
    records: Iterable[Record], silence: Mapping[tuple[str, int], NoReturn], problems: Problems
) -> tuple[LaserScan, ...]:
    scans = []
    for record in records:
        try:
            scans.append(_scan(record, silence[_laser(record)].limit))
        except ScanError as error:
            problems.add(record.line, f"{error} The record was left out")
    return tuple(scans)


def _scan(record: Record, limit: float) -> LaserScan:
    """The scan of a record, whose readings it takes over."""
    ranges = record.ranges if record.ranges.flags.writeable else record.ranges.copy()
    with np.errstate(invalid="ignore"):
        ranges[~((ranges > SHORTEST) & (ranges < min(limit, LONGEST)))] = np.nan
    ranges.flags.writeable = False
    return LaserScan(ranges, record.first_angle, record.angle_step, limit, record.time, record.pose, record.line)
