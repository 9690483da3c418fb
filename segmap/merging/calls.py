"""What all methods of merging are made of: INTEGRATE called on two maps, or a decision in its place."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Protocol

from segmap import tracing
from segmap.errors import CancelledError
from segmap.integration import Match, Verdict, match_maps
from segmap.merging.components import fused
from segmap.merging.nodes import Flag, MergeNode, MergeStep, leaf
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.segments import SegmentMap

__all__ = ["Call", "Decided", "Given", "How", "Link", "Maker", "Pair", "valid_pose"]

Pair = tuple[ScanId, ScanId]


class Decided(Protocol):
    """A decision on a pair, or a match found before."""

    @property
    def verdict(self) -> str:
        """``accepted``, or anything else for no."""

    @property
    def T_1_2(self) -> Pose2 | None:
        """Pose of the second scan in the frame of the first."""


Given = Mapping[Pair, Pose2 | Decided]
"""for pairs of scans: ``T_a_b``, or what was decided, in place of a call of INTEGRATE"""


@dataclass(frozen=True, eq=False)
class Call:
    """One call of INTEGRATE."""

    first: tuple[ScanId, ...]
    """the scans of the first map"""
    second: tuple[ScanId, ...]
    match: Match

    @property
    def pair(self) -> Pair:
        """The scans in whose frames the maps were."""
        return self.first[0], self.second[0]


@dataclass(frozen=True, eq=False)
class Link:
    """A valid pose of one scan in the frame of another, and where it comes from."""

    pair: Pair
    T_a_b: Pose2
    match: Match | None
    flags: frozenset[Flag] = frozenset()

    def flagged(self, flag: Flag) -> Link:
        """The same with one more flag."""
        return Link(self.pair, self.T_a_b, self.match, self.flags | {flag})


@dataclass(frozen=True, eq=False)
class How:
    """How INTEGRATE is called: everything a merge depends on beside the maps and the method."""

    parameters: Parameters
    heuristic: str
    """for two scans"""
    map_heuristic: str
    """where a partial map takes part"""
    mode: str


@dataclass(eq=False)
class Maker:
    """Calls INTEGRATE for a merge, remembers every call, and fuses what was integrated."""

    maps: Mapping[ScanId, SegmentMap]
    how: How
    given: Given = field(default_factory=dict)
    check: Callable[[], None] | None = None
    calls: list[Call] = field(default_factory=list)
    _matches: dict[Pair, Match] = field(default_factory=dict)

    @property
    def parameters(self) -> Parameters:
        """Those of this merge."""
        return self.how.parameters

    def leaf(self, scan: ScanId) -> MergeNode:
        """A scan as the beginning of a map."""
        return leaf(scan, self.maps[scan])

    # --- two scans ---

    def link(self, a: ScanId, b: ScanId) -> Link | None:
        """INTEGRATE of two scans, or what was decided of them; None where nothing valid came of it."""
        if self.decided(a, b):
            T_a_b = self._given_pose(a, b)
            match = self._given_match(a, b)
            flags = frozenset() if match else frozenset({Flag.MANUAL})
            return None if T_a_b is None else Link((a, b), T_a_b, match, flags)
        if (a, b) not in self._matches:
            self._remember((a, b), self._match(self.maps[a], self.maps[b]))
        match = self._matches[a, b]
        T_a_b = valid_pose(match)
        return None if T_a_b is None else Link((a, b), T_a_b, match)

    def decided(self, a: ScanId, b: ScanId) -> bool:
        """Whether a pair is not to be integrated, as somebody decided on it."""
        return (a, b) in self.given or (b, a) in self.given

    def _given_pose(self, a: ScanId, b: ScanId) -> Pose2 | None:
        if (a, b) not in self.given:
            T_b_a = self._given_pose(b, a)
            return T_b_a and T_b_a.inverse()
        decision = self.given[a, b]
        if isinstance(decision, Pose2):
            return decision
        return decision.T_1_2 if decision.verdict == Verdict.ACCEPTED else None

    def _given_match(self, a: ScanId, b: ScanId) -> Match | None:
        decision = self.given.get((a, b))
        return decision if isinstance(decision, Match) else None

    def prepare(self, pairs: Iterable[Pair], workers: int, told: Callable[[], None]) -> None:
        """Call INTEGRATE on pairs of scans that nobody decided on, some at a time."""
        waiting = [pair for pair in pairs if not self.decided(*pair) and pair not in self._matches]
        matches = _spread(lambda pair: self._match(self.maps[pair[0]], self.maps[pair[1]]), waiting, workers)
        for pair, match in zip(waiting, matches, strict=True):
            self._remember(pair, match)
            told()

    def _remember(self, pair: Pair, match: Match) -> None:
        self._matches[pair] = match
        self.calls.append(Call((pair[0],), (pair[1],), match))

    # --- two maps ---

    def match(self, first: MergeNode, second: MergeNode) -> Match:
        """INTEGRATE of two maps."""
        match = self._match(first.map, second.map, self.how.map_heuristic)
        self.calls.append(Call(first.scans, second.scans, match))
        return match

    def _match(self, map_1: SegmentMap, map_2: SegmentMap, heuristic: str | None = None) -> Match:
        by = self.how
        return match_maps(map_1, map_2, by.parameters, heuristic or by.heuristic, by.mode, check=self.check)

    def joined(self, step: MergeStep) -> MergeNode:
        """The node of a step: both maps fused (Algorithm 5), and a scan that both hold where the first has it."""
        if self.check is not None:
            self.check()
        first, second = step.first, step.second
        new = tuple(scan for scan in second.scans if scan not in first.poses)
        poses = {**first.poses, **{scan: step.T_1_2 @ second.poses[scan] for scan in new}}
        whole = fused(first.map, second.map, step.T_1_2, self.parameters)
        node = MergeNode(first.scans + new, poses, whole, step)
        tracing.tell("joined", node=node)
        return node


def valid_pose(match: Match) -> Pose2 | None:
    """The pose of a match that is accepted without asking anybody."""
    return match.T_1_2 if match.verdict is Verdict.ACCEPTED else None


def _spread(match: Callable[[Pair], Match], pairs: Sequence[Pair], workers: int) -> Iterator[Match]:
    """The results in order, computed on some threads; what has not begun is dropped when one fails."""
    if workers <= 1:
        yield from map(match, pairs)
        return
    with ThreadPoolExecutor(workers) as pool:
        try:
            yield from pool.map(match, pairs)
        except (CancelledError, GeneratorExit):
            pool.shutdown(wait=False, cancel_futures=True)
            raise
