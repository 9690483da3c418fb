"""What writers are given, the components of a merged map and words about its origin; and what a format is."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol, TypeAlias

from segmap.export.record import Record
from segmap.graph import Edge
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.segments import SegmentMap, Source

__all__ = ["RESOLUTION", "Content", "ExportFormat", "Files", "MapComponent", "origin_of", "scans_of", "told_of"]

RESOLUTION = 0.05
"""metres, the side of a cell of a grid map where nobody asks for another"""

Files: TypeAlias = Mapping[str, bytes]
"""Contents of files by name; the first is the one people open."""


class MapComponent(Protocol):
    """A part of a merged map that hangs together; its frame is that of its first scan."""

    @property
    def name(self) -> str:
        """What people call it."""

    @property
    def scans(self) -> Sequence[ScanId]:
        """The scans it was merged from."""

    @property
    def poses(self) -> Mapping[ScanId, Pose2]:
        """The pose of each of its scans in its frame."""

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
    times: Mapping[ScanId, float | None] = field(default_factory=dict)
    """when scans were taken, seconds, where that is known"""
    stem: str = "map"
    """what the names of the files begin with"""
    resolution: float = RESOLUTION
    """metres, the side of a cell, for formats that are made of cells"""
    edges: Sequence[Edge] = ()
    """the accepted integrations with their covariances, for formats that hold a pose graph"""
    record: Record | None = None
    """decisions and evidence, for formats that tell of them"""

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


@dataclass(frozen=True, slots=True)
class ExportFormat:
    """A kind of file segmap writes."""

    name: str
    suffix: str
    """of the file people open, with the dot"""
    media_type: str
    title: str
    """what people call the format"""
    use: str
    """what it is good for, in a few words"""
    write: Callable[[Content], bytes | Files]
    """one file, or several whose names begin with the content's ``stem``"""
    holds: str = "Merged map"
    """for people"""
    several: bool = False
    """whether it takes more than one file; they travel as one zip archive"""
    needs_record: bool = False
    """whether it tells of decisions and evidence, too"""


def scans_of(sources: Sequence[Source]) -> list[ScanId]:
    """The scans behind a segment, in order, each once."""
    return sorted({ScanId(source.log, source.scan) for source in sources})


def origin_of(sources: Sequence[Source]) -> str:
    """The segments of scans behind a segment, as text: ``0.12.3 0.13.7`` is log, scan and segment of each."""
    return " ".join(f"{source.log}.{source.scan}.{source.segment}" for source in sources)


def told_of(metadata: Mapping[str, str]) -> list[str]:
    """The metadata as printable lines ``name: value``, in the order of the names, for comments.

    >>> told_of({"version": "0.1.0", "title": "two\\nlines"})
    ['title: two lines', 'version: 0.1.0']
    """
    return [_printable(f"{name}: {value}") for name, value in sorted(metadata.items())]


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in " ".join(text.split()))
