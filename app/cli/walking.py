"""``walkthrough``: an integration step by step, as a file for a lecture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.cli.options import DEFAULT_MODE, Heuristic, Log, Mode, Preset, Setting, method_of, read
from app.errors import RequestError
from app.walk_files import KINDS, MOST_FRAMES, walk_file
from segmap.walkthrough import walk_scans

__all__ = ["walkthrough"]


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
    stage: Annotated[
        str, typer.Option(metavar="ID", help="Pictures of this stage only, such as evaluation or polylines.")
    ] = "",
    pictures: Annotated[int, typer.Option(min=1, max=1000, help="Most pictures of a series or an animation.")] = (
        MOST_FRAMES
    ),
) -> None:
    """Record how scan J is integrated with scan I, step by step, as a file to show.

    Every step is there: points to segments, angles, candidates and their values, lines of sight, chains, polylines,
    the verdict; where there are very many of a kind, some of them.
    """
    kind = out.suffix.lower().removeprefix(".")
    if kind not in KINDS:
        raise RequestError(f"{out.name}: a walkthrough is written as .{', .'.join(KINDS)}. Choose one of these.")
    method = method_of(mode, heuristic, preset, settings)
    held = read(log)
    title = f"{held.name}: scans {first} and {second}"
    made = walk_scans(
        held.scan(first), held.scan(second), method.parameters, method.heuristic, method.mode, title=title
    )
    file = walk_file(made.walk, kind, stage, pictures)
    out.write_bytes(file.content)
    typer.echo(f"{out}: {len(made.walk.stages)} stages, {len(file.content) / 1e6:.1f} MB")
