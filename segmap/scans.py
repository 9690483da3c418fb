"""Laser scans and logs of them, as read."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike

from segmap.errors import ScanError
from segmap.pose import FloatArray, IntArray, Pose2

__all__ = ["MAX_BEAMS", "LaserLog", "LaserScan", "LogProblem", "ScanId"]

ALL_ROUND = 2.0 * np.pi
MAX_BEAMS = 100_000
"""no laser has more"""
FARTHEST = 10_000.0
"""metres; no laser scanner sees farther, a larger reading is an error in the file"""


class ScanId(NamedTuple):
    """Which scan of which log, both counted from 0; its text is ``log.scan``.

    >>> str(ScanId(0, 12)), ScanId.parse("0.12").scan
    ('0.12', 12)
    """

    log: int
    scan: int

    def __str__(self) -> str:
        return f"{self.log}.{self.scan}"

    @classmethod
    def parse(cls, text: str) -> ScanId:
        """The scan a text such as ``0.12`` names.

        Raises:
            ScanError: it names none.
        """
        if not _SCAN_ID.fullmatch(text):
            raise ScanError(f"{text[:80]!r} names no scan: write log.scan, as in 0.12, both counted from 0.")
        log, scan = text.split(".")
        return cls(int(log), int(scan))


_SCAN_ID = re.compile(r"(0|[1-9][0-9]{0,8})\.(0|[1-9][0-9]{0,8})")


@dataclass(frozen=True, eq=False)
class LaserScan:
    """One sweep of a planar laser, in the sensor's frame: beam k looks at ``first_angle + k * angle_step``.

    ``ranges`` has shape (beams,), metres; NaN stands for a beam without a return. Everything that
    cannot be a return (0, negative, infinite or absurd, at ``max_range`` or beyond) becomes NaN here.

    Raises:
        ScanError: the ranges are not one row of numbers, or the angles are not finite.
    """

    ranges: FloatArray
    first_angle: float
    """radians, heading of beam 0 in the sensor's frame"""
    angle_step: float
    """radians between neighbouring beams; positive: counter-clockwise"""
    max_range: float = np.inf
    """metres; what the sensor reports here or beyond is no return"""
    time: float | None = None
    """seconds, in the log's own clock"""
    logged_pose: Pose2 | None = None
    """the pose written in the log, if any: truth for scoring, never an input to matching"""
    line: int | None = None
    """line of the log file, from 1"""

    def __post_init__(self) -> None:
        ranges = _checked_ranges(self.ranges)
        if not (np.isfinite(self.first_angle) and np.isfinite(self.angle_step)):
            raise ScanError("The first angle and the angle step of a scan must be finite numbers.")
        if self.angle_step == 0.0 and len(ranges) > 1:
            raise ScanError("The angle step of a scan must not be 0.")
        with np.errstate(invalid="ignore"):
            wrong = ~(
                np.isfinite(ranges) & (ranges > 0.0) & (ranges < min(self.max_range, FARTHEST)) | np.isnan(ranges)
            )
        if wrong.any():
            ranges = np.where(wrong, np.nan, ranges)
        ranges.flags.writeable = False
        object.__setattr__(self, "ranges", ranges)

    def __len__(self) -> int:
        """The number of beams."""
        return len(self.ranges)

    @cached_property
    def angles(self) -> FloatArray:
        """Headings of the beams, shape (beams,), radians."""
        return self.first_angle + self.angle_step * np.arange(len(self.ranges), dtype=np.float64)

    @property
    def all_round(self) -> bool:
        """Whether the last beam's neighbour is the first one."""
        return (len(self.ranges) + 0.5) * abs(self.angle_step) >= ALL_ROUND

    def returns(self, max_range: float | None = None) -> tuple[FloatArray, IntArray]:
        """Points of shape (returns, 2), metres, in beam order, and the beam of each.

        ``max_range`` drops what is farther away, for a limit below the sensor's own.
        """
        with np.errstate(invalid="ignore"):
            beams: IntArray = np.flatnonzero(self.ranges <= (np.inf if max_range is None else max_range))
        ranges, angles = self.ranges[beams], self.angles[beams]
        return np.stack((ranges * np.cos(angles), ranges * np.sin(angles)), axis=-1), beams


def _checked_ranges(ranges: ArrayLike) -> FloatArray:
    """A row of its own; one that nobody can write to is taken as it is."""
    fixed = isinstance(ranges, np.ndarray) and ranges.dtype == np.float64 and not ranges.flags.writeable
    try:
        array: FloatArray = np.asarray(ranges) if fixed else np.array(ranges, dtype=np.float64)
    except (TypeError, ValueError):
        raise ScanError("The ranges of a scan must be one row of numbers.") from None
    if array.ndim != 1:
        raise ScanError(f"The ranges of a scan must be one row of numbers, not of shape {array.shape}.")
    if len(array) > MAX_BEAMS:
        raise ScanError(f"A scan has {len(array)} beams; more than {MAX_BEAMS} are not read.")
    return array


@dataclass(frozen=True, slots=True)
class LogProblem:
    """Something in a file that could not be read, and was left out."""

    line: int
    """line of the file, from 1; for binary files the number of the record"""
    reason: str
    unit: str = "line"
    """what ``line`` counts"""

    def __str__(self) -> str:
        return f"{self.unit} {self.line}: {self.reason}"


@dataclass(frozen=True, eq=False)
class LaserLog(Sequence[LaserScan]):
    """The scans of one file, in file order; scan i of the log is ``log[i]``."""

    name: str
    scans: tuple[LaserScan, ...]
    format: str = ""
    """the format it was read as, for people: ``CARMEN``, ..."""
    no_return: float | None = None
    """metres; the reading that stands for "nothing seen" in this log, as found in its data"""
    problems: tuple[LogProblem, ...] = field(default=())
    """lines that were left out, and why"""
    topic: str = ""
    """of a recording of several topics, the one these scans were published on"""

    def __len__(self) -> int:
        return len(self.scans)

    def __iter__(self) -> Iterator[LaserScan]:
        return iter(self.scans)

    @overload
    def __getitem__(self, index: int) -> LaserScan: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[LaserScan, ...]: ...
    def __getitem__(self, index: int | slice) -> LaserScan | tuple[LaserScan, ...]:
        return self.scans[index]

    def scan(self, index: int) -> LaserScan:
        """The scan of an index that came from a person.

        Raises:
            ScanError: the log has no such scan.
        """
        if not 0 <= index < len(self.scans):
            held = f"scans 0 to {len(self.scans) - 1}" if self.scans else "no scans"
            raise ScanError(f"{self.name} has no scan {index}: it holds {held}.")
        return self.scans[index]
