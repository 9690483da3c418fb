"""Integrations beyond a sequence, as that of the last scan with the first (V-B): they join parts, or test a whole."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from segmap.integration import Match
from segmap.merging.calls import Link, Maker, Pair
from segmap.merging.nodes import Flag, MergeNode, MergeStep

__all__ = ["Closure", "closed"]


@dataclass(frozen=True, eq=False)
class Closure:
    """An integration of two scans that were placed in one component without it."""

    link: Link
    metres: float
    """how far its pose is from that of the composed integrations"""
    radians: float

    @property
    def match(self) -> Match | None:
        """What INTEGRATE found; None where the pose was given."""
        return self.link.match

    def outline(self) -> dict[str, Any]:
        """As plain data for JSON."""
        return {
            "pair": [str(scan) for scan in self.link.pair],
            "pose": dict(zip(("x", "y", "theta"), self.link.T_a_b, strict=True)),
            "confidence": self.match and self.match.confidence,
            "flags": sorted(self.link.flags),
            "metres": self.metres,
            "radians": self.radians,
        }


def closed(
    maker: Maker, trees: Sequence[MergeNode], pairs: Iterable[Pair]
) -> tuple[list[MergeNode], tuple[Closure, ...]]:
    """Integrate pairs of scans one after the other: a valid one joins two trees, or tells how well one closes.

    Closing moves no scan: that is for a pose graph to do.
    """
    trees, closures = list(trees), list[Closure]()
    for a, b in pairs:
        first, second = (next((node for node in trees if scan in node.poses), None) for scan in (a, b))
        link = maker.link(a, b) if first and second else None
        if first is None or second is None or link is None:
            continue
        link = link.flagged(Flag.CLOSING)
        if first is second:
            closures.append(Closure(link, *(first.poses[a].inverse() @ first.poses[b]).distance(link.T_a_b)))
        else:
            trees = _joined(maker, trees, first, second, link)
    return trees, tuple(closures)


def _joined(maker: Maker, trees: list[MergeNode], first: MergeNode, second: MergeNode, link: Link) -> list[MergeNode]:
    """The trees with two of them as one, in the place of the earlier one."""
    (a, b), T_1_2 = link.pair, link.T_a_b
    T_1_2 = first.poses[a] @ T_1_2 @ second.poses[b].inverse()
    if trees.index(second) < trees.index(first):
        first, second, T_1_2 = second, first, T_1_2.inverse()
    node = maker.joined(MergeStep(first, second, T_1_2, link.pair, link.match, link.flags))
    return [node if tree is first else tree for tree in trees if tree is not second]
