"""Arguments and options that several commands share; what can be chosen is read from the library's tables."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from segmap.candidates import HEURISTICS
from segmap.errors import ParameterError
from segmap.integration import MODES
from segmap.logs import read_log
from segmap.parameters import PRESETS, Parameters, preset
from segmap.scans import LaserLog

__all__ = [
    "DEFAULT_HEURISTIC",
    "DEFAULT_MODE",
    "Heuristic",
    "Json",
    "Log",
    "Mode",
    "Preset",
    "Setting",
    "one_of",
    "parameters_of",
    "read",
]


def one_of(names: Iterable[str]) -> str:
    """What stands for a choice in a command's help; the library says no to anything else."""
    return "|".join(names)


DEFAULT_MODE = MODES[-1]
DEFAULT_HEURISTIC = HEURISTICS[0]

Log: TypeAlias = Annotated[
    Path, typer.Argument(metavar="LOG", help="A laser log, plain or gzipped.", show_default=False)
]
Json: TypeAlias = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]
Mode: TypeAlias = Annotated[str, typer.Option(metavar=one_of(MODES), help="How the best candidate is chosen.")]
Heuristic: TypeAlias = Annotated[
    str, typer.Option(metavar=one_of(HEURISTICS), help="Which angles give candidate transformations.")
]
Preset: TypeAlias = Annotated[str, typer.Option(metavar=one_of(PRESETS), help="The parameters to start from.")]
Setting: TypeAlias = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="Change a parameter; can be given several times."),
]


def parameters_of(preset_name: str, settings: list[str] | None) -> Parameters:
    """A preset with the changes of ``--set``.

    Raises:
        ParameterError: a change is not NAME=VALUE, or cannot be made.
    """
    changes = [_assignment(text) for text in settings or []]
    return preset(preset_name).with_text(dict(changes))


def _assignment(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise ParameterError(f"--set {text} has no value: write --set NAME=VALUE.")
    return name.strip(), value.strip()


def read(path: Path) -> LaserLog:
    """A log; what could not be read of it is said on standard error."""
    log = read_log(path)
    for problem in log.problems:
        typer.echo(f"segmap: {log.name}: {problem}", err=True)
    return log
