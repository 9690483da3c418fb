"""All that one picture is made from."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np

from app.drawables import Box, Pick, around, box
from app.map_looks import MapContent
from app.palette import PALETTES, Palette
from app.sights import Sights
from segmap.chains import MatchingChain
from segmap.fusion import Fusion
from segmap.integration import Candidate
from segmap.merging import Component
from segmap.parameters import Parameters
from segmap.pose import FloatArray, Pose2
from segmap.scans import ScanId
from segmap.segments import SegmentMap

__all__ = ["Content", "Pair", "Placed", "Tie", "alongside", "merit", "place"]

GAP = 1.0
"""metres between things that have no relation to each other"""
WIDTH = 1.5
"""of the rows of components: how often the side of a square as large as all of them"""
SLOT, LABEL = 0.15, 0.03
"""what the name of a component takes at least, as shares of the width of the rows"""
PLACES = 256
"""components at places that are remembered"""


def merit(candidate: Candidate) -> float:
    """What candidates of one match are ranked by, metres: the score, or in paper mode the value."""
    return candidate.value if candidate.score is None else candidate.score


@dataclass(frozen=True, eq=False)
class Pair:
    """The selected integration, as far as it is known."""

    integration: str
    scans: tuple[ScanId, ScanId]
    names: tuple[str, str]
    """of the scans, for people"""
    maps: tuple[SegmentMap, SegmentMap]
    returns: tuple[FloatArray, FloatArray]
    """points of shape (n, 2), metres, each in its own sensor's frame"""
    parameters: Parameters
    ranked: tuple[Candidate, ...] = ()
    candidate: Candidate | None = None
    """the one shown, of those"""
    chains: tuple[MatchingChain, ...] = ()
    """at that candidate"""
    fusion: Fusion | None = None
    """at that candidate, where it was asked for"""
    sights: Sights | None = None
    """at that candidate, where it was asked for and the scans are known"""
    confidence: float | None = None
    """verified mode: that the best candidate is right, in 0..1"""
    verdict: str | None = None
    """the program's, on the best candidate; None: not matched yet"""
    reasons: tuple[str, ...] = ()
    """of that verdict, in words"""

    @property
    def rank(self) -> int | None:
        """Of the candidate shown, 0 for the best; None where none is, or where the second map is held by hand."""
        return self.ranked.index(self.candidate) if self.candidate in self.ranked else None

    @cached_property
    def by_value(self) -> tuple[int, ...]:
        """The chains' indices, the one that adds most to the value first."""
        return tuple(sorted(range(len(self.chains)), key=lambda k: -self.chains[k].value))

    @cached_property
    def beside(self) -> Pose2:
        """A place for the second scan beside the first, for when they have no relation yet."""
        (_, _, right, _), (left, _, _, _) = (
            box(m.coordinates, r, np.zeros(2)) or (0.0, 0.0, 0.0, 0.0)
            for m, r in zip(self.maps, self.returns, strict=True)
        )
        return Pose2(right - left + GAP, 0.0, 0.0)


@dataclass(frozen=True)
class Tie:
    """An integration in the map: a line between the places of its two scans."""

    integration: str
    first: ScanId
    second: ScanId
    accepted: bool
    """otherwise a closure somebody still has to decide on"""
    chi: float | None = None
    """standard deviations from where the graph has it, of what is accepted"""
    silenced: bool = False
    who: str = ""
    """who decided"""
    value: float | None = None
    """metres"""
    confidence: float | None = None


@dataclass(frozen=True, eq=False)
class Placed:
    """A component of the merged map, where it is drawn."""

    component: Component
    T_map_component: Pose2
    """where its frame is drawn; the frames of two components have no relation to each other"""

    @cached_property
    def map(self) -> SegmentMap:
        """Its segments, where they are drawn."""
        if self.T_map_component == Pose2.identity():
            return self.component.map
        return self.component.map.moved(self.T_map_component)

    @cached_property
    def box(self) -> Box | None:
        """The box around it, where it is drawn; None where it has no segments."""
        return self.map.bounds

    def pose(self, scan: ScanId) -> Pose2:
        """Where a scan of it is drawn."""
        return self.T_map_component @ self.component.poses[scan]


@lru_cache(PLACES)
def _at(component: Component, T_map_component: Pose2) -> Placed:
    """The same object for the same place, so that what a large map takes is done once."""
    return Placed(component, T_map_component)


def place(components: Iterable[Component], scans: Iterable[ScanId] = ()) -> tuple[Placed, ...]:
    """Where components are drawn: the one with the first of ``scans`` at the origin, the others in rows beside it.

    The rows together are about as wide as a window is, so that many components can still be told apart. Components
    of one scan are left out: they are scans that nothing was integrated with.
    """
    wanted = next(iter(scans), None)
    grown = sorted((c for c in components if len(c.scans) > 1), key=lambda c: wanted not in c.scans)
    boxes = [_at(component, Pose2.identity()).box or (0.0, 0.0, 0.0, 0.0) for component in grown]
    return tuple(_at(component, shift) for component, shift in zip(grown, _rows(boxes), strict=True))


def _rows(boxes: Sequence[Box]) -> list[Pose2]:
    """How far boxes move so that they stand in rows, none in another; the first one stays."""
    if not boxes:
        return []
    sides = [(right - left + GAP, top - bottom + GAP) for left, bottom, right, top in boxes]
    widest = max(max(width for width, _ in sides), WIDTH * math.sqrt(sum(width * height for width, height in sides)))
    begin, y = boxes[0][0], boxes[0][3]
    x, lowest, shifts = begin, y, list[Pose2]()
    for (left, _, _, top), (width, height) in zip(boxes, sides, strict=True):
        if x > begin and x + width > begin + widest:
            x, y = begin, lowest - LABEL * widest
        shifts.append(Pose2(x - left, y - top, 0.0))
        x += max(width, SLOT * widest)
        lowest = min(lowest, y - height)
    return shifts


def alongside(placed: Sequence[Placed], others: Iterable[Component], *, over: bool) -> tuple[Placed, ...]:
    """Where components of another map of the same scans are drawn.

    Each is laid on the component with which it shares its first scan that both hold, and, unless ``over``, moved
    beyond the whole map, along its shorter side; those that share none stand in a row to the right.
    """
    left, bottom, right, top = around(one.box for one in placed) or (0.0, 0.0, 0.0, 0.0)
    width, height = right - left + 2.0 * GAP, top - bottom + 2.0 * GAP
    across = Pose2(0.0, -height, 0.0) if width > height else Pose2(width, 0.0, 0.0)
    shift = Pose2.identity() if over else across
    found: list[Placed] = []
    right += max(0.0, shift.x)
    for component in others:
        if len(component.scans) < 2:
            continue
        home = next(((p, s) for s in component.scans for p in placed if s in p.component.poses), None)
        if home is None:
            x, y, to, _ = _at(component, Pose2.identity()).box or (0.0, 0.0, 0.0, 0.0)
            found.append(_at(component, Pose2(right - x + GAP, shift.y - y, 0.0)))
            right += to - x + GAP
        else:
            part, scan = home
            found.append(_at(component, shift @ part.pose(scan) @ component.poses[scan].inverse()))
    return tuple(found)


@dataclass(frozen=True, eq=False)
class Content:
    """A stage of an integration, or the merged map, and how to look at it."""

    stage: str
    pair: Pair | None = None
    components: tuple[Component, ...] = ()
    ties: tuple[Tie, ...] = ()
    """what is accepted, and closures to be decided on"""
    scans: int = 0
    """of the whole project"""
    dimension: int = 2
    theme: str = "light"
    shown: Mapping[str, bool] = field(default_factory=dict)
    """layers switched on or off by hand, by name; the others are as the stage has them"""
    picked: Pick | None = None
    held: Pose2 | None = None
    """where the second map is held by hand, at the moment"""
    laying: tuple[Pick, ...] = ()
    """segments clicked to lay the second map by"""
    message: str = ""
    """what to say where there is nothing to see"""
    map: MapContent = field(default_factory=MapContent)
    """how the merged map is looked at"""
    measured: tuple[tuple[float, float], ...] = ()
    """metres; the places that were clicked to measure"""

    @property
    def palette(self) -> Palette:
        """The colours of the theme."""
        return PALETTES[self.theme]

    @cached_property
    def placed(self) -> tuple[Placed, ...]:
        """The components, where they are drawn."""
        return place(self.components, self.pair.scans if self.pair else ())

    @cached_property
    def shown_parts(self) -> tuple[Placed, ...]:
        """The components that are not hidden."""
        return tuple(p for p in self.placed if p.component.scans[0] not in self.map.looks.hidden)

    def pose_of(self, placed: Placed, scan: ScanId) -> Pose2:
        """Where a scan of a component is drawn; while the map moves, where it is on its way."""
        motion = self.map.motion
        pose = motion.poses.get(scan) if motion is not None else None
        return placed.pose(scan) if pose is None else placed.T_map_component @ pose

    @cached_property
    def places(self) -> Mapping[ScanId, Pose2]:
        """Where each scan of the map that is shown is drawn."""
        return {scan: self.pose_of(placed, scan) for placed in self.shown_parts for scan in placed.component.scans}

    @cached_property
    def beside(self) -> tuple[Placed, ...]:
        """The components of the map to compare with, where they are drawn."""
        other = self.map.other
        if other is None or self.stage != "map":
            return ()
        return alongside(self.placed, other.components, over=self.map.looks.side == "over")

    def map_of(self, source: str) -> SegmentMap | None:
        """The map that a Pick's source names, in its frame; None where it is not shown."""
        if source in ("first", "second"):
            return self.pair.maps[source == "second"] if self.pair is not None and self.stage != "map" else None
        placed = self.placed if self.stage == "map" else ()
        return next((p.map for p in placed if p.component.name == source), None)

    @property
    def superimposed(self) -> bool:
        """Whether the second map stands where the candidate puts it."""
        return self.pair is not None and self.pair.candidate is not None and self.stage not in ("scans", "segments")

    @property
    def T_1_2(self) -> Pose2:
        """Where the second map stands in the frame of the first."""
        if self.pair is None:
            return Pose2.identity()
        if self.held is not None:
            return self.held
        if self.superimposed and self.pair.candidate is not None:
            return self.pair.candidate.T_1_2
        return self.pair.beside

    @cached_property
    def bounds(self) -> Box | None:
        """The box around what matters, metres; None where there is nothing."""
        if self.stage == "map":
            return around(p.box for p in (*self.shown_parts, *self.beside))
        if self.pair is None:
            return None
        first, second = (
            np.concatenate((m.coordinates.reshape(-1, 2), r))
            for m, r in zip(self.pair.maps, self.pair.returns, strict=True)
        )
        if not len(first) and not len(second):
            return None
        T_1_2 = self.T_1_2
        return box(first, np.zeros(2), T_1_2 @ second, np.array([T_1_2.x, T_1_2.y]))
