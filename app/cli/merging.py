"""``merge``: logs into one map, or as many as the evidence holds together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import typer

from app.cli.options import (
    DEFAULT_MODE,
    Heuristic,
    Json,
    Method,
    Mode,
    Preset,
    Setting,
    method_of,
    one_of,
    read_all,
    topic_of,
)
from app.cli.output import pose_json, print_json, print_table, progress
from app.cli.writing import described, listed, new_project, times_of, write_trajectory
from segmap.errors import ProjectError
from segmap.events import IntegrationId
from segmap.export import Content, by_suffix, write_files
from segmap.integration import Match, Verdict
from segmap.merging import METHODS, Component, Merge, map_hash
from segmap.merging import merge as merge_maps
from segmap.scans import LaserLog, ScanId
from segmap.segments import SegmentMap, extract

__all__ = ["merge"]

Logs = Annotated[
    list[Path],
    typer.Argument(metavar="LOGS...", help="Laser logs, each in the order it was driven.", show_default=False),
]
MergingMethod = Annotated[str, typer.Option(metavar=one_of(METHODS), help="How a sequence of scans is merged.")]
Out = Annotated[
    list[Path] | None,
    typer.Option(metavar="FILE.EXT", help="Write the map, in the format the suffix says; can be given several times."),
]
Trajectory = Annotated[
    Path | None, typer.Option(metavar="FILE.tum", help="Write the poses of the scans of the largest component.")
]
Project = Annotated[
    Path | None,
    typer.Option(metavar="FILE.segmap", help="Keep logs and accepted integrations as a project for the workbench."),
]


def merge(
    logs: Logs,
    method: MergingMethod = METHODS[-1],
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
    """
    by = method_of(mode, heuristic, preset, settings)
    _check_places(out or [], project)
    sources = [(topic_of(path)[0], log) for path in logs for log in read_all(path)]
    laser_logs = [log for _, log in sources]
    merged = _merged(laser_logs, by, method)
    content = Content(merged.components, merged.about, list(map(str, merged.accepted)), times_of(laser_logs))
    for path in out or []:
        write_files(content, path)
    if trajectory is not None:
        write_trajectory(trajectory, content)
    if project is not None:
        new_project(project, merged.title, sources, by, merged.accepted)
    _report(merged, as_json)


def _check_places(out: Sequence[Path], project: Path | None) -> None:
    """Say before the work what could not be written after it."""
    for path in out:
        by_suffix(path)
    if project is not None and project.exists():
        raise ProjectError(f"{project} is there already: choose another name, or open it with segmap serve.")


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
    def accepted(self) -> dict[IntegrationId, Match]:
        """The accepted integrations."""
        matches = self.merge.matches.items()
        return {IntegrationId(*pair): m for pair, m in matches if m.verdict is Verdict.ACCEPTED and m.T_1_2 is not None}

    @cached_property
    def hash(self) -> str:
        """The hash of the map."""
        return map_hash(self.components)

    @property
    def about(self) -> dict[str, str]:
        """What a file of the map says of itself."""
        return described(self.title, self.hash)


def _merged(logs: Sequence[LaserLog], by: Method, method: str) -> _Merged:
    maps: dict[ScanId, SegmentMap] = {
        ScanId(number, index): extract(scan, by.parameters, number, index)
        for number, log in enumerate(logs)
        for index, scan in enumerate(log)
    }
    with progress("matching") as tell:
        merged = merge_maps(maps, by.parameters, by.heuristic, by.mode, method, workers=2, progress=tell)
    return _Merged(", ".join(log.name for log in logs), merged)


def _report(merged: _Merged, as_json: bool) -> None:
    if as_json:
        print_json(_document(merged))
        return
    accepted, total, count = len(merged.accepted), len(merged.merge.matches), len(merged.components)
    typer.echo(f"{merged.title}: {accepted} of {total} integrations accepted, {count} components")
    print_table(("component", "scans", "range", "segments", "length [m]"), list(map(_row, merged.components)))
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
        "integrations": [_integration(pair, match) for pair, match in merged.merge.matches.items()],
        "hash": merged.hash,
    }


def _component(component: Component) -> dict[str, Any]:
    return {
        "name": component.name,
        "scans": {str(scan): pose_json(component.poses[scan]) for scan in component.scans},
        "segments": len(component.map),
        "length": float(component.map.lengths.sum()),
    }


def _integration(pair: tuple[ScanId, ScanId], match: Match) -> dict[str, Any]:
    return {
        "id": str(IntegrationId(*pair)),
        "pose": pose_json(match.T_1_2),
        "value": match.value,
        "confidence": match.confidence,
        "verdict": str(match.verdict),
    }
