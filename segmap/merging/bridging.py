"""From one scan to the next, through the scans in between where the pair itself fails (V-C)."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable

from segmap.merging.calls import Link, Maker, Pair
from segmap.merging.nodes import Flag
from segmap.scans import ScanId

__all__ = ["Between", "path"]


class Between:
    """The scans that were left out of a sequence, by what they lie between."""

    def __init__(self, scans: Iterable[ScanId] = ()) -> None:
        self._scans = sorted(scans)

    def half_way(self, a: ScanId, b: ScanId) -> ScanId | None:
        """The middle one of the scans between two of a log, the earlier of two middle ones; None: there is none."""
        if a.log != b.log:
            return None
        first, last = bisect_right(self._scans, min(a, b)), bisect_left(self._scans, max(a, b))
        return self._scans[(first + last - 1) // 2] if first < last else None


def path(maker: Maker, pair: Pair, between: Between) -> list[Link] | None:
    """Links from one scan to another: one where the pair integrates, more through scans half-way, down to neighbours.

    None where no such path holds; then no scan in between is placed either.
    """
    a, b = pair
    link = maker.link(a, b)
    if link is not None:
        return [link]
    middle = None if maker.decided(a, b) else between.half_way(a, b)
    if middle is None:
        return None
    before = path(maker, (a, middle), between)
    after = path(maker, (middle, b), between) if before else None
    return [link.flagged(Flag.BRIDGED) for link in before + after] if before and after else None
