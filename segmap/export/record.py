"""What a report tells beside the merged map: decisions, evidence, the pose graph, logs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from segmap.events import Decision, LogInfo
from segmap.graph import Optimised, Strength
from segmap.project import ProjectState
from segmap.scans import ScanId
from segmap.segments import SegmentMap
from segmap.visibility import Evidence

__all__ = ["LogTold", "PairTold", "Record"]


@dataclass(frozen=True)
class LogTold:
    """A log, and what was found out about it when it was read."""

    info: LogInfo
    no_return: float | None = None
    """metres; the reading that stands for "nothing seen" """
    problems: tuple[str, ...] = ()
    """what was left out of it"""


@dataclass(frozen=True)
class PairTold:
    """What is known of a pair of scans: at the pose decided on, or else at the best one found."""

    integration: str
    kind: str
    """why it was asked about: neighbour, closure, imported or manual"""
    state: str
    """accepted, rejected, pending, none, failed or matching"""
    decision: Decision | None = None
    verdict: str | None = None
    """what the program says of this pose: accepted, review or rejected; None: nothing"""
    confidence: float | None = None
    """that the pose is right, in 0..1"""
    value: float | None = None
    """metres"""
    evidence: Evidence | None = None
    weakest: float | None = None
    """metres; standard deviation along the weakest direction"""


@dataclass(frozen=True, eq=False)
class Record:
    """All a report is made of, beside the components of the map."""

    state: ProjectState
    pairs: tuple[PairTold, ...]
    """in the order of the scans"""
    optimised: Optimised
    """the pose graph of what is accepted"""
    strengths: tuple[Strength, ...]
    """of its components"""
    logs: tuple[LogTold, ...] = ()
    scans: tuple[ScanId, ...] = ()
    """of all logs"""
    map_of: Callable[[ScanId], SegmentMap] | None = None
    """the segments of a scan, for pictures of pairs; None: none are drawn"""
