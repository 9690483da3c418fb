"""What is in a log: ``info`` and ``segments``."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import asdict
from typing import Annotated, Any

import numpy as np
import typer

from app.cli.options import Json, Log, Preset, Setting, open_log, parameters_of, read
from app.cli.output import print_facts, print_json, print_table
from segmap.scans import LaserLog, LaserScan
from segmap.segments import extract

__all__ = ["info", "segments"]


def info(log: Log, as_json: Json = False) -> None:
    """Say what is in a log: its format, its scans, its laser, and what could not be read."""
    facts = _facts(open_log(log))
    if as_json:
        print_json(facts)
        return
    lasers = "; ".join(
        f"{n['scans']} scans of {n['beams']} beams, {n['first_angle_deg']:g} to {n['last_angle_deg']:g} deg"
        for n in facts["lasers"]
    )
    print_facts(
        {
            "log": facts["log"],
            "format": facts["format"] or "none",
            **({"topic": facts["topic"]} if facts["topic"] else {}),
            "scans": facts["scans"],
            "laser": lasers or "none",
            "no return": "none found" if facts["no_return"] is None else f"{facts['no_return']:g} m",
            "returns": f"{facts['returns']:.1%} of the beams" if facts["scans"] else "none",
            "logged poses": f"{facts['logged_poses']} (never used for matching)",
            "problems": len(facts["problems"]) or "none",
        }
    )
    for problem in facts["problems"]:
        typer.echo(f"  {problem['unit']} {problem['line']}: {problem['reason']}")


def _facts(log: LaserLog) -> dict[str, Any]:
    beams = sum(len(scan) for scan in log)
    seen = sum(int(np.isfinite(scan.ranges).sum()) for scan in log)
    return {
        "log": log.name,
        "format": log.format,
        "topic": log.topic,
        "scans": len(log),
        "lasers": [{**dict(laser), "scans": count} for laser, count in Counter(map(_laser, log)).most_common()],
        "no_return": log.no_return,
        "returns": seen / beams if beams else 0.0,
        "logged_poses": sum(scan.logged_pose is not None for scan in log),
        "problems": [asdict(problem) for problem in log.problems],
    }


def _laser(scan: LaserScan) -> tuple[tuple[str, float], ...]:
    """What tells the lasers of a log apart."""
    last = scan.first_angle + scan.angle_step * max(len(scan) - 1, 0)
    degrees = {"first_angle_deg": scan.first_angle, "last_angle_deg": last, "angle_step_deg": scan.angle_step}
    return ("beams", len(scan)), *((name, round(math.degrees(angle), 6)) for name, angle in degrees.items())


def segments(
    log: Log,
    scan: Annotated[int, typer.Option(metavar="I", help="Index of the scan, from 0.", show_default=False)],
    as_json: Json = False,
    preset: Preset = None,
    settings: Setting = None,
) -> None:
    """Print the line segments of a scan, in beam order, metres, in the sensor's frame."""
    laser_log = read(log)
    found = extract(laser_log.scan(scan), parameters_of(preset, settings), index=scan)
    rows = found.coordinates.tolist()
    if as_json:
        print_json({"log": laser_log.name, "scan": scan, "segments": rows})
        return
    table = [(i, *(f"{number:.3f}" for number in (*row, found.lengths[i]))) for i, row in enumerate(rows)]
    typer.echo(f"{laser_log.name}, scan {scan}: {len(rows)} segments, {found.lengths.sum():.2f} m")
    print_table(("segment", "x1 [m]", "y1 [m]", "x2 [m]", "y2 [m]", "length [m]"), table)
