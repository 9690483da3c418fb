"""``walkthrough``: an integration, or a merge, step by step, as a file for a lecture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from app.cli.options import (
    DEFAULT_MODE,
    Heuristic,
    Log,
    Method,
    Mode,
    Preset,
    Setting,
    method_of,
    read,
    segment_maps,
    topic_of,
)
from app.errors import RequestError
from app.inputs import Inputs
from app.posegraph import edges_of
from app.walk_files import KINDS, MOST_FRAMES, walk_file
from app.walks import MOST_MERGED
from segmap.export.files import check_place, write_whole
from segmap.logs import holds_maps
from segmap.scans import ScanId
from segmap.store import Store
from segmap.walkthrough import Walkthrough, walk_graph, walk_maps, walk_merge, walk_scans

__all__ = ["of_project", "walkthrough"]


def walkthrough(
    log: Log,
    first: Annotated[int, typer.Argument(metavar="I", help="Index of the first scan, from 0.", show_default=False)],
    second: Annotated[int, typer.Argument(metavar="J", help="Index of the second scan.", show_default=False)],
    out: Annotated[
        Path,
        typer.Option(
            metavar="FILE.html|.zip|.gif",
            help="One page that plays without a network, a numbered series of PNGs, or an animation.",
            show_default=False,
        ),
    ],
    mode: Mode = DEFAULT_MODE,
    heuristic: Heuristic = None,
    preset: Preset = None,
    settings: Setting = None,
    merging: Annotated[
        bool, typer.Option("--merge", help="Scans I to J merged by all three methods, and their pose graph.")
    ] = False,
    stage: Annotated[
        str, typer.Option(metavar="ID", help="Pictures of this stage only, such as evaluation or polylines.")
    ] = "",
    pictures: Annotated[int, typer.Option(min=1, max=1000, help="Most pictures of a series or an animation.")] = (
        MOST_FRAMES
    ),
) -> None:
    """Record how scan J is integrated with scan I, step by step, as a file to show.

    Every step is there: points to segments, angles, candidates and their values, lines of sight, chains, polylines,
    the verdict; where there are very many of a kind, some of them. A file of segment maps takes the place of a log.
    """
    kind = _kind(out)
    method = method_of(mode, heuristic, preset, settings)
    made = _merge(log, first, second, method) if merging else _pair(log, first, second, method)
    _write(made, out, kind, stage, pictures)


def of_project(project: Path, out: Path) -> None:
    """Write the walkthrough of a project: its first accepted integration, and the pose graph of all of them."""
    kind = _kind(out)
    with Store.open(project) as store:
        state = store.state
        inputs = Inputs(store, state.logs, store.log_bytes)
        edges = edges_of(state)
        first, second = (edges[0].first, edges[0].second) if edges else _first_two(inputs.scan_ids)
        title = f"{state.name}: scans {first} and {second}"
        how = state.parameters, state.heuristic, state.mode, title
        made = walk_scans(inputs.scan(first), inputs.scan(second), *how, names=(str(first), str(second))).walk
        held = sorted({scan for edge in edges for scan in (edge.first, edge.second)})
        graph = walk_graph(edges, {scan: inputs.segment_map(scan, state.parameters) for scan in held})
    _write(replace(made, stages=made.stages + graph.stages, base={**made.base, **graph.base}), out, kind)


def _first_two(scans: Sequence[ScanId]) -> tuple[ScanId, ScanId]:
    if len(scans) < 2:
        raise RequestError("A walkthrough takes two scans; this project has fewer.")
    return scans[0], scans[1]


def _kind(out: Path) -> str:
    kind = out.suffix.lower().removeprefix(".")
    if kind not in KINDS:
        raise RequestError(f"{out.name}: a walkthrough is written as .{', .'.join(KINDS)}. Choose one of these.")
    check_place(out)
    return kind


def _write(made: Walkthrough, out: Path, kind: str, stage: str = "", pictures: int = MOST_FRAMES) -> None:
    file = walk_file(made, kind, stage, pictures)
    write_whole(out, file.content)
    typer.echo(f"{out}: {len(made.stages)} stages, {len(file.content) / 1e6:.1f} MB")


def _pair(log: Path, first: int, second: int, method: Method) -> Walkthrough:
    how = method.parameters, method.heuristic, method.mode
    if holds_maps(topic_of(log)[0]):
        name, map_of = segment_maps(log, method.parameters)
        return walk_maps(map_of(first), map_of(second), *how, f"{name}: maps {first} and {second}").walk
    held = read(log)
    title, names = f"{held.name}: scans {first} and {second}", (str(first), str(second))
    return walk_scans(held.scan(first), held.scan(second), *how, title, names=names).walk


def _merge(log: Path, first: int, last: int, method: Method) -> Walkthrough:
    if not 1 <= last - first < MOST_MERGED:
        raise RequestError(f"A merge is shown of 2 to {MOST_MERGED} scans: give I and J so that I to J are as many.")
    name, map_of = segment_maps(log, method.parameters)
    maps = {ScanId(0, scan): map_of(scan) for scan in range(first, last + 1)}
    title = f"{name}: merging {first} to {last}"
    return walk_merge(maps, method.parameters, method.heuristic, method.mode, title).walk
