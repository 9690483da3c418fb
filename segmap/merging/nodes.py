"""A merge as a tree of integrations that can be looked at one by one, those of map with map included."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from segmap.integration import Match
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.segments import SegmentMap

__all__ = ["Flag", "MergeNode", "MergeStep", "leaf", "outline"]


class Flag(StrEnum):
    """What is special about an integration."""

    MANUAL = "manual"
    """a person gave the pose; INTEGRATE was not called"""
    BRIDGED = "bridged"
    """reached through a scan in between, as the pair itself could not be integrated (V-C)"""
    SKIPPED = "skipped"
    """tree: made of S_i and S_i+2, in place of two integrations (IV-B)"""
    SHARED = "shared scan"
    """INTEGRATE gave no valid pose: that of a scan in both maps served; for review"""
    DISAGREES = "disagrees"
    """the pose INTEGRATE found and that of a scan in both maps are two; for review"""
    PIVOT = "pivot"
    """pivot: a pair's map, moved by the pose of its first scan (IV-C); INTEGRATE was not called"""
    CLOSING = "closing"
    """an integration beyond the sequence, such as that of the last scan with the first"""


REVIEW = frozenset({Flag.SHARED, Flag.DISAGREES})
"""what a person should look at"""


@dataclass(frozen=True, eq=False)
class MergeStep:
    """How two maps became one."""

    first: MergeNode
    second: MergeNode
    T_1_2: Pose2
    """pose of the second map's frame in the first one's"""
    pair: tuple[ScanId, ScanId]
    """the scans in whose frames ``match`` is: the first of either map, or those of a pair of scans"""
    match: Match | None
    """what INTEGRATE found; None where it was not called"""
    flags: frozenset[Flag] = frozenset()
    remarks: tuple[str, ...] = ()
    """what is to be said of the flags, in words"""

    @property
    def review(self) -> bool:
        """Whether a person should look at it."""
        return not REVIEW.isdisjoint(self.flags)


@dataclass(frozen=True, eq=False)
class MergeNode:
    """A scan, or the integration of two nodes."""

    scans: tuple[ScanId, ...]
    """in the order they were fused"""
    poses: Mapping[ScanId, Pose2]
    """pose of each scan in the frame of the first one"""
    map: SegmentMap
    """fused, in the frame of the first scan"""
    step: MergeStep | None = None
    """None: a scan itself"""

    @property
    def scan(self) -> ScanId:
        """The scan in whose frame everything is."""
        return self.scans[0]

    def nodes(self) -> Iterator[MergeNode]:
        """Every node below and this one, each once, parts before the whole."""
        done: set[int] = set()
        waiting = [(self, False)]
        while waiting:
            node, ready = waiting.pop()
            if id(node) in done:
                continue
            if ready or node.step is None:
                done.add(id(node))
                yield node
            else:
                waiting += [(node, True), (node.step.second, False), (node.step.first, False)]

    def leaf(self, scan: ScanId) -> MergeNode | None:
        """The node of a scan itself; None where there is none."""
        return next((node for node in self.nodes() if node.step is None and node.scan == scan), None)


def leaf(scan: ScanId, segment_map: SegmentMap) -> MergeNode:
    """A scan itself."""
    return MergeNode((scan,), {scan: Pose2.identity()}, segment_map)


def outline(trees: Sequence[MergeNode]) -> list[dict[str, Any]]:
    """Every node of some trees as plain data for JSON, parts before the whole; nodes are named by their place.

    A scan has ``scan``; an integration ``first`` and ``second`` (places), ``pair``, ``pose`` of the second in the
    first, ``value``, ``confidence``, ``verdict`` and ``reasons`` of its match (null where INTEGRATE was not
    called), ``flags``, ``remarks``, ``review``; both have ``scans`` and ``segments``, their numbers.
    """
    places: dict[int, int] = {}
    rows: list[dict[str, Any]] = []
    for tree in trees:
        for node in tree.nodes():
            if id(node) not in places:
                places[id(node)] = len(rows)
                rows.append({"node": len(rows), **_row(node, places)})
    return rows


def _row(node: MergeNode, places: Mapping[int, int]) -> dict[str, Any]:
    counts = {"scans": len(node.scans), "segments": len(node.map)}
    if node.step is None:
        return {"scan": str(node.scan), **counts}
    step, match = node.step, node.step.match
    return {
        "first": places[id(step.first)],
        "second": places[id(step.second)],
        "pair": [str(scan) for scan in step.pair],
        "pose": dict(zip(("x", "y", "theta"), step.T_1_2, strict=True)),
        "value": match and match.value,
        "confidence": match and match.confidence,
        "verdict": match and str(match.verdict),
        "reasons": list(match.reasons) if match else [],
        "flags": sorted(step.flags),
        "remarks": list(step.remarks),
        "review": step.review,
        **counts,
    }
