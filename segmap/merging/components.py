"""Many maps -> one map, or as many as the evidence holds together (Section IV).

The pivot method (Algorithm 6) integrates neighbours in a sequence, composes their transformations and
fuses each map once. Where a pair cannot be integrated a new component begins: nothing is ever placed
without evidence.
"""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from segmap.chains import matching_chains
from segmap.errors import CancelledError, ParameterError
from segmap.fusion import fuse
from segmap.integration import Match, Verdict, match_maps
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.segments import SegmentMap

__all__ = ["METHODS", "Accepted", "Component", "Merge", "map_hash", "merge", "merge_accepted"]

METHODS = ("pivot",)
"""how a sequence of maps is merged"""
HASH_RESOLUTION = 1e-6
"""metres; maps that agree to this have the same hash"""

Accepted = tuple[ScanId, ScanId, Pose2]
"""scan a, scan b and ``T_a_b``: an accepted integration"""


@dataclass(frozen=True, eq=False)
class Component:
    """Scans that accepted integrations hold together, and their fused map."""

    name: str
    scans: tuple[ScanId, ...]
    """in the order they were fused"""
    poses: Mapping[ScanId, Pose2]
    """pose of each scan in the frame of the first one"""
    map: SegmentMap
    """in the frame of the first scan"""


@dataclass(frozen=True, eq=False)
class Merge:
    """What a merging method made of a sequence of maps."""

    components: tuple[Component, ...]
    matches: Mapping[tuple[ScanId, ScanId], Match]
    """every pair INTEGRATE was called on; n - 1 of them for a sequence of n maps"""


# --- a sequence of maps ---------------------------------------------------------------------------


def merge(
    maps: Mapping[ScanId, SegmentMap],
    parameters: Parameters | None = None,
    heuristic: str = "all",
    mode: str = "paper",
    method: str = "pivot",
    *,
    workers: int = 1,
    progress: Callable[[int, int], None] | None = None,
    check: Callable[[], None] | None = None,
) -> Merge:
    """Merge the maps of each log, in the order given, by the pivot method (Algorithm 6).

    A pair counts when its verdict is accepted. ``progress`` is told how many of how many pairs are done;
    ``workers`` pairs are matched at a time.

    Raises:
        ParameterError: there is no such method, heuristic or mode.
        CancelledError: raised by ``check``.
    """
    if method not in METHODS:
        raise ParameterError(f"There is no merging method {method!r}. Methods are: {', '.join(METHODS)}.")
    parameters = parameters or Parameters()
    pairs = list(neighbours(maps))

    def match(pair: tuple[ScanId, ScanId]) -> Match:
        return match_maps(maps[pair[0]], maps[pair[1]], parameters, heuristic, mode, check=check)

    matches: dict[tuple[ScanId, ScanId], Match] = {}
    for pair, result in zip(pairs, _spread(match, pairs, workers), strict=True):
        matches[pair] = result
        if progress is not None:
            progress(len(matches), len(pairs))
    accepted = [(a, b, m.T_1_2) for (a, b), m in matches.items() if m.T_1_2 and m.verdict is Verdict.ACCEPTED]
    return Merge(merge_accepted(maps, accepted, parameters, check=check), matches)


def neighbours(scans: Iterable[ScanId]) -> Iterator[tuple[ScanId, ScanId]]:
    """Each scan with the next one of its log."""
    return ((a, b) for a, b in pairwise(scans) if a.log == b.log)


def _spread(
    match: Callable[[tuple[ScanId, ScanId]], Match], pairs: Sequence[tuple[ScanId, ScanId]], workers: int
) -> Iterator[Match]:
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


# --- accepted integrations ------------------------------------------------------------------------


def merge_accepted(
    maps: Mapping[ScanId, SegmentMap],
    accepted: Sequence[Accepted],
    parameters: Parameters | None = None,
    *,
    previous: Sequence[Component] = (),
    check: Callable[[], None] | None = None,
) -> tuple[Component, ...]:
    """The components that accepted integrations make of some maps, each fused by its pivots.

    A map that no accepted integration holds is a component of its own. The first integration that
    reaches a scan places it; ``previous`` components of the same maps and parameters are continued
    where they agree, with the same result as from the beginning.
    """
    parameters = parameters or Parameters()
    fused = []
    for number, placed in enumerate(_placed(list(maps), accepted), start=1):
        fuser = _Fuser(maps, placed, parameters)
        component_map = fuser.run(previous, check)
        poses = {scan: pose for scan, (pose, _) in placed.items()}
        fused.append(Component(f"component {number}", tuple(placed), poses, component_map))
    return tuple(fused)


_Placed = dict[ScanId, tuple[Pose2, ScanId | None]]
"""for each scan of a component: its pose in the first one's frame, and the pivot it was placed by"""


def _placed(scans: list[ScanId], accepted: Sequence[Accepted]) -> Iterator[_Placed]:
    """Walk the accepted integrations from the first scan not yet reached, composing poses (line 4)."""
    links: dict[ScanId, list[tuple[ScanId, Pose2]]] = {scan: [] for scan in scans}
    for a, b, T_a_b in accepted:
        links[a].append((b, T_a_b))
        links[b].append((a, T_a_b.inverse()))
    reached: set[ScanId] = set()
    for first in scans:
        if first in reached:
            continue
        component: _Placed = {first: (Pose2.identity(), None)}
        waiting = deque([first])
        while waiting:
            pivot = waiting.popleft()
            for scan, T_pivot_scan in links[pivot]:
                if scan not in component:
                    component[scan] = component[pivot][0] @ T_pivot_scan, pivot
                    waiting.append(scan)
        reached.update(component)
        yield component


@dataclass(frozen=True, eq=False)
class _Fuser:
    """S_1,2,...,i from S_1,2,...,i-1, scan by scan (lines 5 and 6)."""

    maps: Mapping[ScanId, SegmentMap]
    placed: _Placed
    parameters: Parameters

    def run(self, previous: Sequence[Component], check: Callable[[], None] | None) -> SegmentMap:
        component_map, done = self._longest_start(previous)
        for scan in list(self.placed)[done:]:
            if check is not None:
                check()
            component_map = self._with(component_map, scan)
        return component_map

    def _longest_start(self, previous: Sequence[Component]) -> tuple[SegmentMap, int]:
        """The longest of some earlier components that is a beginning of this one, and its number of scans."""
        starts = [component for component in previous if self._begins_with(component)]
        if not starts:
            return self.maps[next(iter(self.placed))], 1
        longest = max(starts, key=lambda component: len(component.scans))
        return longest.map, len(longest.scans)

    def _begins_with(self, component: Component) -> bool:
        scans = tuple(self.placed)[: len(component.scans)]
        return scans == component.scans and all(self.placed[s][0] == component.poses[s] for s in scans)

    def _with(self, component_map: SegmentMap, scan: ScanId) -> SegmentMap:
        T_1_scan, pivot = self.placed[scan]
        if self.parameters.pivot_form == "scan" or pivot is None:
            return self._fused(component_map, self.maps[scan], T_1_scan)
        T_1_pivot = self.placed[pivot][0]
        pair = self._fused(self.maps[pivot], self.maps[scan], T_1_pivot.inverse() @ T_1_scan)
        return self._fused(component_map, pair, T_1_pivot)

    def _fused(self, map_1: SegmentMap, map_2: SegmentMap, T_1_2: Pose2) -> SegmentMap:
        chains = matching_chains(map_1, map_2, T_1_2, self.parameters)
        return fuse(map_1, map_2, T_1_2, chains, self.parameters).map


def map_hash(components: Sequence[Component]) -> str:
    """SHA-256 over the coordinates of all components, rounded to 1e-6 m, as hexadecimal text."""
    digest = hashlib.sha256()
    for component in components:
        rounded = np.round(component.map.coordinates / HASH_RESOLUTION).astype("<i8")
        digest.update(len(rounded).to_bytes(8, "little"))
        digest.update(rounded.tobytes())
    return digest.hexdigest()
