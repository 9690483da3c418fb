"""``map``: whole logs into whole maps, without odometry."""

from __future__ import annotations

import math
from typing import Any

import typer

from app.cli.clusters import cluster
from app.cli.options import Dask, Json, Logs, Out, Preset, Setting, Trajectory, Workers, method_of, read_all
from app.cli.output import print_json, print_table, progress
from app.cli.writing import check_places, described, listed, times_of, write_trajectory
from segmap.export import Content, write_files
from segmap.mapping import WholeMap, fused, map_scans
from segmap.merging import Component, map_hash
from segmap.scans import ScanId
from segmap.segments import extract

__all__ = ["map_logs"]


def map_logs(
    logs: Logs,
    out: Out = None,
    trajectory: Trajectory = None,
    workers: Workers = 2,
    dask: Dask = None,
    preset: Preset = None,
    settings: Setting = None,
    as_json: Json = False,
) -> None:
    """Map whole logs without odometry: keyframes, loop closures, one consistent set of poses, one clean map.

    Scans and logs are put together where the evidence holds them together; what nothing holds is a component of its
    own, and what hangs on the rest without an accepted integration is told.
    """
    by = method_of("verified", None, preset, settings)
    check_places(out or [], trajectory)
    laser_logs = [log for path in logs for log in read_all(path)]
    maps = {
        ScanId(number, index): extract(scan, by.parameters, number, index)
        for number, log in enumerate(laser_logs)
        for index, scan in enumerate(log)
    }
    with cluster(dask) as backend, progress("mapping") as tell:
        whole = map_scans(
            maps,
            by.parameters,
            workers=workers,
            backend=backend,
            progress=lambda _, done, total: tell(done, total),
        )
    parts = fused(whole, maps, by.parameters)
    title = ", ".join(log.name for log in laser_logs)
    about = described(title, map_hash(parts))
    names = [f"{link.first}-{link.second}" for link in whole.links]
    believed = [residual.edge for residual in whole.optimised.residuals if not residual.silenced]
    content = Content(parts, about, names, times_of(laser_logs), edges=believed)
    for path in out or []:
        write_files(content, path)
    if trajectory is not None:
        write_trajectory(trajectory, content)
    _report(title, whole, parts, as_json)


def _report(title: str, whole: WholeMap, parts: tuple[Component, ...], as_json: bool) -> None:
    alone = [scan for scan in whole.scans if scan not in whole.poses]
    doubtful = whole.weakly_held()
    if as_json:
        print_json(_document(title, whole, parts, alone, doubtful))
        return
    silenced = len(whole.optimised.silenced)
    typer.echo(
        f"{title}: {len(whole.keys)} keyframes of {len(whole.scans)} scans, {len(whole.matches)} pairs matched, "
        f"{len(whole.links)} links, {silenced} of them silenced, {len(parts)} component{'' if len(parts) == 1 else 's'}"
    )
    rows = [(part.name, str(len(part.scans)), str(len(part.map)), f"{part.map.lengths.sum():.1f}") for part in parts]
    print_table(("component", "scans", "segments", "length [m]"), rows)
    for reason in dict.fromkeys(doubtful.values()):
        typer.echo(f"to be looked at: {reason}")
    if alone:
        typer.echo(f"not in the map, as nothing holds them: {listed(alone)}")


def _document(
    title: str, whole: WholeMap, parts: tuple[Component, ...], alone: list[ScanId], doubtful: dict[ScanId, str]
) -> dict[str, Any]:
    return {
        "title": title,
        "hash": map_hash(parts),
        "scans": len(whole.scans),
        "placed": len(parts[0].scans) / len(whole.scans) if parts else 0.0,
        "keyframes": [str(scan) for scan in whole.keys],
        "matched": len(whole.matches),
        "links": [_link(whole, place) for place in range(len(whole.links))],
        "components": [
            {
                "name": part.name,
                "segments": len(part.map),
                "length": float(part.map.lengths.sum()),
                "poses": {str(scan): [pose.x, pose.y, pose.theta] for scan, pose in part.poses.items()},
            }
            for part in parts
        ],
        "weakly_held": {str(scan): reason for scan, reason in doubtful.items()},
        "alone": [str(scan) for scan in alone],
    }


def _link(whole: WholeMap, place: int) -> dict[str, Any]:
    link, fate = whole.links[place], whole.optimised.residuals[place]
    return {
        "integration": f"{link.first}-{link.second}",
        "why": link.why,
        "confidence": link.confidence,
        "pose": {"x": link.T_1_2.x, "y": link.T_1_2.y, "theta": link.T_1_2.theta},
        "residual_m": fate.translation,
        "residual_deg": math.degrees(fate.rotation),
        "silenced": fate.silenced,
    }
