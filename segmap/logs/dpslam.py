"""The logs of DP-SLAM: one line of odometry, one line of laser.

::

    Odometry x y theta          the robot's pose when the laser of the next line fired
    Laser n r1..rn              metres; beam k looks at -90 degrees + k * step, over half a turn
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from segmap.logs.records import Format, Problems, Record, half_turn
from segmap.logs.source import LogFile
from segmap.logs.text import MalformedError, a_pose, count_of, first_words, numbers, records_of, shown
from segmap.pose import Pose2

__all__ = ["DP_SLAM"]

KNOWN = re.compile(rb"[#;%/].*")


class _Reader:
    """Parsers of the two lines; a scan takes the pose of the odometry line before it."""

    def __init__(self) -> None:
        self._pose: Pose2 | None = None

    def odometry(self, words: Sequence[bytes], _: int) -> None:
        self._pose = None
        if len(words) < 4:
            raise MalformedError(f"{shown(words[0])} needs x, y and theta")
        self._pose = a_pose(words[1:])

    def laser(self, words: Sequence[bytes], line: int) -> Record:
        pose, self._pose = self._pose, None
        beams = count_of(words, 1, "readings")
        if len(words) != 2 + beams:
            raise MalformedError(f"{shown(words[0])} announces {beams} readings and holds {len(words) - 2}")
        first_angle, angle_step = half_turn(beams)
        return Record("Laser", line, numbers(words[2:], "reading"), first_angle, angle_step, pose=pose)


def _records(file: LogFile, problems: Problems) -> Iterator[Record]:
    reader = _Reader()
    return records_of(file, problems, {b"Odometry": reader.odometry, b"Laser": reader.laser}, KNOWN)


def _recognises(head: bytes) -> bool:
    return any(
        len(words) > 1 and words[0] in (b"Odometry", b"Laser") and re.fullmatch(rb"[-+.0-9eE]+", words[1])
        for words in first_words(head)
    )


DP_SLAM = Format(
    name="DP-SLAM",
    expects="DP-SLAM (lines that start with Odometry or Laser)",
    recognises=_recognises,
    records=_records,
)
