"""Files that are rows of numbers: relations between moments, and trajectories.

::

    t1 t2 x y z roll pitch yaw      a relation (Kuemmerle et al. 2009): where the robot was at t2, seen from t1
    t x y z qx qy qz qw             a pose of a TUM trajectory

Seconds, metres, radians; lines that start with # are remarks. Everything is taken in the plane.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from segmap.errors import LogError
from segmap.logs import read_log
from segmap.logs.records import Problems
from segmap.logs.source import Limits, LogFile, LogSource
from segmap.logs.text import MalformedError, number
from segmap.pose import FloatArray, Pose2
from segmap.scans import LogProblem

__all__ = ["Relation", "RelationsFile", "Trajectory", "read_relations", "read_trajectory"]

COLUMNS = 8
FLAT = 1e-3
"""radians; a pose that leans more is not one of a robot in the plane"""
UNIT = 1e-2
"""how far from 1 the norm of a quaternion may be"""
MOST_ROWS = 2_000_000

Row = TypeVar("Row")


@dataclass(frozen=True, slots=True)
class Relation:
    """Where the robot was at one moment, seen from where it was at another."""

    time_1: float
    """seconds"""
    time_2: float
    """seconds"""
    T_1_2: Pose2
    line: int
    """line of the file, from 1"""


@dataclass(frozen=True, eq=False)
class RelationsFile:
    """Relations as read."""

    name: str
    relations: tuple[Relation, ...]
    problems: tuple[LogProblem, ...] = field(default=())
    """lines that were left out, and why"""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Poses over time, in one frame."""

    name: str
    times: FloatArray
    """(n,), seconds, ascending"""
    poses: tuple[Pose2, ...]
    problems: tuple[LogProblem, ...] = field(default=())
    """lines that were left out, and why"""


def read_relations(source: LogSource, name: str | None = None, limits: Limits | None = None) -> RelationsFile:
    """Read relations from a path, bytes or a binary stream, plain or gzipped.

    Raises:
        LogError: the file cannot be opened, none of its lines is a relation, or it grows beyond ``limits``.
    """
    with LogFile(source, name, limits) as file:
        problems = Problems()
        relations = tuple(_rows(file, problems, _relation))
        if not relations:
            raise LogError(_nothing(file.name, "relation", "t1 t2 x y z roll pitch yaw", problems))
        return RelationsFile(file.name, relations, problems.all())


def read_trajectory(source: LogSource, name: str | None = None, limits: Limits | None = None) -> Trajectory:
    """Read a TUM trajectory, or the poses and times of the scans of a laser log, plain or gzipped.

    Of several poses at one time the first counts.

    Raises:
        LogError: the file cannot be opened, holds no poses with times, or grows beyond ``limits``.
    """
    with LogFile(source, name, limits) as file:
        if not _is_table(file.head()):
            return _of_log(source, file, limits)
        problems = Problems()
        stamped = list(_rows(file, problems, _stamped_pose))
        if not stamped:
            raise LogError(_nothing(file.name, "pose", "t x y z qx qy qz qw", problems))
        return _trajectory(file.name, stamped, problems)


def _is_table(head: bytes) -> bool:
    """Whether the first line that is no remark starts with a number, or there is none."""
    for line in head.removeprefix(b"\xef\xbb\xbf").splitlines():
        if (words := line[:400].split(maxsplit=1)) and not words[0].startswith(b"#"):
            try:
                float(words[0])
            except ValueError:
                return False
            return True
    return True


def _rows(file: LogFile, problems: Problems, read: Callable[[list[float], int], Row]) -> Iterator[Row]:
    last = 1
    for count, (line, text) in enumerate(file.lines(problems.add)):
        last = line
        if count >= MOST_ROWS:
            raise LogError(f"{file.name} has more than {MOST_ROWS} lines: split it.")
        words = text.split()
        if words and not words[0].startswith(b"#"):
            try:
                yield read(_numbers(words), line)
            except MalformedError as error:
                problems.add(line, f"{error}; the line was left out")
    if file.damage:
        problems.add(last, f"the compressed data are {file.damage} after this line: fetch the file again")


def _numbers(words: list[bytes]) -> list[float]:
    if len(words) != COLUMNS:
        raise MalformedError(f"there are {len(words)} numbers instead of {COLUMNS}")
    return [number(word, f"number {place}") for place, word in enumerate(words, start=1)]


def _relation(row: list[float], line: int) -> Relation:
    time_1, time_2, x, y, _, roll, pitch, yaw = row
    if max(abs(roll), abs(pitch)) > FLAT:
        raise MalformedError("the relation leans: roll and pitch must be 0 in the plane")
    return Relation(time_1, time_2, Pose2(x, y, yaw), line)


def _stamped_pose(row: list[float], _line: int) -> tuple[float, Pose2]:
    time, x, y, _, qx, qy, qz, qw = row
    if abs(math.hypot(qx, qy, qz, qw) - 1.0) > UNIT:
        raise MalformedError("qx qy qz qw is no rotation: its norm is not 1")
    if 2.0 * math.hypot(qx, qy) > FLAT:
        raise MalformedError("the pose leans: qx and qy must be 0 in the plane")
    return time, Pose2(x, y, 2.0 * math.atan2(qz, qw))


def _trajectory(name: str, stamped: list[tuple[float, Pose2]], problems: Problems) -> Trajectory:
    ordered = sorted(stamped, key=lambda one: one[0])
    once = [one for i, one in enumerate(ordered) if i == 0 or one[0] != ordered[i - 1][0]]
    return Trajectory(name, np.array([time for time, _ in once]), tuple(pose for _, pose in once), problems.all())


def _of_log(source: LogSource, file: LogFile, limits: Limits | None) -> Trajectory:
    """The poses that a log's scans were written with."""
    if not isinstance(source, str | bytes | bytearray | memoryview) and hasattr(source, "read"):
        raise LogError(f"{file.name} is no TUM trajectory: expected lines t x y z qx qy qz qw.")
    try:
        log = read_log(source, file.name, limits)
    except LogError as error:
        raise LogError(f"{file.name} is no TUM trajectory (lines t x y z qx qy qz qw), and as a log: {error}") from None
    stamped = [(scan.time, scan.logged_pose) for scan in log if scan.time is not None and scan.logged_pose is not None]
    if not stamped:
        raise LogError(f"{file.name} holds no poses with times: choose a TUM trajectory, or a log with both.")
    problems = Problems()
    for problem in log.problems:
        problems.add(problem.line, problem.reason)
    return _trajectory(file.name, stamped, problems)


def _nothing(name: str, what: str, expected: str, problems: Problems) -> str:
    first = problems.all()[:1]
    why = f": {first[0]}" if first else ": it is empty"
    return f"{name} holds no {what}{why}. Expected lines {expected}."
