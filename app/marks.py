"""What people did to a picture, drawn on it: the segment they clicked, where it comes from, and what they measured."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from app.content import Content, Placed, merit
from app.drawables import CHAIN, Drawable, Frame, Pick, label, lines, points
from app.grid import spacing
from segmap.pose import FloatArray
from segmap.scans import ScanId
from segmap.segments import SegmentMap

__all__ = ["Measurement", "laying", "measured", "measurement", "picked", "seen_by"]

FRAME_OF: dict[str, Frame] = {"first": "first", "second": "second"}
"""of the maps of a pair, by the source of a Pick"""
MOST = 12
"""scans whose lines of sight to a clicked wall are drawn"""


@dataclass(frozen=True)
class Measurement:
    """What lies between two places, metres and radians."""

    length: float
    dx: float
    dy: float
    heading: float

    def in_words(self) -> str:
        """For the label in the scene."""
        x, y, turn = (round(number, 2) + 0.0 for number in (self.dx, self.dy, math.degrees(self.heading)))
        return f"{self.length:.2f} m  (x {x:.2f}, y {y:.2f}, {turn:.1f}°)".replace("-", "−")


def measurement(places: tuple[tuple[float, float], ...]) -> Measurement | None:
    """What lies between the two places that were clicked; None as long as there are fewer."""
    if len(places) < 2:
        return None
    (x1, y1), (x2, y2) = places
    dx, dy = x2 - x1, y2 - y1
    return Measurement(math.hypot(dx, dy), dx, dy, math.atan2(dy, dx))


def measured(content: Content) -> Iterator[Drawable]:
    """The places that were clicked, the line between them and its length."""
    if not content.measured:
        return
    colour, ends = content.palette.accent, np.array(content.measured)
    yield Drawable("measure/ends", "measure", "points", points(ends), colour, "map", 17, 9.0)
    found = measurement(content.measured)
    if found is not None:
        yield Drawable("measure/line", "measure", "lines", lines(ends.reshape(1, 4)), colour, "map", 16, 2.5)
        x, y = ends.mean(axis=0)
        above = float(x), float(y) + 0.15 * spacing(content)
        yield label("measure/label", "measure", found.in_words(), above, colour, "map", 18, "bottom-center")


def picked(content: Content) -> Iterator[Drawable]:
    """The segment that was clicked, or the chain, marked; of a merged wall, also who saw it from where."""
    pick = content.picked
    if pick is not None and pick.source == CHAIN:
        yield from _chain(content, pick.segment)
        return
    segment_map = None if pick is None else content.map_of(pick.source)
    if pick is None or segment_map is None or not 0 <= pick.segment < len(segment_map):
        return
    frame = FRAME_OF.get(pick.source, "map")
    marked = lines(segment_map.coordinates[[pick.segment]])
    yield Drawable("picked", "picked", "lines", marked, content.palette.accent, frame, depth=15, thickness=8.0)
    if frame == "map":
        yield from _sights(content, pick, segment_map)


def _chain(content: Content, place: int) -> Iterator[Drawable]:
    """The segments of a matching chain, in both maps."""
    pair = content.pair
    if pair is None or not 0 <= place < len(pair.chains):
        return
    chain, colour = pair.chains[pair.by_value[place]], content.palette.accent
    for frame, segment_map, rows in zip(FRAME_OF.values(), pair.maps, (chain.first, chain.second), strict=True):
        marked = lines(segment_map.coordinates[list(rows)])
        yield Drawable("picked", "picked", "lines", marked, colour, frame, depth=15, thickness=8.0)


def laying(content: Content) -> Iterator[Drawable]:
    """The segments clicked to lay the second map by, numbered by pair; and what the place it is held at is worth."""
    for place, pick in enumerate(content.laying):
        segment_map, frame = content.map_of(pick.source), FRAME_OF[pick.source]
        if segment_map is not None and 0 <= pick.segment < len(segment_map):
            name, one = f"laying/{place}", segment_map.coordinates[pick.segment]
            yield Drawable(name, "laying", "lines", lines(one[None]), content.palette.accent, frame, 15, 7.0)
            at = (one[:2] + one[2:]) / 2.0
            yield label(f"{name}/label", "laying", str(place // 2 + 1), at, content.palette.accent, frame, 16)
    pair = content.pair
    if content.held is not None and pair is not None and pair.candidate is not None:
        text = "value" if pair.candidate.score is None else "score"
        worth = f"{text} {merit(pair.candidate):.2f} m".replace("-", "−")
        yield label("held", "laying", worth, (0.6, 0.0), content.palette.text, "second", 16)


def _sights(content: Content, pick: Pick, segment_map: SegmentMap) -> Iterator[Drawable]:
    placed = next((p for p in content.placed if p.component.name == pick.source), None)
    scans = seen_by(segment_map, pick.segment)[:MOST]
    if placed is not None and scans:
        colour = content.palette.faint(content.palette.accent, 0.55)
        rows = lines(_from_sensors(placed, scans, segment_map.coordinates[pick.segment]))
        yield Drawable("picked/sights", "picked", "lines", rows, colour, "map", 14, 1.2)


def _from_sensors(placed: Placed, scans: list[ScanId], wall: FloatArray) -> FloatArray:
    """From each sensor to the middle of a wall, (n, 4)."""
    x, y = (wall[:2] + wall[2:]) / 2.0
    return np.array([(pose.x, pose.y, x, y) for pose in map(placed.pose, scans)])


def seen_by(segment_map: SegmentMap, segment: int) -> list[ScanId]:
    """The scans a segment of a map comes from, in order."""
    return sorted({ScanId(source.log, source.scan) for source in segment_map.sources[segment]})
