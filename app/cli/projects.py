"""``serve``, ``export``, ``report`` and ``replay`` projects; write the ``sample`` logs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from app.cli import walking
from app.cli.options import one_of
from app.inputs import Inputs
from app.matching import Settings, recall
from app.merged import exportable, merge_project
from app.posegraph import Solver, graph_of
from app.reporting import Reporter
from segmap.errors import ExportError
from segmap.export import FORMATS, RESOLUTION, ExportFormat, format_of, write_files
from segmap.export.files import check_place
from segmap.simulate import write_samples
from segmap.store import Store

__all__ = ["export", "replay", "report", "sample", "serve"]

WALKTHROUGH = "walkthrough"
Project = Annotated[Path, typer.Argument(metavar="PROJECT", help="A project file, .segmap.", show_default=False)]


def serve(
    files: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[FILES]...", help="Logs that become one project, or a project.", show_default=False),
    ] = None,
    host: Annotated[
        str,
        typer.Option(
            help="Address to listen at. Any but this computer's own asks for a token: it is in the link that is"
            " printed (SEGMAP_TOKEN gives one that stays the same)."
        ),
    ] = "127.0.0.1",
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port; default: 8000, or the next one that is free.")
    ] = None,
    workspace: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the projects; default: yours on this computer.")
    ] = None,
    browser: Annotated[
        bool | None, typer.Option("--browser/--no-browser", help="Open a browser; default: on a terminal.")
    ] = None,
) -> None:
    """Open the workbench: one address, until Ctrl+C. Everything decided is kept, and there again next time."""
    from app.server import serve as run  # the server's libraries take a second that no other command needs

    run(files or (), host, port, workspace, sys.stdout.isatty() if browser is None else browser)


def export(
    project: Project,
    to: Annotated[str, typer.Option(metavar=one_of((*FORMATS, WALKTHROUGH)), help="The format.", show_default=False)],
    out: Annotated[Path, typer.Option(metavar="PATH", help="The file to write.", show_default=False)],
    resolution: Annotated[
        float, typer.Option(metavar="METRES", help="The side of a cell, for formats that are made of cells.")
    ] = RESOLUTION,
) -> None:
    """Write the map of a project: what is accepted in it, and nothing else.

    Where a format takes several files, the others are put beside the one that is named. A walkthrough shows step by
    step how its first pair was integrated, and its pose graph; "segmap walkthrough" makes one of any pair.
    """
    if to == WALKTHROUGH:
        walking.of_project(project, out)
        return
    if to not in FORMATS:
        raise ExportError(f"There is no format {to!r}. Formats are: {', '.join((*FORMATS, WALKTHROUGH))}.")
    _write(project, out, format_of(to), resolution)


def report(
    project: Project,
    out: Annotated[Path, typer.Option(metavar="PATH", help="The file to write.", show_default=False)],
) -> None:
    """Write the report of a project as one HTML file: how far to trust its map, and on what evidence.

    It opens offline, in any browser, and can be printed.
    """
    _write(project, out, format_of("report"))


def _write(project: Path, out: Path, kind: ExportFormat, resolution: float = RESOLUTION) -> None:
    check_place(out)
    with Store.open(project) as store:
        state, solve = store.state, Solver()
        inputs = Inputs(store, state.logs, store.log_bytes)
        merged = merge_project(state, inputs.segment_map, solve=solve)
        record = None
        if kind.needs_record:
            found = recall(store, Settings(state.parameters, state.mode))
            reporter = Reporter(inputs.segment_map, found, inputs.facts)
            record = reporter.record(state, graph_of(state, solve), inputs.scan_ids)
        content = exportable(state, merged, lambda scan: inputs.scan(scan).time, out.stem, resolution, record)
        for path in write_files(content, out, kind.name):
            typer.echo(path)


def replay(project: Project) -> None:
    """Rebuild the map of a project from its logs and decisions, and print the map's hash."""
    with Store.open(project) as store:
        inputs = Inputs(store, store.state.logs, store.log_bytes)
        typer.echo(merge_project(store.state, inputs.segment_map).hash)


def sample(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where to; made where missing.", show_default=False)],
) -> None:
    """Write the sample logs, with the truth beside them: the same files each time, byte for byte."""
    for path in write_samples(folder):
        typer.echo(path)
