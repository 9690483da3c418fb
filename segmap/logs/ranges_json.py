"""JSON of ranges: one document of scans, or a scan a line (JSON lines); see :mod:`segmap.logs.measured`.

::

    {"first_angle_deg": -90, "angle_step_deg": 1, "scans": [{"time": 0.0, "ranges": [2.51, null]}]}

What stands beside ``scans`` holds for every scan that does not say otherwise. A pose may be written
``"pose": [x, y, theta]``. A large document is read scan by scan; what holds for all scans then stands before them.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from segmap.errors import LogError
from segmap.logs.json_stream import JsonStream, malformed
from segmap.logs.measured import NAMES, SENSOR, scan_of
from segmap.logs.records import Format, Problems, Record, too_many
from segmap.logs.source import LogFile
from segmap.logs.text import MalformedError
from segmap.pose import FloatArray

__all__ = ["DOCUMENT", "RANGES_JSON", "RANGES_JSON_LINES", "document", "parsed"]

DOCUMENT = 1 << 24
"""bytes of the largest document read at once"""
VALUE = 1 << 24
"""characters of the largest value in a larger one"""
RANGES = re.compile(rb'"ranges"\s*:')


def parsed(text: bytes) -> Any:
    """What a JSON text holds.

    Raises:
        MalformedError: it is no JSON.
    """
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise malformed(error) from None


def document(file: LogFile, remedy: str, most: int = DOCUMENT) -> Any:
    """All of a file as one JSON document.

    Raises:
        LogError: it is none, or too large to be read at once; ``remedy`` says what to do then.
    """
    content = file.read(most + 1)
    if len(content) > most:
        raise LogError(f"{file.name} is a JSON document of more than {most >> 20} MiB: {remedy}.")
    return _whole(file, content)


def _whole(file: LogFile, content: bytes) -> Any:
    try:
        return parsed(content.removeprefix(b"\xef\xbb\xbf"))
    except MalformedError as error:
        raise _refused(file, error) from None


def _refused(file: LogFile, error: MalformedError) -> LogError:
    cut = f"; the file is {file.damage}" if file.damage else ""
    return LogError(f"{file.name} cannot be read: {error}{cut}. Write it again.")


def _document_records(file: LogFile, problems: Problems) -> Iterator[Record]:
    content = file.read(DOCUMENT + 1)
    scans = _streamed(file, content) if len(content) > DOCUMENT else _scans(file, _whole(file, content))
    for number, (common, scan) in enumerate(scans, start=1):
        yield from _taken(scan, common, number, problems)


def _scans(file: LogFile, held: Any) -> Iterator[tuple[Mapping[str, Any], Any]]:
    """What holds for all scans, and each scan."""
    common = {name: value for name, value in held.items() if name != "scans"} if isinstance(held, dict) else {}
    scans = held.get("scans", [held] if "ranges" in held else []) if isinstance(held, dict) else held
    if not isinstance(scans, list):
        raise _no_list(file)
    return ((common, scan) for scan in scans)


def _streamed(file: LogFile, start: bytes) -> Iterator[tuple[Mapping[str, Any], Any]]:
    """The same of a document that begins with ``start``, whose scans are not all held at once."""
    try:
        stream = JsonStream(file, start, VALUE)
        if stream.next() == "[":
            yield from (({}, scan) for scan in stream.elements())
        else:
            yield from _members(file, stream)
        stream.end()
    except MalformedError as error:
        raise _refused(file, error) from None


def _members(file: LogFile, stream: JsonStream) -> Iterator[tuple[Mapping[str, Any], Any]]:
    common: dict[str, Any] = {}
    begun = False
    for name in stream.members():
        stream.member()
        if name == "scans":
            if begun:
                raise LogError(f"{file.name} has two lists of scans: write one.")
            if stream.next() != "[":
                raise _no_list(file)
            begun = True
            yield from ((common, scan) for scan in stream.elements())
        else:
            common[name] = stream.value()
            if begun and name in (*NAMES, SENSOR, "pose", "ranges"):
                raise LogError(f"{file.name} says {name} after its scans: in a large document write it before them.")
    if not begun and "ranges" in common:
        yield {}, common


def _no_list(file: LogFile) -> LogError:
    return LogError(f'{file.name} has no list of scans: write them as "scans": [...].')


def _line_records(file: LogFile, problems: Problems) -> Iterator[Record]:
    for number, line in file.lines(problems.add):
        if not line.strip():
            continue
        try:
            scan = parsed(line)
        except MalformedError as error:
            problems.add(number, f"{error}; the line was left out")
            continue
        yield from _taken(scan, {}, number, problems)


def _taken(scan: Any, common: Mapping[str, Any], number: int, problems: Problems) -> Iterator[Record]:
    try:
        if not isinstance(scan, dict):
            raise MalformedError("it is no object with ranges")
        yield _record({**common, **scan}, number)
    except MalformedError as error:
        problems.add(number, f"{error}; the scan was left out")


def _record(scan: Mapping[str, Any], number: int) -> Record:
    numbers = {name: _number(value, name) for name, value in scan.items() if name in NAMES}
    pose = scan.get("pose")
    if pose is not None:
        numbers |= zip(("x", "y", "theta"), _numbers(pose, "pose").tolist(), strict=False)
    ranges = scan.get("ranges")
    if isinstance(ranges, list) and (wrong := too_many(len(ranges))):
        raise MalformedError(wrong)
    return scan_of(numbers, _numbers(ranges, "ranges"), number, str(scan.get(SENSOR, "")))


def _number(value: Any, name: str) -> float | None:
    if value is None:
        return None
    return float(_numbers([value], name)[0])


def _numbers(values: Any, name: str) -> FloatArray:
    """A list of numbers and nulls, as numbers and NaN."""
    if not isinstance(values, list):
        raise MalformedError(f"{name} is no list of numbers")
    if not set(map(type, values)) <= {int, float, type(None)}:
        raise MalformedError(f"{name} holds something that is no number")
    try:
        return np.array([math.nan if value is None else float(value) for value in values], np.float64)
    except OverflowError:
        raise MalformedError(f"{name} holds a number that is too large") from None


def _is_json(head: bytes) -> bool:
    return head.removeprefix(b"\xef\xbb\xbf").lstrip()[:1] in (b"{", b"[") and RANGES.search(head) is not None


def _is_lines(head: bytes) -> bool:
    """Whether the first line is a scan by itself, and others may follow."""
    first = head.removeprefix(b"\xef\xbb\xbf").lstrip().split(b"\n", 1)[0]
    if not _is_json(head) or not RANGES.search(first):
        return False
    try:
        held = parsed(first)
    except MalformedError:
        return False
    return isinstance(held, dict) and "ranges" in held and "scans" not in held


RANGES_JSON_LINES = Format(
    name="JSON lines",
    expects="JSON of ranges, a scan a line",
    recognises=_is_lines,
    records=_line_records,
)
RANGES_JSON = Format(
    name="JSON",
    expects="JSON of ranges",
    recognises=_is_json,
    records=_document_records,
    unit="scan",
)
