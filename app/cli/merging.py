"""``merge``: logs into one map, or as many as the evidence holds together."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import typer

from app.cli.options import (
    DEFAULT_MODE,
    Heuristic,
    Json,
    Logs,
    Method,
    Mode,
    Out,
    Preset,
    Setting,
    Trajectory,
    method_of,
    one_of,
    read_all,
    topic_of,
)
from app.cli.output import pose_json, print_json, print_table, progress
from app.cli.writing import check_places, described, edges_between, listed, new_project, times_of, write_trajectory
from segmap.errors import ParameterError, ProjectError
from segmap.events import IntegrationId
from segmap.export import Content, write_files
from segmap.fusion import fuse_all
from segmap.integration import Match, Verdict
from segmap.merging import METHODS, Call, Component, Merge, MergeStep, Pair, calls_needed, map_hash
from segmap.merging import merge as merge_maps
from segmap.scans import LaserLog, ScanId
from segmap.segments import SegmentMap, extract

__all__ = ["merge"]

MergingMethod = Annotated[str, typer.Option(metavar=one_of(METHODS), help="How a sequence of scans is merged.")]
Stride = Annotated[
    int, typer.Option(min=1, metavar="N", help="Take every N-th scan; those between serve where a pair fails.")
]
Close = Annotated[bool, typer.Option("--close", help="Integrate the last scan of each log with its first one too.")]
Clean = Annotated[
    bool, typer.Option("--clean", help="Fuse all scans of a component at once in the end: each wall comes out once.")
]
MostCalls = Annotated[
    int, typer.Option(min=1, metavar="N", help="Ask, or refuse, where a method would integrate more pairs of maps.")
]
Project = Annotated[
    Path | None,
    typer.Option(metavar="FILE.segmap", help="Keep logs and accepted integrations as a project for the workbench."),
]


def merge(
    logs: Logs,
    method: MergingMethod = METHODS[-1],
    stride: Stride = 1,
    close: Close = False,
    clean: Clean = False,
    most_calls: MostCalls = 5000,
    out: Out = None,
    trajectory: Trajectory = None,
    project: Project = None,
    mode: Mode = DEFAULT_MODE,
    heuristic: Heuristic = None,
    preset: Preset = None,
    settings: Setting = None,
    as_json: Json = False,
) -> None:
    """Merge logs into a map of all that is accepted without asking anybody.

    What cannot be integrated begins a new component, with a frame of its own: nothing is placed without evidence.
    A project keeps the accepted integrations of scans, and makes its map of them by the pivot method.
    """
    by = method_of(mode, heuristic, preset, settings)
    _check_places(out or [], trajectory, project)
    sources = [(topic_of(path)[0], log) for path in logs for log in read_all(path)]
    task = _Task([log for _, log in sources], by, method, stride)
    task.check_calls(most_calls)
    merged = task.merged(close, clean)
    names, edges = list(map(str, merged.accepted)), edges_between(merged.accepted)
    content = Content(merged.components, merged.about, names, times_of(task.logs), edges=edges)
    for path in out or []:
        write_files(content, path)
    if trajectory is not None:
        write_trajectory(trajectory, content)
    if project is not None:
        new_project(project, merged.title, sources, by, merged.accepted)
    _report(merged, as_json)


def _check_places(out: Sequence[Path], trajectory: Path | None, project: Path | None) -> None:
    """Say before the work what could not be written after it."""
    check_places(out, trajectory, project)
    if project is not None and project.exists():
        raise ProjectError(f"{project} is there already: choose another name, or open it with segmap serve.")


@dataclass(frozen=True, eq=False)
class _Task:
    """Which scans are merged, and how."""

    logs: Sequence[LaserLog]
    by: Method
    method: str
    stride: int

    def check_calls(self, most: int) -> None:
        """Ask whether that many integrations are meant, where somebody sits at a terminal; refuse otherwise.

        Raises:
            ParameterError: they are not meant.
        """
        needed = calls_needed([len(log[:: self.stride]) for log in self.logs], self.method)
        if needed <= most:
            return
        told = f"The {self.method} method needs {needed} integrations of maps here"
        if sys.stdin.isatty() and typer.confirm(f"{told}. Go on?", err=True):
            return
        raise ParameterError(f"{told}: take fewer scans with --stride, or allow it with --most-calls {needed}.")

    def merged(self, close: bool, clean: bool) -> _Merged:
        """Merge the logs; ``close`` their loops, and make a ``clean`` map in the end."""
        every = {
            ScanId(number, index): extract(scan, self.by.parameters, number, index)
            for number, log in enumerate(self.logs)
            for index, scan in enumerate(log)
        }
        maps = {scan: every[scan] for scan in every if scan.scan % self.stride == 0}
        ends = [[scan for scan in maps if scan.log == number] for number in range(len(self.logs))] if close else []
        merged = self._merge(maps, every, [(scans[0], scans[-1]) for scans in ends if len(scans) > 2])
        return _Merged(", ".join(log.name for log in self.logs), _cleaned(merged, every, self.by) if clean else merged)

    def _merge(
        self, maps: Mapping[ScanId, SegmentMap], every: Mapping[ScanId, SegmentMap], closing: Sequence[Pair]
    ) -> Merge:
        by = self.by
        with progress("matching") as tell:
            return merge_maps(
                maps,
                by.parameters,
                by.heuristic,
                by.mode,
                self.method,
                closing=closing,
                between=every,
                workers=2,
                progress=tell,
            )


def _cleaned(merge: Merge, maps: Mapping[ScanId, SegmentMap], by: Method) -> Merge:
    """The same components, each fused anew from all its scans."""
    return replace(
        merge,
        components=tuple(
            replace(component, map=fuse_all(maps, component.poses, by.parameters)) for component in merge.components
        ),
    )


@dataclass(frozen=True, eq=False)
class _Merged:
    """A merge, and what is told of it."""

    title: str
    merge: Merge

    @cached_property
    def components(self) -> tuple[Component, ...]:
        """Those that hold at least one accepted integration, the map; numbered from 1."""
        held = [component for component in self.merge.components if len(component.scans) > 1]
        return tuple(replace(component, name=f"component {n}") for n, component in enumerate(held, start=1))

    @cached_property
    def alone(self) -> tuple[ScanId, ...]:
        """Scans that no accepted integration holds: not in the map."""
        return tuple(scan for c in self.merge.components if len(c.scans) == 1 for scan in c.scans)

    @cached_property
    def steps(self) -> list[MergeStep]:
        """The integrations the map is made of."""
        nodes = (node for component in self.components if component.tree for node in component.tree.nodes())
        return [node.step for node in nodes if node.step is not None]

    @cached_property
    def accepted(self) -> dict[IntegrationId, Match]:
        """The accepted integrations that placed a scan, by that scan and the one in whose frame its pose is."""
        return {_named(step.pair): step.match for step in self.steps if step.match and len(step.second.scans) == 1}

    @cached_property
    def hash(self) -> str:
        """The hash of the map."""
        return map_hash(self.components)

    @property
    def about(self) -> dict[str, str]:
        """What a file of the map says of itself."""
        return described(self.title, self.hash)


def _named(pair: Pair) -> IntegrationId:
    return IntegrationId(*pair)


def _report(merged: _Merged, as_json: bool) -> None:
    if as_json:
        print_json(_document(merged))
        return
    calls, count = merged.merge.calls, len(merged.components)
    accepted = sum(call.match.verdict is Verdict.ACCEPTED for call in calls)
    typer.echo(f"{merged.title}: {accepted} of {len(calls)} integrations accepted, {count} components")
    print_table(("component", "scans", "range", "segments", "length [m]"), list(map(_row, merged.components)))
    for closure in merged.merge.closures:
        apart = f"{closure.metres:.2f} m and {math.degrees(closure.radians):.1f} deg"
        typer.echo(f"the loop of {_named(closure.link.pair)} is {apart} from closing")
    doubtful = [step for step in merged.steps if step.review]
    if doubtful:
        typer.echo(f"for review: {len(doubtful)} integrations of maps; the first: {doubtful[0].remarks[0]}")
    if merged.alone:
        typer.echo(f"not in the map, as no integration of theirs was accepted: {listed(merged.alone)}")
    typer.echo(f"map {merged.hash}")


def _row(component: Component) -> tuple[object, ...]:
    first, last = min(component.scans), max(component.scans)
    length = component.map.lengths.sum()
    return component.name, len(component.scans), f"{first} to {last}", len(component.map), f"{length:.1f}"


def _document(merged: _Merged) -> dict[str, Any]:
    return {
        "components": [_component(component) for component in merged.components],
        "alone": [str(scan) for scan in merged.alone],
        "integrations": [_integration(call) for call in merged.merge.calls],
        **merged.merge.outline(),
        "hash": merged.hash,
    }


def _component(component: Component) -> dict[str, Any]:
    return {
        "name": component.name,
        "scans": {str(scan): pose_json(component.poses[scan]) for scan in component.scans},
        "segments": len(component.map),
        "length": float(component.map.lengths.sum()),
    }


def _integration(call: Call) -> dict[str, Any]:
    """A call of INTEGRATE; the pose is that of the second map's first scan in the frame of the first map's."""
    return {
        "id": str(_named(call.pair)),
        "scans": [len(call.first), len(call.second)],
        "pose": pose_json(call.match.T_1_2),
        "value": call.match.value,
        "confidence": call.match.confidence,
        "verdict": str(call.match.verdict),
    }
