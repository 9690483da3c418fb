"""The ``segmap`` command: the library for scripts, and the door to the workbench.

Results go to standard output, progress and messages to standard error. The exit status is 0, or 2
for bad usage or input; whatever segmap raises on purpose is one line, never a traceback.
"""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Callable, Sequence
from typing import Annotated

import typer

from app.cli import (
    benchmarking,
    evaluating,
    inspecting,
    integrating,
    mapping,
    merging,
    projects,
    public_data,
    searching,
    walking,
)
from app.resources import program_version
from segmap.errors import SegmapError

__all__ = ["cli", "main"]

BAD_INPUT = 2
INTERRUPTED = 130

cli = typer.Typer(
    name="segmap",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)


def _add(command: Callable[..., None], name: str | None = None) -> None:
    """A command with its docstring as help: lines of a paragraph flow, however wide the terminal is."""
    paragraphs = (inspect.getdoc(command) or "").split("\n\n")
    cli.command(name, help="\n\n".join(" ".join(one.split()) for one in paragraphs))(command)


_add(projects.serve)
_add(inspecting.info)
_add(inspecting.segments)
_add(integrating.integrate)
_add(merging.merge)
_add(mapping.map_logs, "map")
_add(projects.export)
_add(projects.report)
_add(projects.replay)
_add(searching.loops)
cli.add_typer(public_data.datasets)
cli.add_typer(benchmarking.benchmark)
_add(evaluating.evaluate)
_add(walking.walkthrough)
_add(projects.sample)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"segmap {program_version()}")
        raise typer.Exit


@cli.callback()
def about(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    """Turn 2D laser scans into one validated line-segment map, with no knowledge of where they were taken.

    [bold]segmap serve LOG[/bold] opens the workbench in the browser; the other commands do the same work for scripts.
    """


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command; exits with its status."""
    try:
        cli(args=None if arguments is None else list(arguments), prog_name="segmap")
    except SegmapError as error:
        _stop(str(error))
    except BrokenPipeError:  # whoever read our output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except OSError as error:
        _stop(f"{error.filename or 'The system'}: {(error.strerror or str(error)).lower()}.")
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


def _stop(message: str) -> None:
    print(f"segmap: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(BAD_INPUT)
