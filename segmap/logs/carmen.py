"""CARMEN logs, old and new, and the graph logs made of them (VERTEX2 / ROBOTLASER1 / EDGE2).

::

    FLASER n r1..rn x y theta x y theta time host time        also RLASER; laser pose, then robot pose
    LASER3 n r1..rn time host time                            older; no pose
    ROBOTLASER1 type start fov step max_range accuracy remission n r1..rn m e1..em
                laser x y theta, robot x y theta, tv rv safety safety turn time host time
    RAWLASER1   type start fov step max_range accuracy remission n r1..rn m e1..em time host time

The digit may be any; ROBOTLASER and RAWLASER were first written without the word ``remission``, the
mode of measuring it. RAWLASER records are taken only where there are no others: a log that has
both writes each sweep twice, raw and with the robot's pose.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import suppress

from segmap.logs.records import Format, Problems, Record, half_turn
from segmap.logs.source import LogFile
from segmap.logs.text import MalformedError, Parser, a_pose, count_of, first_words, number, numbers, records_of, shown

__all__ = ["CARMEN"]

KNOWN = re.compile(
    rb"\"?#.*|PARAM|SYNC|ODOM|TRUEPOS|NEFF|REMISSION\w*LASER[0-9]?|VERTEX\w*|EDGE\w*|EQUIV|FIX|PARAMS\w*|POSITION|(GLOBAL)?LOCALIZE\w*|CORR\w*|SCANMARK"
    rb"|GPS\w*|NMEA\w*|SONAR\w*|BUMPER\w*|BASE\w*|IMU\w*|XSENS\w*|INERTIAL\w*|ARM\w*|PANTILT\w*|VISION\w*|DYNAMIXEL\w*|MARKER\w*"
)
SETTINGS = ("start angle", "field of view", "angle step", "maximum range")


def _laser(words: Sequence[bytes], line: int) -> Record:
    beams = count_of(words, 1, "readings")
    ranges = numbers(words[2 : 2 + beams], "reading")
    first_angle, angle_step = half_turn(beams)
    rest = words[2 + beams :][-9:]
    if len(rest) not in (0, 3, 6, 7, 8, 9):
        raise MalformedError(f"{shown(words[0])} ends with {len(rest)} words after its readings instead of 9")
    numbers(rest[:6], "coordinate")
    return Record(
        sensor=words[0].decode(),
        line=line,
        ranges=ranges,
        first_angle=first_angle,
        angle_step=angle_step,
        time=number(rest[6], "time") if len(rest) > 6 else None,
        pose=a_pose(rest) if rest else None,
    )


def _old_laser(words: Sequence[bytes], line: int) -> Record:
    beams = count_of(words, 1, "readings")
    first_angle, angle_step = half_turn(beams)
    rest = words[2 + beams :]
    if len(rest) > 3:
        raise MalformedError(f"{shown(words[0])} ends with {len(rest)} words after its readings instead of 3")
    return Record(
        sensor=words[0].decode(),
        line=line,
        ranges=numbers(words[2 : 2 + beams], "reading"),
        first_angle=first_angle,
        angle_step=angle_step,
        time=number(rest[0], "time") if rest else None,
    )


def _configured(words: Sequence[bytes], line: int, poses: int) -> Record:
    """A record that says how its sensor is set; ``poses``: how many words of poses and motion follow."""
    try:
        return _configured_by(words, line, poses)
    except MalformedError as error:
        older = [*words[:7], b"0", *words[7:]]
        with suppress(MalformedError):
            return _configured_by(older, line, poses)
        raise error


def _configured_by(words: Sequence[bytes], line: int, poses: int) -> Record:
    beams = count_of(words, 8, "readings")
    _, start, _, step, reach = (number(word, what) for word, what in zip(words[1:6], ("type", *SETTINGS), strict=True))
    ranges = numbers(words[9 : 9 + beams], "reading")
    after = 9 + beams
    rest = words[after + 1 + count_of(words, after, "remissions") :]
    if len(rest) not in (poses + 1, poses + 2, poses + 3):
        raise MalformedError(f"{shown(words[0])} ends with {len(rest)} words after its readings instead of {poses + 3}")
    return Record(
        sensor=words[0].decode(),
        line=line,
        ranges=ranges,
        first_angle=start,
        angle_step=step,
        declared_range=reach if reach > 0.0 else None,
        time=number(rest[poses], "time"),
        pose=a_pose(rest) if poses else None,
    )


def _robot_laser(words: Sequence[bytes], line: int) -> Record:
    return _configured(words, line, poses=11)


def _raw_laser(words: Sequence[bytes], line: int) -> Record:
    return _configured(words, line, poses=0)


PARSERS: dict[bytes, Parser] = {
    b"FLASER": _laser,
    b"RLASER": _laser,
    **{b"LASER%d" % digit: _old_laser for digit in range(10)},
    **{b"ROBOTLASER%d" % digit: _robot_laser for digit in range(10)},
    **{b"RAWLASER%d" % digit: _raw_laser for digit in range(10)},
}


def _records(file: LogFile, problems: Problems) -> Iterator[Record]:
    return records_of(file, problems, PARSERS, KNOWN)


def _chosen(records: list[Record]) -> list[Record]:
    """Newer logs hold each scan twice: raw, and again with the robot's pose."""
    return [record for record in records if not record.sensor.startswith("RAWLASER")] or records


def _recognises(head: bytes) -> bool:
    return any(_is_carmen(words) for words in first_words(head))


def _is_carmen(words: Sequence[bytes]) -> bool:
    word, more = words[0], words[1] if len(words) > 1 else b""
    if word == b"#":
        return more in (b"CARMEN", b"message", b"message_name")
    numeric = re.fullmatch(rb"[-+.0-9eE]+", more) is not None
    if word in (b"PARAM", b"SYNC"):
        return bool(more)
    return numeric and (word == b"ODOM" or word in PARSERS)


CARMEN = Format(
    name="CARMEN",
    expects="CARMEN (lines that start with FLASER, RLASER, ROBOTLASER1 or RAWLASER1)",
    recognises=_recognises,
    records=_records,
    chosen=_chosen,
)
