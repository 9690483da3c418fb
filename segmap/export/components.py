"""What every writer is given: the components of a merged map, and words about where they come from."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

from segmap.scans import ScanId
from segmap.segments import SegmentMap, Source

__all__ = ["Content", "MapComponent", "scans_of"]


class MapComponent(Protocol):
    """A part of a merged map that hangs together; its frame is that of its first scan."""

    @property
    def name(self) -> str:
        """What people call it."""

    @property
    def scans(self) -> Sequence[ScanId]:
        """The scans it was merged from."""

    @property
    def map(self) -> SegmentMap:
        """Its segments, metres."""


@dataclass(frozen=True)
class Content:
    """All that goes into a file."""

    components: Sequence[MapComponent]
    metadata: Mapping[str, str] = field(default_factory=dict)
    """name and value: ``title``, ``version``, ``map_hash``, ... ; written as it is"""
    integrations: Sequence[str] = ()
    """ids of the accepted integrations, such as ``0.12-0.13``"""

    @cached_property
    def _by_first(self) -> Mapping[str, list[tuple[int, str, str]]]:
        """Place, id and second scan of the integrations of each first scan."""
        index: dict[str, list[tuple[int, str, str]]] = defaultdict(list)
        for place, integration in enumerate(self.integrations):
            first, _, second = integration.partition("-")
            index[first].append((place, integration, second))
        return index

    def integrations_of(self, scans: Sequence[ScanId]) -> list[str]:
        """The accepted integrations between any two of some scans, in their own order."""
        names = {str(scan) for scan in scans}
        found = [entry for name in names for entry in self._by_first.get(name, ()) if entry[2] in names]
        return [integration for _, integration, _ in sorted(found)]


def scans_of(sources: Sequence[Source]) -> list[ScanId]:
    """The scans behind a segment, in order, each once."""
    return sorted({ScanId(source.log, source.scan) for source in sources})
