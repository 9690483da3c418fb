"""What ROS 1 and ROS 2 write of a laser scan: sensor_msgs/LaserScan and MultiEchoLaserScan, as bytes.

::

    header (ROS 1: seq; time stamp; frame_id), angle_min, angle_max, angle_increment, time_increment,
    scan_time, range_min, range_max, ranges, intensities            metres and radians, all 32 bits

Both are the same since ROS 1 began, so that no message definition has to be read. Of several echoes
the first counts. ROS 1 packs numbers one after the other, little end first; ROS 2 (CDR) begins with
four bytes that say which end comes first, and aligns numbers to four bytes.
"""

from __future__ import annotations

import math

import numpy as np

from segmap.logs.records import Record, too_many
from segmap.logs.text import MalformedError
from segmap.pose import FloatArray

__all__ = ["LASER_TYPES", "ROS_1", "ROS_2", "laser_record"]

LASER_TYPES = {
    f"sensor_msgs/{place}{kind}": kind for place in ("", "msg/") for kind in ("LaserScan", "MultiEchoLaserScan")
}
"""by the names that ROS 1 and ROS 2 give them"""
ROS_1, ROS_2 = "ros1", "cdr"
"""how messages are written, in the words of MCAP"""
BIG_END, LITTLE_END = (0, 2, 6, 8), (1, 3, 7, 9)
"""second byte of a CDR message, of any of its versions"""
NUMBER = 4
"""bytes"""


def laser_record(
    kind: str, written: str, message: bytes, topic: str, number: int, received: float | None = None
) -> Record:
    """The laser record that a message holds.

    ``kind`` is a value of ``LASER_TYPES``; ``written``: ``ROS_1`` or ``ROS_2``; ``number``: which record of the
    file it is, from 1; ``received``: when it was recorded, seconds, for a message without a time stamp.

    Raises:
        MalformedError: the message does not hold what it should.
    """
    words = _Words(message, written)
    time = _header(words, written)
    first_angle, _, angle_step, _, _, nearest, farthest = words.floats(7).tolist()
    beams = words.count()
    if wrong := too_many(beams):
        raise MalformedError(wrong)
    echoes = _first_echoes(words, beams) if kind == "MultiEchoLaserScan" else words.floats(beams)
    declared = farthest if math.isfinite(farthest) and farthest > max(nearest, 0.0) else None
    return Record(
        sensor=topic,
        line=number,
        ranges=_valid(echoes, nearest, declared),
        first_angle=first_angle,
        angle_step=angle_step,
        declared_range=declared,
        time=time or received,
    )


def _valid(ranges: FloatArray, nearest: float, farthest: float | None) -> FloatArray:
    """Readings outside the limits of a message are to be discarded; 0 stays, as many drivers' word for no return."""
    with np.errstate(invalid="ignore"):
        outside = (ranges < nearest) & (ranges != 0.0)
        if farthest is not None:
            outside |= ranges > farthest
    return np.where(outside, np.nan, ranges)


def _header(words: _Words, written: str) -> float:
    """The time stamp, seconds."""
    if written == ROS_1:
        words.count()
    seconds, nanoseconds = words.count(), words.count()
    words.skip(words.count())
    return seconds + nanoseconds * 1e-9


def _first_echoes(words: _Words, beams: int) -> FloatArray:
    words.need(beams * NUMBER)
    first = np.full(beams, np.nan)
    for beam in range(beams):
        echoes = words.floats(words.count())
        if len(echoes):
            first[beam] = echoes[0]
    return first


class _Words:
    """The numbers of a message, one after the other."""

    def __init__(self, message: bytes, written: str) -> None:
        self._message, self._aligned = message, written == ROS_2
        self._place = self._start = 0
        self._order = "<"
        if self._aligned:
            self.need(NUMBER)
            self._order = _order(message)
            self._place = self._start = NUMBER

    def need(self, size: int) -> None:
        """Raises MalformedError where fewer bytes follow."""
        if size > len(self._message) - self._place:
            raise MalformedError("the message ends too early")

    def skip(self, size: int) -> None:
        """Pass over some bytes."""
        self.need(size)
        self._place += size

    def count(self) -> int:
        """A whole number."""
        return int(self._array("u4", 1)[0])

    def floats(self, count: int) -> FloatArray:
        """Some numbers."""
        with np.errstate(invalid="ignore"):  # NaN of some kinds
            return self._array("f4", count).astype(np.float64)

    def _array(self, kind: str, count: int) -> np.ndarray[tuple[int], np.dtype[np.generic]]:
        if self._aligned:
            self._place += (self._start - self._place) % NUMBER
        self.need(count * NUMBER)
        found = np.frombuffer(self._message, f"{self._order}{kind}", count, self._place)
        self._place += count * NUMBER
        return found


def _order(message: bytes) -> str:
    if message[0] == 0 and message[1] in BIG_END:
        return ">"
    if message[0] == 0 and message[1] in LITTLE_END:
        return "<"
    raise MalformedError("the message is not written in CDR")
