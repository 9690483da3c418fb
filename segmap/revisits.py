"""Which closures of a whole map are worth a person's time: a few of each revisit, and what nothing else ties.

A robot that comes back past a place sees it again from many scans, so that one revisit is borne out by dozens
of closures. They all say the same; a graph that holds the surest of them, and another one every few metres of
way, has its scans where a graph that holds all of them has them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from segmap.graph import optimise
from segmap.graph.edges import Parts
from segmap.integration import Match, Verdict
from segmap.links import Link, alike
from segmap.mapping import WholeMap
from segmap.pose import FloatArray
from segmap.scans import ScanId
from segmap.spreading import Matches

__all__ = ["CLOSING", "Proposed", "Revisit", "neighbours", "proposed", "revisits"]

CLOSING = ("closed", "joined")
"""what links are that bring something beyond the chain of each log"""
ROUNDS = 6
"""times that is looked which links are missing"""
FAR_OFF = 0.2
"""metres; a closure farther from where the whole map has it says too little to be asked about, and ties only where no
other link does"""
TOGETHER = 4.0
"""metres of way; closures nearer to each other at both ends belong to one revisit"""
SPACING = 8.0
"""metres of way between the closures that are chosen of a long revisit"""
BEYOND = 1e7
"""metres; ways in different logs, or that nothing ties, have nothing to do with each other"""


@dataclass(frozen=True, eq=False)
class Revisit:
    """One time that a place is seen again: a robot comes back past it, or another one comes past."""

    closures: tuple[Link, ...]
    """all that bear it out, the surest first"""
    chosen: tuple[Link, ...]
    """of them the surest, and one every few metres of way, the surest there"""


@dataclass(frozen=True, eq=False)
class Proposed:
    """What of a whole map a person is asked about."""

    revisits: tuple[Revisit, ...]
    """the surest first"""
    ties: tuple[Link, ...]
    """links that hold scans which neighbours and the closures chosen leave apart, or let slide"""
    silenced: tuple[Link, ...]
    """closures that the others contradict, or put elsewhere than they say themselves: not asked about"""

    @property
    def chosen(self) -> tuple[Link, ...]:
        """The closures chosen of all revisits."""
        return tuple(link for revisit in self.revisits for link in revisit.chosen)

    @property
    def others(self) -> int:
        """Closures that say the same as one that was chosen, and are not asked about."""
        asked = {link.pair for link in (*self.chosen, *self.ties)}
        return sum(link.pair not in asked for revisit in self.revisits for link in revisit.closures)


def proposed(whole: WholeMap, beside: Matches) -> Proposed:
    """A few closures of each revisit, and what ties what nothing else ties.

    ``beside`` are the matches of :func:`neighbours`: those that are accepted, and put their scans where the whole
    map has them, tie.
    """
    found = revisits(whole)
    chosen = [link for revisit in found for link in revisit.chosen]
    firm = [
        Link.of(pair, match, 0, "accepted")
        for pair, match in beside.items()
        if match.verdict is Verdict.ACCEPTED and _agrees(whole, pair, match)
    ]
    ties = [*_ties(whole, [*firm, *chosen])]
    fates = zip(whole.links, whole.optimised.residuals, strict=True)
    off = (link for link, fate in fates if link.why in CLOSING and (fate.silenced or fate.translation > FAR_OFF))
    return Proposed(found, (*ties, *_pins(whole, [*firm, *chosen, *ties])), tuple(off))


def neighbours(scans: Iterable[ScanId]) -> Iterator[tuple[ScanId, ScanId]]:
    """The pairs of scans that follow each other in their log."""
    return ((a, b) for a, b in pairwise(sorted(scans)) if a.log == b.log and b.scan == a.scan + 1)


def _agrees(whole: WholeMap, pair: tuple[ScanId, ScanId], match: Match) -> bool:
    numbers = [whole.optimised.component_of(scan) for scan in pair]
    if match.T_1_2 is None or numbers[0] is None or numbers[0] != numbers[1]:
        return False
    T_w_1, T_w_2 = (whole.poses[scan] for scan in pair)
    return alike(match.T_1_2, T_w_1.inverse() @ T_w_2)


def _held(whole: WholeMap) -> list[Link]:
    """The links that are not silenced, the surest first; those far from where all together have them last."""
    fates = zip(whole.links, whole.optimised.residuals, strict=True)
    held = [(link, fate.translation > FAR_OFF) for link, fate in fates if not fate.silenced]
    return [link for link, off in sorted(held, key=lambda one: (one[1], -one[0].confidence, one[0].pair))]


# --- revisits -------------------------------------------------------------------------------------


def revisits(whole: WholeMap) -> tuple[Revisit, ...]:
    """The closures of a whole map that it bears out, by revisit, the surest revisit first."""
    ways = _ways(whole)
    fates = {link.pair: fate for link, fate in zip(whole.links, whole.optimised.residuals, strict=True)}
    held = (link for link in _held(whole) if link.why in CLOSING)
    links = [link for link in held if fates[link.pair].translation <= FAR_OFF]
    places = np.array([(ways[link.first], ways[link.second]) for link in links]).reshape(-1, 2)
    parts = Parts(len(links))
    for a, b in sorted(cKDTree(places).query_pairs(TOGETHER, p=math.inf)) if links else ():
        parts.join(a, b)
    groups: dict[int, list[int]] = {}
    for number in range(len(links)):
        groups.setdefault(parts.of(number), []).append(number)
    return tuple(
        Revisit(tuple(links[i] for i in group), tuple(links[i] for i in _spaced(group, places)))
        for group in groups.values()
    )


def _spaced(group: Sequence[int], places: FloatArray) -> list[int]:
    """Of some closures, the surest first, those far enough along the way from all that were taken."""
    taken: list[int] = []
    for i in group:
        if all(np.abs(places[i] - places[j]).max() >= SPACING for j in taken):
            taken.append(i)
    return taken


def _ways(whole: WholeMap) -> Mapping[ScanId, float]:
    """How far along its log each keyframe is, metres; a log, and what hangs apart, begins far beyond the one before."""
    ways: dict[ScanId, float] = {}
    way, last = 0.0, None
    for scan in whole.keys:
        apart = last is None or last.log != scan.log or not _together(whole, last, scan)
        way += BEYOND if apart or last is None else whole.poses[last].distance(whole.poses[scan])[0]
        ways[scan], last = way, scan
    return ways


def _together(whole: WholeMap, a: ScanId, b: ScanId) -> bool:
    number = whole.optimised.component_of(a)
    return number is not None and number == whole.optimised.component_of(b)


# --- ties -----------------------------------------------------------------------------------------


def _ties(whole: WholeMap, held: Iterable[Link]) -> Iterator[Link]:
    """The surest links that join what others leave apart, none of them needless."""
    place = {scan: i for i, scan in enumerate(whole.scans)}
    parts = Parts(len(place))
    for link in held:
        parts.join(place[link.first], place[link.second])
    for link in _held(whole):
        if parts.join(place[link.first], place[link.second]):
            yield link


def _pins(whole: WholeMap, held: Sequence[Link]) -> list[Link]:
    """The links without which scans would slide from where the whole map has them, as along a corridor."""
    pins: list[Link] = []
    for _ in range(ROUNDS):
        poses = optimise([link.edge for link in (*held, *pins)]).poses
        touched: set[ScanId] = set()
        for link in _held(whole):
            T_1_2, T_whole = (at[link.first].inverse() @ at[link.second] for at in (poses, whole.poses))
            slid = T_1_2.distance(T_whole)[0] > FAR_OFF
            if slid and link.T_1_2.distance(T_whole)[0] <= FAR_OFF and touched.isdisjoint(link.pair):
                touched.update(link.pair)
                pins.append(link)
        if not touched:
            break
    return pins
