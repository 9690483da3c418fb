"""Which scans of a whole map hang on little: their place stands or falls with one doubtful step."""

from __future__ import annotations

from collections.abc import Sequence

from segmap.graph import components
from segmap.links import Link
from segmap.scans import ScanId

__all__ = ["FIRM", "doubtful_steps", "loose_parts", "weakly_held"]

FIRM = ("accepted", "agreed", "closed", "tracked")
"""links that bear a place out"""


def doubtful_steps(links: Sequence[Link]) -> list[list[Link]]:
    """The links that bear nothing out by themselves, those together that have scans in common.

    They were taken for true together, so they may be wrong together.
    """
    weak = [link for link in links if link.why not in FIRM]
    parts = components([link.edge for link in weak])
    number = {scan: i for i, part in enumerate(parts) for scan in part}
    steps: list[list[Link]] = [[] for _ in parts]
    for link in weak:
        steps[number[link.first]].append(link)
    return steps


def weakly_held(links: Sequence[Link], wholes: Sequence[Sequence[ScanId]]) -> dict[ScanId, str]:
    """The scans whose place one doubtful step decides, and why: to be looked at by a person.

    Parts of a component that hang together by accepted matches, but hang on the rest by what neighbours agreed on
    or what fits the robot's pace, may be where they are or not. Where two ways lead to them, one bears out the
    other: the links given are those that the optimiser does not silence.
    """
    return {scan: _said(part) for part, loose in loose_parts(links, wholes) for scan in loose}


def loose_parts(
    links: Sequence[Link], wholes: Sequence[Sequence[ScanId]]
) -> list[tuple[tuple[ScanId, ...], tuple[ScanId, ...]]]:
    """The parts that hang on the rest by one doubtful step: all scans of each, and those no other way leads to."""
    scans = [scan for whole in wholes for scan in whole]
    homes = _homes(components([link.edge for link in links if link.why in FIRM], scans), wholes)
    held: set[ScanId] = set(scans)
    for step in doubtful_steps(links):
        left_out = {link.pair for link in step}
        parts = components([link.edge for link in links if link.pair not in left_out], scans)
        held &= {scan for part in parts if not homes.isdisjoint(part) for scan in part}
    loose = components([link.edge for link in links if link.why in FIRM], set(scans) - held)
    return [(part, own) for part in loose if (own := tuple(scan for scan in part if scan not in held))]


def _said(part: Sequence[ScanId]) -> str:
    who = f"scan {part[0]} hangs" if len(part) == 1 else f"{len(part)} scans from {part[0]} on hang"
    return f"{who} on the rest by a step that no accepted integration bears out."


def _homes(parts: Sequence[Sequence[ScanId]], wholes: Sequence[Sequence[ScanId]]) -> set[ScanId]:
    """The first scan of the largest part of each whole."""
    number = {scan: i for i, whole in enumerate(wholes) for scan in whole}
    largest: dict[int, Sequence[ScanId]] = {}
    for part in parts:
        kept = largest.setdefault(number[part[0]], part)
        largest[number[part[0]]] = max(kept, part, key=len)
    return {part[0] for part in largest.values()}
