"""The layers of a pair of scans, each a function from content to drawables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Literal

import numpy as np

from app.content import Content, Pair, merit
from app.drawables import Drawable, Frame, dashes, label, lines, points, star
from segmap.candidates import angles
from segmap.integration import Candidate
from segmap.pose import FloatArray, Pose2
from segmap.segments import SegmentMap

__all__ = [
    "angle",
    "chains",
    "first",
    "fused",
    "lines_of_sight",
    "returns",
    "rival_segments",
    "rivals",
    "second",
    "sensors",
    "unmatched",
]

RIVALS = 3
"""ghosts drawn at most"""
DISTINCT = (0.5, 0.2)
"""metres and radians; candidates nearer to each other are one answer"""
SENSOR = np.array([[0.28, 0.0], [-0.14, 0.16], [-0.14, -0.16]])
"""metres; a kite that looks where the sensor looks"""
BESIDE_SENSOR = np.array([0.5, 0.0])
"""metres, in the sensor's frame; where a rival's label has its place"""
FRAMES: tuple[Frame, Frame] = ("first", "second")


def _segments(which: int) -> Callable[[Content], Iterator[Drawable]]:
    frame = FRAMES[which]

    def drawer(content: Content) -> Iterator[Drawable]:
        """All segments of a map; behind, where the stage is about what was made of them."""
        if content.pair is None or not len(content.pair.maps[which]):
            return
        palette, segment_map = content.palette, content.pair.maps[which]
        behind = content.stage in ("chains", "fused")
        colour = palette.second if which else palette.first
        yield Drawable(
            "segments",
            frame,
            "lines",
            lines(segment_map.coordinates),
            palette.faint(colour, 0.55) if behind else colour,
            frame,
            depth=4 + which,
            thickness=1.5 if behind else 2.5,
            source=frame,
            segments=np.arange(len(segment_map)),
        )

    return drawer


first = _segments(0)
second = _segments(1)


def returns(content: Content) -> Iterator[Drawable]:
    """Where the laser met something."""
    if content.pair is None:
        return
    palette = content.palette
    alone = content.stage == "scans"
    for frame, held, colour in zip(FRAMES, content.pair.returns, (palette.first, palette.second), strict=True):
        if len(held):
            shade = colour if alone else palette.faint(colour, 0.45)
            thickness = 3.0 if alone else 2.5
            yield Drawable("returns", "returns", "points", points(held), shade, frame, depth=2, thickness=thickness)


def lines_of_sight(content: Content) -> Iterator[Drawable]:
    """The returns of both scans, each in the colour of what the other scan's lines of sight say of it."""
    seen = None if content.pair is None else content.pair.sights
    if seen is None:
        return
    palette = np.array(content.palette.sights, np.uint8)
    for frame, held, found in zip(FRAMES, seen.points, seen.classes, strict=True):
        if len(held):
            neutral, colours = content.palette.neutral, palette[found]
            yield Drawable("sights", "sights", "points", points(held), neutral, frame, 10, 4.0, colours)


def sensors(content: Content) -> Iterator[Drawable]:
    """Where the sensor stood and looked, with the name of the scan."""
    if content.pair is None:
        return
    palette = content.palette
    outline = np.concatenate((SENSOR, np.roll(SENSOR, -1, axis=0)), axis=1)
    for frame, name, colour in zip(FRAMES, content.pair.names, (palette.first, palette.second), strict=True):
        yield Drawable("sensor", "sensors", "lines", lines(outline), colour, frame, depth=11, thickness=3.0)
        over = frame == "first"
        anchor: Literal["bottom-center", "top-center"] = "bottom-center" if over else "top-center"
        at = (0.0, 0.25 if over else -0.25)
        yield label("sensor/label", "sensors", name, at, colour, frame, depth=12, anchor=anchor)


def angle(content: Content) -> Iterator[Drawable]:
    """The segments of the two superimposed angles, marked, with their lines drawn on to the vertex."""
    pair = content.pair
    if pair is None or pair.candidate is None or pair.candidate.index < 0:
        return
    sides = zip(FRAMES, pair.maps, (pair.candidate.angle_1, pair.candidate.angle_2), (4.5, 2.5), strict=True)
    for frame, segment_map, rows, thickness in sides:
        marked = segment_map.coordinates[list(rows)]
        colour = content.palette.accent
        yield Drawable("angle/segments", "angle", "lines", lines(marked), colour, frame, 9, thickness)
        vertices = angles(segment_map, np.array([rows]), pair.parameters).vertices
        if len(vertices):
            guides = _guides(marked, vertices[0])
            yield Drawable("angle/vertex", "angle", "lines", lines(guides), colour, frame, 10, thickness=1.5)


def _guides(marked: FloatArray, vertex: FloatArray) -> FloatArray:
    """Dashes from both segments to the vertex, and a mark on it."""
    return np.concatenate([*(dashes(_nearest_end(s, vertex), vertex) for s in marked), star(vertex, 0.08)])


def _nearest_end(segment: FloatArray, point: FloatArray) -> FloatArray:
    ends = segment.reshape(2, 2)
    nearest: FloatArray = ends[np.argmin(np.hypot(*(ends - point).T))]
    return nearest


def rivals(ranked: Iterable[Candidate], candidate: Candidate | None) -> list[tuple[int, Candidate]]:
    """The best candidates, with their ranks, that say something else than the one shown and than each other."""
    taken = [] if candidate is None else [candidate]
    found: list[tuple[int, Candidate]] = []
    for rank, rival in enumerate(ranked):
        if len(found) < RIVALS and all(_differ(rival.T_1_2, other.T_1_2) for other in taken):
            taken.append(rival)
            found.append((rank, rival))
    return found


def _differ(a: Pose2, b: Pose2) -> bool:
    distance, turn = a.distance(b)
    return distance > DISTINCT[0] or turn > DISTINCT[1]


def rival_segments(content: Content) -> Iterator[Drawable]:
    """Ghosts of the second map where the rivals put it."""
    pair = content.pair
    found = [] if pair is None else rivals(pair.ranked, pair.candidate)
    if pair is None or not found:
        return
    colour = content.palette.neutral
    ghosts = np.concatenate([pair.maps[1].moved(rival.T_1_2).coordinates for _, rival in found])
    faint = content.palette.faint(colour, 0.45)
    yield Drawable("rivals/segments", "rivals", "lines", lines(ghosts), faint, depth=1, thickness=1.0)
    for place, (rank, rival) in enumerate(found, 1):
        text, at = f"#{rank + 1}: {merit(rival):.2f} m".replace("-", "−"), rival.T_1_2 @ BESIDE_SENSOR
        yield label(f"rivals/label {place}", "rivals", text, at, colour, depth=2)


def chains(content: Content) -> Iterator[Drawable]:
    """Matching chains: one drawable for each colour and map; the chain of most value has the first colour."""
    pair = content.pair
    if pair is None:
        return
    palette = content.palette
    for colour in range(min(len(palette.chains), len(pair.chains))):
        same = [pair.chains[k] for k in pair.by_value[colour :: len(palette.chains)]]
        members = ([i for c in same for i in c.first], [j for c in same for j in c.second])
        for frame, segment_map, rows, thickness in zip(FRAMES, pair.maps, members, (4.5, 2.5), strict=True):
            yield Drawable(
                f"chains/{colour + 1}",
                "chains",
                "lines",
                lines(segment_map.coordinates[rows]),
                palette.chain(colour),
                frame,
                depth=7 if frame == "first" else 8,
                thickness=thickness,
                source=frame,
                segments=np.array(rows, np.int64),
            )


def fused(content: Content) -> Iterator[Drawable]:
    """Polylines in the colours of their chains, with their vertices, and the segments kept as they were."""
    pair = content.pair
    if pair is None or pair.fusion is None:
        return
    palette = content.palette
    polylines = [pair.fusion.polylines[k] for k in pair.by_value]
    for colour in range(min(len(palette.chains), len(polylines))):
        same = polylines[colour :: len(palette.chains)]
        name, edges = f"fused/{colour + 1}", np.concatenate([line.edges for line in same])
        vertices = np.concatenate([line.vertices for line in same])
        yield Drawable(name, "fused", "lines", lines(edges), palette.chain(colour), depth=7, thickness=4.0)
        yield Drawable(f"{name}/vertices", "fused", "points", points(vertices), palette.text, depth=8, thickness=5.0)
    kept = unmatched(pair).coordinates
    if len(kept):
        yield Drawable("fused/unmatched", "fused", "lines", lines(kept), palette.neutral, depth=6, thickness=2.0)


def unmatched(pair: Pair) -> SegmentMap:
    """The segments that fusion keeps as they are, in the frame of map 1."""
    T_1_2 = pair.candidate.T_1_2 if pair.candidate else Pose2.identity()
    matched_1 = [i for chain in pair.chains for i in chain.first]
    matched_2 = [j for chain in pair.chains for j in chain.second]
    return SegmentMap.joined([_without(pair.maps[0], matched_1), _without(pair.maps[1], matched_2).moved(T_1_2)])


def _without(segment_map: SegmentMap, matched: list[int]) -> SegmentMap:
    return segment_map.take(np.setdiff1d(np.arange(len(segment_map)), matched))
