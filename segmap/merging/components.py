"""Components: scans that accepted integrations hold together, each with a pose, and their fused map."""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from segmap.chains import matching_chains
from segmap.fusion import fuse
from segmap.merging.nodes import MergeNode
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.segments import SegmentMap

__all__ = ["Accepted", "Component", "fused", "map_hash", "merge_accepted"]

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
    tree: MergeNode | None = None
    """the integrations it was made by, one by one; None where it was made of decisions"""


def fused(map_1: SegmentMap, map_2: SegmentMap, T_1_2: Pose2, parameters: Parameters) -> SegmentMap:
    """Two maps as one in the frame of the first (Algorithm 5); a scan of both stands where it does in the first."""
    chains = matching_chains(map_1, map_2, T_1_2, parameters)
    whole = fuse(map_1, map_2, T_1_2, chains, parameters).map
    held = {id(sight.scan) for sight in map_1.sights}
    if held.isdisjoint(id(sight.scan) for sight in map_2.sights):
        return whole
    new = tuple(sight for sight in whole.sights[len(map_1.sights) :] if id(sight.scan) not in held)
    return replace(whole, sights=map_1.sights + new)


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
    components = []
    for number, placed in enumerate(_placed(list(maps), accepted), start=1):
        fuser = _Fuser(maps, placed, parameters)
        component_map = fuser.run(previous, check)
        poses = {scan: pose for scan, (pose, _) in placed.items()}
        components.append(Component(f"component {number}", tuple(placed), poses, component_map))
    return tuple(components)


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
            return fused(component_map, self.maps[scan], T_1_scan, self.parameters)
        T_1_pivot = self.placed[pivot][0]
        pair = fused(self.maps[pivot], self.maps[scan], T_1_pivot.inverse() @ T_1_scan, self.parameters)
        return fused(component_map, pair, T_1_pivot, self.parameters)


def map_hash(components: Sequence[Component]) -> str:
    """SHA-256 over the coordinates of all components, rounded to 1e-6 m, as hexadecimal text."""
    digest = hashlib.sha256()
    for component in components:
        rounded = np.round(component.map.coordinates / HASH_RESOLUTION).astype("<i8")
        digest.update(len(rounded).to_bytes(8, "little"))
        digest.update(rounded.tobytes())
    return digest.hexdigest()
