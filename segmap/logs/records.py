"""What every log format yields: laser records as written, and problems; and what a format is."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from segmap.logs.source import LogFile
from segmap.pose import FloatArray, Pose2
from segmap.scans import MAX_BEAMS, LogProblem

__all__ = ["Format", "Problems", "Record", "half_turn", "too_many"]


NARROW = {101: math.radians(1.0), 201: math.radians(0.5), 401: math.radians(0.25)}
"""a SICK that looks ahead over 100 degrees: its readings and the step between them"""


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """One laser record as written; nothing is interpreted yet."""

    sensor: str
    """which laser it comes from, as the log calls it: what stands for "no return" may differ between lasers"""
    line: int
    """line of the file, from 1"""
    ranges: FloatArray
    """shape (beams,), metres, every reading as written"""
    first_angle: float
    """radians, heading of beam 0 in the sensor's frame"""
    angle_step: float
    """radians between neighbouring beams"""
    declared_range: float | None = None
    """metres; the maximum range the record itself declares"""
    time: float | None = None
    """seconds, in the log's own clock"""
    pose: Pose2 | None = None
    """of the laser where the log says so, else of the robot"""


@dataclass(slots=True)
class Problems:
    """The problems of a file: the first ones in words, all of them in number."""

    limit: int = 100
    """how many are kept"""
    unit: str = "line"
    """what is counted: lines of text, messages of a bag"""
    count: int = 0
    kept: list[LogProblem] = field(default_factory=list)
    _first_dropped: int = 0

    def add(self, line: int, reason: str) -> None:
        """Note that something on a line, from 1, was left out."""
        self.count += 1
        if len(self.kept) < self.limit:
            self.kept.append(LogProblem(line, reason, self.unit))
        elif not self._first_dropped:
            self._first_dropped = line

    def all(self) -> tuple[LogProblem, ...]:
        """The kept ones, and a last one that counts the rest."""
        rest = self.count - len(self.kept)
        if not rest:
            return tuple(self.kept)
        told = f"from here on there are {rest} more problems like these"
        return (*self.kept, LogProblem(self._first_dropped, told, self.unit))


@dataclass(frozen=True, slots=True)
class Format:
    """A kind of log segmap reads."""

    name: str
    """for people: ``CARMEN``"""
    expects: str
    """what such a file looks like, in words, for the message that no format fits"""
    recognises: Callable[[bytes], bool]
    """whether the first bytes of a file, decompressed, are this format's"""
    records: Callable[[LogFile, Problems], Iterable[Record]]
    """the laser records of a file in file order; what cannot be read goes to the problems"""
    unit: str = "line"
    """what its records are counted in, for messages"""
    topics: bool = False
    """whether each of its sensors is a log of its own, called by its topic"""
    chosen: Callable[[list[Record]], list[Record]] = list
    """those of all records that are scans of their own"""


def too_many(beams: int) -> str | None:
    """What is wrong with a scan of so many beams, which need not be read to say so; None: nothing."""
    return f"a scan of {beams} beams is no laser's: more than {MAX_BEAMS} are not read" if beams > MAX_BEAMS else None


def half_turn(beams: int) -> tuple[float, float]:
    """First angle and step, radians, of a record that does not say: beam k looks at -90 degrees + k * step.

    180 and 181 readings are 1 degree apart, 360 and 361 half a degree: an odd number includes
    both ends of half a turn, an even one leaves out the last.

    >>> [round(math.degrees(half_turn(n)[1]), 6) for n in (180, 181, 360, 361, 541)]
    [1.0, 1.0, 0.5, 0.5, 0.333333]
    """
    if step := NARROW.get(beams):
        return math.radians(-50.0), step
    return -math.pi / 2, math.pi / max(beams - beams % 2, 1)
