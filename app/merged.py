"""The merged map of what is accepted, computed again in the background after each decision."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from app.jobs import Check, Latest
from app.posegraph import Solver, edges_of, placed
from app.resources import program_version
from app.review import THRESHOLDS
from segmap.errors import CancelledError, ExportError, ProjectError, SegmapError
from segmap.export import RESOLUTION, Content, Record
from segmap.graph import Edge
from segmap.merging import Component, map_hash, merge_accepted
from segmap.parameters import Parameters
from segmap.project import ProjectState
from segmap.scans import ScanId
from segmap.segments import SegmentMap

__all__ = ["Merged", "MergedMap", "exportable", "map_parameters", "merge_project"]

Extractor = Callable[[ScanId, Parameters], SegmentMap]


@dataclass(frozen=True)
class Merged:
    """The merged map of what was accepted at a revision, under some parameters."""

    revision: int = 0
    components: tuple[Component, ...] = ()
    hash: str = ""
    parameters: Parameters | None = None
    integrations: tuple[str, ...] = ()
    """the accepted ones it was made of"""
    edges: tuple[Edge, ...] = ()
    """of them those that the optimiser believes, with their covariances"""


def map_parameters(parameters: Parameters) -> Parameters:
    """The same for parameters that make the same map: thresholds only propose, decisions hold."""
    return parameters.replace(**dict.fromkeys(THRESHOLDS, 0.0))


def merge_project(
    state: ProjectState,
    extractor: Extractor,
    previous: Merged | None = None,
    check: Check | None = None,
    solve: Solver | None = None,
) -> Merged:
    """The map of everything accepted in a project, and of nothing else; scans nobody accepted are not in it.

    Scans are where the pose graph has them. What did not change since ``previous`` is taken from there, with the
    same result.
    """
    edges, parameters = edges_of(state), map_parameters(state.parameters)
    optimised = (solve or Solver())(edges, check)
    scans = sorted(optimised.poses)
    maps = {}
    for scan in scans:
        if check is not None:
            check()
        maps[scan] = extractor(scan, state.parameters)
    reusable = previous.components if previous and previous.parameters == parameters else ()
    components = merge_accepted(maps, placed(edges, optimised), state.parameters, previous=reusable, check=check)
    integrations = tuple(edge.name for edge in edges)
    believed = tuple(residual.edge for residual in optimised.residuals if not residual.silenced)
    return Merged(state.revision, components, map_hash(components), parameters, integrations, believed)


def exportable(
    state: ProjectState,
    merged: Merged,
    time_of: Callable[[ScanId], float | None],
    stem: str = "map",
    resolution: float = RESOLUTION,
    record: Record | None = None,
) -> Content:
    """The merged map of a project, ready to be written in any format; it says where it comes from.

    ``stem`` is what the names of files begin with, ``resolution`` the side of a cell in metres where
    a format has cells, ``record`` what a report tells besides.

    Raises:
        ExportError: nothing is accepted, and there is no record to tell of either.
    """
    if not merged.components and record is None:
        raise ExportError("There is nothing to export: accept at least one integration first.")
    told = {
        "title": state.name,
        "version": program_version(),
        "map_hash": merged.hash,
        "revision": str(merged.revision),
        "parameters": state.fingerprint,
    }
    if silenced := len(merged.integrations) - len(merged.edges):
        told["silenced"] = f"{silenced} accepted integrations that the others contradict: no edges of a pose graph"
    times = {scan: time_of(scan) for component in merged.components for scan in component.scans}
    return Content(
        merged.components, told, merged.integrations, times, stem, resolution, edges=merged.edges, record=record
    )


class MergedMap:
    """Keeps the merged map of a project up to date, in a thread of its own."""

    def __init__(
        self,
        state: Callable[[], ProjectState],
        extractor: Extractor,
        solve: Solver,
        done: Callable[[Merged], None],
        failed: Callable[[str], None],
        prepare: Callable[[Check], None],
    ) -> None:
        self._state, self._extractor, self._solve, self._prepare = state, extractor, solve, prepare
        self._done, self._failed = done, failed
        self._trouble = ""
        self.current = Merged()
        self._latest = Latest(self._merge, "merging")
        self.ask, self.settle, self.close = self._latest.ask, self._latest.settle, self._latest.close

    @property
    def busy(self) -> bool:
        """Whether the map is being computed, or is about to be."""
        return self._latest.busy

    def wait(self, timeout: float | None = None) -> Merged:
        """The map of what is accepted now.

        Raises:
            ProjectError: it could not be computed, or not within ``timeout`` seconds.
        """
        if not self.settle(timeout):
            raise ProjectError("The merged map is still being computed: try again in a moment.")
        if self._trouble:
            raise ProjectError(self._trouble)
        return self.current

    def _merge(self, check: Check) -> None:
        self._prepare(check)
        try:
            self.current = merge_project(self._state(), self._extractor, self.current, check, self._solve)
        except CancelledError:
            raise
        except SegmapError as error:
            self._trouble = f"The merged map could not be computed: {error}"
            self._failed(self._trouble)
        else:
            self._trouble = ""
            self._done(self.current)
