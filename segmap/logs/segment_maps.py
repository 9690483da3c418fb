"""Files of segment maps -> partial maps: GeoJSON of lines in metres, as segmap exports it, and plain JSON.

::

    {"segments": [[x1, y1, x2, y2], ...], "directed": [true, ...]}       as ``segmap segments --json`` prints them
    {"components": [{"name": "hall", "segments": [...]}, ...]}           several maps, each in its own frame

A segment is directed, free space on its left, where the file says so, and where it is a scan's.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from segmap.errors import LogError
from segmap.logs.ranges_json import document
from segmap.logs.records import Problems
from segmap.logs.source import Limits, LogFile, LogSource
from segmap.logs.text import MalformedError, printable
from segmap.scans import LogProblem
from segmap.segments import SegmentMap, Source, possible

__all__ = ["MapPart", "MapsFile", "holds_maps", "is_maps", "read_maps"]

LARGEST = 1 << 25
"""bytes of the largest file of maps"""
UNNAMED = "map"
_GEOJSON = re.compile(rb'"type"\s*:\s*"(FeatureCollection|Feature|LineString|MultiLineString|GeometryCollection)"')
_PLAIN = re.compile(rb'"segments"\s*:\s*\[')


@dataclass(frozen=True, eq=False)
class MapPart:
    """One map of a file; different parts have different frames."""

    name: str
    map: SegmentMap


@dataclass(frozen=True, eq=False)
class MapsFile:
    """The maps of a file, in file order, and what could not be read of it."""

    name: str
    parts: tuple[MapPart, ...]
    problems: tuple[LogProblem, ...] = ()

    def part(self, index: int) -> MapPart:
        """The map of an index that came from a person.

        Raises:
            LogError: the file has no such map.
        """
        if not 0 <= index < len(self.parts):
            held = f"maps 0 to {len(self.parts) - 1}" if self.parts else "no maps"
            raise LogError(f"{self.name} has no map {index}: it holds {held}.")
        return self.parts[index]


def is_maps(head: bytes) -> bool:
    """Whether the first bytes of a file, decompressed, are those of a file of segment maps."""
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    return text[:1] == b"{" and bool(_GEOJSON.search(text) or _PLAIN.search(text))


def holds_maps(source: LogSource) -> bool:
    """Whether a file, which is not a stream, holds segment maps, by its first bytes.

    Raises:
        LogError: it cannot be opened.
    """
    with LogFile(source) as file:
        return is_maps(file.head())


def read_maps(source: LogSource, name: str | None = None, limits: Limits | None = None) -> MapsFile:
    """Read segment maps from a path, bytes or a binary stream, plain or gzipped.

    A segment that cannot be one is left out and told of in ``problems``, and never costs the others.

    Raises:
        LogError: the file cannot be opened, holds no segment maps, or is too large.
    """
    with LogFile(source, name, limits) as file:
        if not is_maps(file.head()):
            raise LogError(f"{file.name} holds no segment map: expected GeoJSON of lines, or JSON with segments.")
        held = document(file, "export the map in parts", LARGEST)
        problems = Problems(unit="segment")
        parts = tuple(_parts(held, file.name, problems))
        return MapsFile(file.name, parts, problems.all())


class _Part:
    """Segments as they are found in a file; what cannot be one goes to the problems."""

    def __init__(self, name: str, problems: Problems) -> None:
        self._name, self._problems = name, problems
        self._rows = array("d")
        self._numbers: list[int] = []
        self._directed: list[bool] = []
        self._sources: list[tuple[Source, ...]] = []

    def add(self, row: Any, directed: bool, sources: tuple[Source, ...], number: int) -> None:
        """One more segment, the ``number``-th of the file."""
        try:
            x1, y1, x2, y2 = _four(row)
        except (TypeError, ValueError, OverflowError):
            self._problems.add(number, "it is not four numbers, x1, y1, x2, y2, in metres; it was left out")
            return
        self._rows.extend((x1, y1, x2, y2))
        self._numbers.append(number)
        self._directed.append(directed)
        self._sources.append(sources)

    def whole(self) -> MapPart:
        """All of them that can be segments, as a partial map."""
        rows = np.frombuffer(self._rows, np.float64).reshape(-1, 4) if self._rows else np.empty((0, 4))
        good = possible(rows)
        for place in np.flatnonzero(~good).tolist():
            self._problems.add(self._numbers[place], "it has no length, or lies absurdly far away; it was left out")
        sources = tuple(origin for origin, kept in zip(self._sources, good.tolist(), strict=True) if kept)
        return MapPart(
            self._name, SegmentMap(rows[good], directed=np.array(self._directed, bool)[good], sources=sources)
        )


def _four(row: Any) -> Iterator[float]:
    """Four numbers as such; anything else raises TypeError, ValueError or OverflowError."""
    if not isinstance(row, list) or not set(map(type, row)) <= {int, float}:
        raise TypeError
    return map(float, row)


def _parts(held: Any, name: str, problems: Problems) -> Iterator[MapPart]:
    if not isinstance(held, dict):
        raise LogError(f"{name} holds no segment map: it is no JSON object.")
    if isinstance(held.get("type"), str):
        yield from _of_geojson(held, problems)
        return
    components = held.get("components", [held])
    number = 0
    for component in components if isinstance(components, list) else []:
        if not isinstance(component, dict) or not isinstance(component.get("segments"), list):
            raise LogError(f'{name} has a component without a list of segments: write them as "segments": [...].')
        rows = component["segments"]
        part = _Part(_name(component.get("name", component.get("log"))), problems)
        for row, directed in zip(rows, _directions(component, len(rows)), strict=True):
            number += 1
            part.add(row, directed, (), number)
        yield part.whole()


def _name(value: Any) -> str:
    return printable(value) if isinstance(value, str) and value else UNNAMED


def _directions(component: dict[str, Any], count: int) -> Sequence[bool]:
    """Whether each segment has free space on its left; a scan's segments have."""
    told = component.get("directed", "scan" in component)
    if isinstance(told, list) and len(told) == count:
        return [value is True for value in told]
    return [told is True] * count


# --- GeoJSON --------------------------------------------------------------------------------------


def _of_geojson(held: dict[str, Any], problems: Problems) -> Iterator[MapPart]:
    """A part for each component that the features name, in order of appearance."""
    parts: dict[str, _Part] = {}
    for component in held.get("components", ()) if isinstance(held.get("components"), list) else ():
        if isinstance(component, dict):
            _part_of(parts, component.get("name"), problems)
    number = 0
    for feature in _features(held):
        told = feature.get("properties")
        properties = told if isinstance(told, dict) else {}
        part = _part_of(parts, properties.get("component"), problems)
        try:
            for line in _lines(feature.get("geometry"), 0):
                for row in _rows(line):
                    number += 1
                    part.add(row, properties.get("directed") is True, _sources(properties), number)
        except MalformedError as error:
            problems.add(number + 1, f"{error}; it was left out")
    yield from (part.whole() for part in parts.values())


def _part_of(parts: dict[str, _Part], name: Any, problems: Problems) -> _Part:
    return parts.setdefault(_name(name), _Part(_name(name), problems))


def _features(held: dict[str, Any]) -> Iterator[dict[str, Any]]:
    if held["type"] == "FeatureCollection":
        features = held.get("features")
        yield from (one for one in features if isinstance(one, dict)) if isinstance(features, list) else ()
    else:
        yield held if held["type"] == "Feature" else {"geometry": held}


def _lines(geometry: Any, depth: int) -> Iterator[list[Any]]:
    """The lines of a geometry, as lists of positions."""
    kind = geometry.get("type") if isinstance(geometry, dict) else None
    if kind == "GeometryCollection" and depth < 8 and isinstance(geometry.get("geometries"), list):
        for one in geometry["geometries"]:
            yield from _lines(one, depth + 1)
        return
    coordinates = geometry.get("coordinates") if isinstance(geometry, dict) else None
    lines = [coordinates] if kind == "LineString" else coordinates if kind == "MultiLineString" else None
    if not isinstance(lines, list) or not all(isinstance(line, list) for line in lines):
        raise MalformedError(f"a feature is no line but {printable(str(kind))}")
    yield from lines


def _rows(line: list[Any]) -> Iterator[list[Any]]:
    """The segments between the positions of a line; heights are left out."""
    if not all(isinstance(position, list) and len(position) >= 2 for position in line):
        raise MalformedError("a line has a position that is not x and y")
    for start, end in pairwise(line):
        yield [*start[:2], *end[:2]]


def _sources(properties: dict[str, Any]) -> tuple[Source, ...]:
    """The segments of scans a segment came from; none where they are not told as segmap does."""
    told = properties.get("sources")
    if not isinstance(told, list) or not all(isinstance(one, list) and len(one) == 3 for one in told):
        return ()
    if not all(type(number) is int and 0 <= number < 1 << 31 for one in told for number in one):
        return ()
    return tuple(Source(*one) for one in told)
