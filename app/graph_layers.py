"""The layers of the pose graph, on the merged map: each integration a line that can be clicked."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from app.content import Content, Tie
from app.drawables import Drawable, dashes, lines
from app.palette import RGB
from segmap.graph import GATE
from segmap.pose import FloatArray

__all__ = ["TIES", "candidates", "candidates_caption", "colours", "edges", "edges_caption"]

TIES = "ties"
"""the source of a Pick that names an integration, by its place in ``content.ties``"""
LIMITS = (1.0, 2.0, 3.0, GATE)
"""standard deviations; a colour for each class of edges below"""


def colours(content: Content) -> tuple[RGB, ...]:
    """Of the classes of edges, and of those that are silenced."""
    palette = content.palette
    good, doubtful = palette.good, palette.sights[2]
    mixed = [_mixed(good, doubtful, share) for share in np.linspace(0.0, 1.0, len(LIMITS))]
    return (*mixed, palette.bad)


def _mixed(one: RGB, other: RGB, share: float) -> RGB:
    r, g, b = (round((1.0 - share) * a + share * c) for a, c in zip(one, other, strict=True))
    return r, g, b


def edges(content: Content) -> Iterator[Drawable]:
    """What is accepted, coloured by how far off the graph has it; dashed where the optimiser silences it."""
    shown = [(i, tie) for i, tie in _placed(content) if tie.accepted]
    palette = colours(content)
    for place in range(len(LIMITS)):
        those = [(i, tie) for i, tie in shown if not tie.silenced and _class(tie) == place]
        if those:
            yield _solid(f"edges/{place}", "edges", content, those, palette[place], 10, 2.5)
    silenced = [(i, tie) for i, tie in shown if tie.silenced]
    if silenced:
        yield _dashed("edges/silenced", "edges", content, silenced, palette[-1], 12, 3.0)
    yield from _selected(content)


def candidates(content: Content) -> Iterator[Drawable]:
    """Closures somebody still has to decide on."""
    those = [(i, tie) for i, tie in _placed(content) if not tie.accepted]
    if those:
        yield _dashed("closures", "closures", content, those, content.palette.faint(content.palette.first, 0.6), 9, 1.2)


def _selected(content: Content) -> Iterator[Drawable]:
    if content.pair is not None:
        those = [(i, tie) for i, tie in _placed(content) if tie.integration == content.pair.integration]
        if those:
            yield _solid("edges/selected", "edges", content, those, content.palette.accent, 13, 5.0)


def _placed(content: Content) -> list[tuple[int, Tie]]:
    places = content.places
    return [(i, tie) for i, tie in enumerate(content.ties) if tie.first in places and tie.second in places]


def _class(tie: Tie) -> int:
    off = tie.chi or 0.0
    return next((place for place, limit in enumerate(LIMITS) if off < limit), len(LIMITS) - 1)


def _ends(content: Content, ties: Sequence[tuple[int, Tie]]) -> FloatArray:
    """(n, 4): from sensor to sensor."""
    poses = [(content.places[tie.first], content.places[tie.second]) for _, tie in ties]
    return np.array([(a.x, a.y, b.x, b.y) for a, b in poses])


def _solid(
    name: str, layer: str, content: Content, ties: Sequence[tuple[int, Tie]], colour: RGB, depth: int, thickness: float
) -> Drawable:
    numbers = np.array([i for i, _ in ties])
    ends = lines(_ends(content, ties))
    return Drawable(name, layer, "lines", ends, colour, "map", depth, thickness, source=TIES, segments=numbers)


def _dashed(
    name: str, layer: str, content: Content, ties: Sequence[tuple[int, Tie]], colour: RGB, depth: int, thickness: float
) -> Drawable:
    parts = [dashes(row[:2], row[2:]) for row in _ends(content, ties)]
    numbers = np.repeat([i for i, _ in ties], [len(part) for part in parts])
    drawn = lines(np.concatenate(parts))
    return Drawable(name, layer, "lines", drawn, colour, "map", depth, thickness, source=TIES, segments=numbers)


def edges_caption(content: Content) -> str:
    """How many there are, and what the colours say."""
    accepted = [tie for tie in content.ties if tie.accepted]
    silenced = sum(tie.silenced for tie in accepted)
    limits = ", ".join(f"{limit:g}" for limit in LIMITS)
    told = f"{len(accepted)} accepted integrations; off the graph by up to {limits} standard deviations"
    return told + (f"; dashed: {silenced} silenced by the optimiser" if silenced else "")


def candidates_caption(content: Content) -> str:
    """How many there are."""
    count = sum(not tie.accepted for tie in content.ties)
    return f"{count} to be decided; click one to look at it" if count else "none waits for a decision"
