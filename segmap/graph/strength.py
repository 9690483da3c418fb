"""How firmly each component holds together."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from segmap.graph.cuts import bridges, smallest_cut
from segmap.graph.edges import Edge
from segmap.graph.optimised import Optimised, Part
from segmap.scans import ScanId

__all__ = ["Strength", "strength", "strength_of"]


@dataclass(frozen=True)
class Strength:
    """What holds one component; edges that are silenced hold nothing."""

    scans: tuple[ScanId, ...]
    edges: int
    """that count"""
    bridges: tuple[Edge, ...]
    """each of them alone holds two parts together: nothing checks it, and its loss splits the component"""
    hanging: tuple[ScanId, ...]
    """scans that hang on by a single edge"""
    cut: tuple[Edge, ...]
    """the fewest edges whose loss splits the component"""
    cut_off: tuple[ScanId, ...]
    """the smaller part that would be lost with them"""
    softest: ScanId
    """the scan whose place is least sure, as seen from the first one"""
    deviation: float
    """metres; standard deviation of its place along the weakest direction"""
    heading: float
    """radians, the weakest direction in the frame of the first scan, in [0, pi)"""


def strength(result: Optimised) -> tuple[Strength, ...]:
    """The strength of every component, in their order."""
    return tuple(map(strength_of, result.parts))


def strength_of(part: Part) -> Strength:
    """The strength of one component."""
    scans, edges = part.scans, part.counting
    places = {scan: place for place, scan in enumerate(scans)}
    links = [(places[edge.first], places[edge.second]) for edge in edges]
    ends = Counter(place for link in links for place in link)
    lost = smallest_cut(links, len(scans))
    soft = part.marginals.softest()
    return Strength(
        scans=scans,
        edges=len(edges),
        bridges=tuple(edges[i] for i in bridges(links, len(scans))),
        hanging=tuple(scan for scan, place in places.items() if ends[place] == 1),
        cut=tuple(edge for edge, (a, b) in zip(edges, links, strict=True) if (a in lost) != (b in lost)),
        cut_off=tuple(scans[place] for place in sorted(lost)),
        softest=scans[soft.pose],
        deviation=soft.deviation,
        heading=soft.heading,
    )
