"""Segments as CSV, one row each: RFC 4180, one header row, metres and degrees, no comments.

Where the map comes from stands in columns of its own, as CSV has no other place for it.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator

from segmap.export.components import Content, ExportFormat, MapComponent, origin_of, scans_of

__all__ = ["COLUMNS", "CSV", "write_csv"]

COLUMNS = (
    "component",
    "segment",
    "x1_m",
    "y1_m",
    "x2_m",
    "y2_m",
    "length_m",
    "heading_deg",
    "directed",
    "sources",
    "integrations",
    "version",
    "map_hash",
)
DIGITS = 6
"""micrometres"""


def write_csv(content: Content) -> bytes:
    """A row for each segment, in the order of components and segments; the same input gives the same bytes.

    Coordinates are those of the component's own frame: do not compare those of different components.
    ``sources`` are the segments of scans it came from as ``log.scan.segment``.
    """
    text = io.StringIO()
    rows = csv.writer(text)
    rows.writerow(COLUMNS)
    for component in content.components:
        rows.writerows(_rows(component, content))
    return text.getvalue().encode("utf-8", "replace")


def _rows(component: MapComponent, content: Content) -> Iterator[list[object]]:
    map = component.map
    origin = [_text(content.metadata.get(name, "")) for name in ("version", "map_hash")]
    columns = zip(map.coordinates.tolist(), map.lengths, map.headings, map.directed, map.sources, strict=True)
    for number, (row, length, heading, directed, sources) in enumerate(columns):
        numbers = [f"{value + 0.0:.{DIGITS}f}" for value in (*row, length)]
        yield [
            _text(component.name),
            number,
            *numbers,
            f"{math.degrees(heading) + 0.0:.{DIGITS}f}",
            int(directed),
            origin_of(sources),
            " ".join(content.integrations_of(scans_of(sources))),
            *origin,
        ]


def _text(text: str) -> str:
    """A name as a cell: no spreadsheet takes it for a formula."""
    return f"'{text}" if text[:1] in ("=", "+", "-", "@", "\t", "\r") else text


CSV = ExportFormat(
    name="csv",
    suffix=".csv",
    media_type="text/csv",
    title="CSV",
    use="the segments as a table, with their sources",
    write=write_csv,
)
