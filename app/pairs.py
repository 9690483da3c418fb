"""Which pairs of scans a project asks about, and why. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

from segmap.events import IntegrationId
from segmap.project import ProjectState
from segmap.scans import ScanId

__all__ = ["KINDS", "Pairs", "are_neighbours", "integrations_of", "kind_of", "pairs_in"]

KINDS = ("neighbour", "closure", "imported", "manual")
"""Why a pair is in the queue: its scans follow each other, our search found it, another program's pose graph holds
it, or somebody asked for it."""


def integrations_of(state: ProjectState, scan_ids: Sequence[ScanId]) -> tuple[str, ...]:
    """All pairs of a project, in order: neighbours of each log, those proposed, and those decided anyway."""
    pairs = {*_consecutive(scan_ids), *map(IntegrationId.parse, {*state.proposals, *state.decisions})}
    return tuple(map(str, sorted(pairs)))


class Pairs:
    """The same, made again only when a step brings another pair or takes one away."""

    def __init__(self) -> None:
        self._scans, self._neighbours = -1, frozenset[str]()
        self._others, self._found = frozenset[str](), tuple[str, ...]()

    def of(self, state: ProjectState, scan_ids: Sequence[ScanId]) -> tuple[str, ...]:
        """All pairs of a state of one project, to which logs are only ever added."""
        fresh = len(scan_ids) != self._scans
        if fresh:
            self._scans, self._neighbours = len(scan_ids), frozenset(map(str, _consecutive(scan_ids)))
        others = frozenset({*state.proposals, *state.decisions} - self._neighbours)
        if fresh or others != self._others:
            self._others, self._found = others, integrations_of(state, scan_ids)
        return self._found


def _consecutive(scan_ids: Sequence[ScanId]) -> Iterator[IntegrationId]:
    return (IntegrationId(a, b) for a, b in pairwise(scan_ids) if a.log == b.log)


def are_neighbours(first: ScanId, second: ScanId) -> bool:
    """Whether a scan follows the other in its log."""
    return first.log == second.log and second.scan == first.scan + 1


def kind_of(integration: IntegrationId, state: ProjectState) -> str:
    """Why a pair is asked about, one of ``KINDS``."""
    first, second = integration
    if are_neighbours(first, second):
        return "neighbour"
    proposal = state.proposals.get(str(integration))
    return "manual" if proposal is None else proposal.kind


def pairs_in(state: ProjectState) -> int:
    """How many pairs a project asks about; no log is read for it."""
    scans = [ScanId(log.index, i) for log in state.logs for i in range(log.scans)]
    return len(integrations_of(state, scans))
