"""Pictures of a report, as SVG that stands in the page: the map, the graph on it, pairs of scans."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from segmap.export.components import MapComponent
from segmap.export.record import Record
from segmap.export.report.markup import Html, joined, tag
from segmap.export.sheet import Place, Sheet, round_length
from segmap.graph import GATE, Residual
from segmap.merging import witnesses
from segmap.pose import FloatArray, Pose2
from segmap.scans import ScanId
from segmap.segments import SegmentMap

__all__ = ["CLASSES", "graph_picture", "map_picture", "pair_picture"]

FIRM, ONCE, MADE, FAINT, BAD, INK = "#0b5394", "#c2410c", "#8a94a0", "#c3cad2", "#b3261e", "#111827"
FIRST, SECOND = "#0b5394", "#c2410c"
CLASSES = ((1.0, "#12805c"), (2.0, "#5f8a3a"), (3.0, "#a98a17"), (GATE, "#e07b00"))
"""standard deviations and the colour of what is less off"""
PIXELS, PAIR_PIXELS = 960, 300
PEN, THIN = 1.6, 1.0
"""pixels"""


def map_picture(components: Sequence[MapComponent]) -> Html:
    """The merged map: walls that several scans saw, those that one saw, and what was put in between."""
    sheet = Sheet.of([part for part in components if len(part.map)], small=True)
    parts = [_group(place, _walls(place.component.map)) for place in sheet.places]
    return _svg(sheet, "The merged map", [*parts, _bar(sheet)])


def _walls(segment_map: SegmentMap) -> Iterator[Html]:
    seen = witnesses(segment_map)
    for colour, those in ((MADE, seen == 0), (ONCE, seen == 1), (FIRM, seen > 1)):
        if those.any():
            yield _path(segment_map.coordinates[those], colour)


def graph_picture(components: Sequence[MapComponent], record: Record) -> Html:
    """Where scans were taken, and the integrations between them in the colour of what they are off."""
    sheet = Sheet.of([part for part in components if len(part.map)], small=True)
    parts = [_group(place, _graph(place.component, record)) for place in sheet.places]
    return _svg(sheet, "The pose graph on the map", [*parts, _bar(sheet)])


def _graph(part: MapComponent, record: Record) -> Iterator[Html]:
    yield _path(part.map.coordinates, FAINT)
    held = part.poses
    inside = [one for one in record.optimised.residuals if one.edge.first in held and one.edge.second in held]
    for colour, dashed, those in _classes(inside):
        ends = np.array([_ends(part.poses, residual) for residual in those])
        yield _path(ends, colour, 2.4, "5 3" if dashed else None)
    yield joined(_dot(pose, INK) for pose in part.poses.values())


def _classes(residuals: Sequence[Residual]) -> Iterator[tuple[str, bool, list[Residual]]]:
    low = -1.0
    for limit, colour in (*CLASSES[:-1], (math.inf, CLASSES[-1][1])):
        those = [one for one in residuals if not one.silenced and low <= one.chi < limit]
        low = limit
        if those:
            yield colour, False, those
    silenced = [one for one in residuals if one.silenced]
    if silenced:
        yield BAD, True, silenced


def _ends(poses: Mapping[ScanId, Pose2], residual: Residual) -> tuple[float, float, float, float]:
    a, b = poses[residual.edge.first], poses[residual.edge.second]
    return a.x, a.y, b.x, b.y


def pair_picture(map_1: SegmentMap, map_2: SegmentMap, T_1_2: Pose2, title: str) -> Html:
    """Two scans as an integration lays them on each other, in the frame of the first."""
    moved = map_2.moved(T_1_2)
    points = np.concatenate(
        (map_1.coordinates.reshape(-1, 2), moved.coordinates.reshape(-1, 2), [[0.0, 0.0], [T_1_2.x, T_1_2.y]])
    )
    low, high = points.min(axis=0), points.max(axis=0)
    width, height = np.maximum(high - low, 1.0) * 1.08
    left, top = low - 0.04 * (high - low)
    inside = (
        _path(map_1.coordinates, FIRST, 1.8),
        _path(moved.coordinates, SECOND, 1.4),
        _dot(Pose2.identity(), FIRST, 8.0),
        _dot(T_1_2, SECOND, 8.0),
    )
    whole = tag("g", inside, transform=f"translate({_m(-left)} {_m(top + height)}) scale(1 -1)")
    scale = PAIR_PIXELS / max(width, height)
    return _frame(width, height, scale, title, whole)


# --- strokes --------------------------------------------------------------------------------------


def _group(place: Place, inside: Iterator[Html]) -> Html:
    x, y = place.origin
    return tag("g", inside, transform=f"translate({_m(x)} {_m(y)}) scale(1 -1)")


def _path(rows: FloatArray, colour: str, width: float = PEN, dashes: str | None = None) -> Html:
    moves = "".join(f"M{_m(x1)} {_m(y1)}L{_m(x2)} {_m(y2)}" for x1, y1, x2, y2 in rows.tolist())
    look = {"stroke": colour, "stroke_width": f"{width:g}", "stroke_dasharray": dashes}
    return tag("path", d=moves, fill="none", stroke_linecap="round", vector_effect="non-scaling-stroke", **look)


def _dot(pose: Pose2, colour: str, size: float = 4.0) -> Html:
    """A stroke without length: as wide as told whatever the scale."""
    place = f"M{_m(pose.x)} {_m(pose.y)}h0"
    return tag(
        "path",
        d=place,
        stroke=colour,
        stroke_width=f"{size:g}",
        stroke_linecap="round",
        vector_effect="non-scaling-stroke",
    )


def _bar(sheet: Sheet) -> Html:
    length, unit = round_length(sheet.width / 5.0), sheet.unit
    x, y = 3.0 * unit, sheet.height + 3.0 * unit
    line = tag("path", d=f"M{_m(x)} {_m(y)}h{_m(length)}", stroke=INK, stroke_width=f"{_m(0.6 * unit)}")
    words = tag(
        "text", f"{length:g} m", x=_m(x + length + unit), y=_m(y + 0.6 * unit), font_size=_m(2.2 * unit), fill=INK
    )
    return joined(line, words)


def _svg(sheet: Sheet, title: str, inside: Sequence[Html]) -> Html:
    height = sheet.height + 6.0 * sheet.unit
    return _frame(sheet.width, height, PIXELS / max(sheet.width, height), title, *inside)


def _frame(width: float, height: float, scale: float, title: str, *inside: Html) -> Html:
    return tag(
        "svg",
        tag("title", title),
        inside,
        viewBox=f"0 0 {_m(width)} {_m(height)}",
        width=f"{width * scale:.0f}",
        height=f"{height * scale:.0f}",
        role="img",
        aria_label=title,
    )


def _m(value: float) -> str:
    """A length to a centimetre, without needless zeros."""
    words = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if words in ("-0", "") else words
