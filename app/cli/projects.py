"""``serve``, ``export`` and ``replay`` projects; write the ``sample`` logs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from app.cli.options import one_of
from app.inputs import Inputs
from app.merged import Merged, export_project, merge_project
from segmap.export import FORMATS
from segmap.export.files import write_whole
from segmap.project import ProjectState
from segmap.simulate import write_samples
from segmap.store import Store

__all__ = ["export", "replay", "sample", "serve"]

Project = Annotated[Path, typer.Argument(metavar="PROJECT", help="A project file, .segmap.", show_default=False)]


def serve(
    files: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[FILES]...", help="Logs that become one project, or a project.", show_default=False),
    ] = None,
    host: Annotated[str, typer.Option(help="Address to listen at.")] = "127.0.0.1",
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
    to: Annotated[str, typer.Option(metavar=one_of(FORMATS), help="The format.", show_default=False)],
    out: Annotated[Path, typer.Option(metavar="PATH", help="The file to write.", show_default=False)],
) -> None:
    """Write the map of a project: what is accepted in it, and nothing else."""
    state, merged = _rebuilt(project)
    write_whole(out, export_project(state, merged, to))


def replay(project: Project) -> None:
    """Rebuild the map of a project from its logs and decisions, and print the map's hash."""
    typer.echo(_rebuilt(project)[1].hash)


def _rebuilt(project: Path) -> tuple[ProjectState, Merged]:
    with Store.open(project) as store:
        state = store.state
        inputs = Inputs(store, state.logs, store.log_bytes)
        return state, merge_project(state, inputs.segment_map)


def sample(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where to; made where missing.", show_default=False)],
) -> None:
    """Write the sample logs, with the truth beside them: the same files each time, byte for byte."""
    for path in write_samples(folder):
        typer.echo(path)
