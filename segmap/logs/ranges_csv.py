"""CSV of ranges: a header that names the columns, then a row for each scan; see :mod:`segmap.logs.measured`.

::

    time,first_angle_deg,angle_step_deg,ranges
    0.0,-90,1,2.51,2.52,,2.55

``ranges`` is the last column, and everything from there on is readings; or each reading has a
column of its own, r0, r1, and so on. Between values stand commas, semicolons (a comma is then a
decimal one) or tabs. Lines that begin with # are comments.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from segmap.logs.measured import NAMES, SENSOR, angles_named, scan_of
from segmap.logs.records import Format, Problems, Record, too_many
from segmap.logs.source import LogFile
from segmap.logs.text import MalformedError, number, shown

__all__ = ["RANGES_CSV"]

SEPARATORS = (b",", b";", b"\t")
READING = re.compile(r"ranges?|r(ange)?[_ ]?[0-9]{1,6}")
EMPTY = (b"", b"nan", b"NaN", b"NA", b"null", b"None")


@dataclass(frozen=True, slots=True)
class _Columns:
    """What a header says."""

    separator: bytes
    numbers: Mapping[str, int]
    sensor: int | None
    ranges: slice
    unknown: tuple[str, ...]

    @classmethod
    def of(cls, line: bytes) -> _Columns | None:
        """What the columns hold; None: this is no header of a file of ranges."""
        separator = max(SEPARATORS, key=line.count)
        names = [cell.decode("utf-8", "replace").lower() for cell in _cells(line, separator)]
        readings = [i for i, name in enumerate(names) if READING.fullmatch(name)]
        if not readings or not angles_named(set(names)):
            return None
        end = None if names[readings[-1]] in ("ranges", "range") else readings[-1] + 1
        known = {name: i for i, name in enumerate(names) if name in NAMES}
        return cls(
            separator,
            known,
            names.index(SENSOR) if SENSOR in names else None,
            slice(readings[0], end),
            tuple(name for i, name in enumerate(names) if name not in {*known, SENSOR} and i not in readings),
        )

    def record(self, line: bytes, place: int) -> Record:
        """The scan of a row."""
        cells = _cells(line, self.separator)
        needed = max([*self.numbers.values(), self.ranges.start]) + 1
        if len(cells) < needed:
            raise MalformedError(f"the row has {len(cells)} values, fewer than its header names")
        if wrong := too_many(len(cells) - self.ranges.start):
            raise MalformedError(wrong)
        numbers = {name: _value(cells[i], name) for name, i in self.numbers.items()}
        sensor = cells[self.sensor].decode("utf-8", "replace") if self.sensor is not None else ""
        ranges = _readings(cells[self.ranges])
        return scan_of(numbers, np.array(ranges, np.float64), place, sensor)


def _cells(line: bytes, separator: bytes) -> list[bytes]:
    if separator == b";":
        line = line.replace(b",", b".")
    return [cell.strip(b' "\r\n') for cell in line.split(separator)]


def _readings(cells: Sequence[bytes]) -> list[float]:
    return [math.nan if cell in EMPTY else _reading(cell, i) for i, cell in enumerate(cells)]


def _reading(cell: bytes, place: int) -> float:
    try:
        if b"_" not in cell:
            return float(cell)
    except ValueError:
        pass
    raise MalformedError(f"reading {place} is {shown(cell)}, not a number")


def _value(cell: bytes, name: str) -> float | None:
    if cell in EMPTY:
        return None
    return math.inf if cell.lower() in (b"inf", b"infinity") and "range" in name else number(cell, name)


def _records(file: LogFile, problems: Problems) -> Iterator[Record]:
    columns: _Columns | None = None
    for place, line in file.lines(problems.add):
        if _is_comment(line):
            continue
        if columns is None:
            columns = _Columns.of(line)
            assert columns is not None  # what is recognised has a header
            for name in columns.unknown:
                problems.add(place, f"the column {shown(name.encode())} means nothing here and was passed over")
            continue
        try:
            yield columns.record(line, place)
        except MalformedError as error:
            problems.add(place, f"{error}; the row was left out")


def _is_comment(line: bytes) -> bool:
    return not line.strip() or line.lstrip().startswith(b"#")


def _recognises(head: bytes) -> bool:
    lines = head.removeprefix(b"\xef\xbb\xbf").split(b"\n")
    first = next((line for line in lines if not _is_comment(line)), b"")
    return len(first) < 1 << 18 and _Columns.of(first) is not None


RANGES_CSV = Format(
    name="CSV",
    expects="CSV of ranges (a header with first_angle, angle_step and ranges)",
    recognises=_recognises,
    records=_records,
)
