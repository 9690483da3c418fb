"""What the commands print: one JSON document, or tables for people; progress on standard error."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from segmap.pose import Pose2

__all__ = ["pose_json", "print_facts", "print_json", "print_table", "progress", "remark", "show_pose"]


def print_json(document: Mapping[str, Any]) -> None:
    """One document on standard output."""
    typer.echo(json.dumps(document, allow_nan=False))


def print_facts(facts: Mapping[str, object]) -> None:
    """Names and values, one a line."""
    width = max(map(len, facts))
    for name, value in facts.items():
        typer.echo(f"{name:<{width}}  {value}")


def print_table(header: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """A table; the first column to the left, the others to the right."""
    lines = [[str(cell) for cell in row] for row in (header, *rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for first, *others in lines:
        cells = (cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True))
        typer.echo("  ".join((first.ljust(widths[0]), *cells)))


def show_pose(pose: Pose2 | None) -> str:
    """A pose for people.

    >>> show_pose(Pose2(1.0, -0.25, 0.5))
    'x 1.000 m, y -0.250 m, theta 28.65 deg'
    """
    if pose is None:
        return "none"
    return f"x {pose.x:.3f} m, y {pose.y:.3f} m, theta {math.degrees(pose.theta):.2f} deg"


def pose_json(pose: Pose2 | None) -> dict[str, float] | None:
    """A pose for programs."""
    return None if pose is None else {"x": pose.x, "y": pose.y, "theta": pose.theta}


def remark(said: str) -> None:
    """Say something on standard error, where a person sits there."""
    if sys.stderr.isatty():
        typer.echo(f"segmap: {said}", err=True)


@contextmanager
def progress(what: str) -> Iterator[Callable[[int, int], None]]:
    """A bar on standard error while something long is done: call with how much is done, and of how much."""
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
