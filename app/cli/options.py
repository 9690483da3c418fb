"""Arguments and options that several commands share; what can be chosen is read from the library's tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from segmap.errors import ParameterError
from segmap.integration import DEFAULT_HEURISTIC, DEFAULT_PRESET, MODES, chosen_heuristic, heuristics
from segmap.logs import ANY_SIZE, bag_in, holds_maps, read_log, read_logs, read_maps
from segmap.parameters import PRESETS, Parameters, preset
from segmap.pose import Pose2
from segmap.priors import PosePrior
from segmap.scans import LaserLog
from segmap.segments import SegmentMap, extract

__all__ = [
    "DEFAULT_MODE",
    "Dask",
    "Explain",
    "Heuristic",
    "Json",
    "Log",
    "Logs",
    "Method",
    "Mode",
    "Out",
    "Preset",
    "Prior",
    "PriorDeviations",
    "Setting",
    "Trajectory",
    "Workers",
    "method_of",
    "one_of",
    "open_log",
    "parameters_of",
    "prior_of",
    "read",
    "read_all",
    "segment_maps",
    "topic_of",
]


def one_of(names: Iterable[str]) -> str:
    """What stands for a choice in a command's help; the library says no to anything else."""
    return "|".join(names)


Logs = Annotated[
    list[Path],
    typer.Argument(metavar="LOGS...", help="Laser logs, each in the order it was driven.", show_default=False),
]
Out = Annotated[
    list[Path] | None,
    typer.Option(metavar="FILE.EXT", help="Write the map, in the format the suffix says; can be given several times."),
]
Trajectory = Annotated[
    Path | None, typer.Option(metavar="FILE.tum", help="Write the poses of the scans of the largest component.")
]


DEFAULT_MODE = "verified"
PLAIN_PRESET = "default"
"""where there is no mode"""


def _by_mode(defaults: Mapping[str, str]) -> str:
    """Defaults in words.

    >>> _by_mode({"paper": "all"})
    'all in paper mode'
    """
    return ", ".join(f"{name} in {mode} mode" for mode, name in defaults.items())


Log: TypeAlias = Annotated[
    Path, typer.Argument(metavar="LOG", help="A laser log, plain or gzipped; of a bag, FILE#TOPIC.", show_default=False)
]
Json: TypeAlias = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]
Explain: TypeAlias = Annotated[
    bool, typer.Option("--explain", help="Say what every pair of segments and line of sight adds or takes.")
]
Mode: TypeAlias = Annotated[
    str, typer.Option(metavar=one_of(MODES), help="As the paper has it, or with evidence beyond the paper.")
]
Heuristic: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar=one_of(heuristics(DEFAULT_MODE)),
        help=f"Which candidates are tried; default: {_by_mode(DEFAULT_HEURISTIC)}.",
    ),
]
Preset: TypeAlias = Annotated[
    str | None,
    typer.Option(metavar=one_of(PRESETS), help=f"The parameters to start from; default: {_by_mode(DEFAULT_PRESET)}."),
]
Prior: TypeAlias = Annotated[
    str | None,
    typer.Option(metavar="X,Y,DEGREES", help="Where the second scan is expected in the frame of the first."),
]
PriorDeviations: TypeAlias = Annotated[
    str | None,
    typer.Option("--prior-std", metavar="X,Y,DEGREES", help="How surely: standard deviations, metres and degrees."),
]
Setting: TypeAlias = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="Change a parameter; can be given several times."),
]


Workers: TypeAlias = Annotated[int, typer.Option(min=1, max=256, help="Processes that match scans.")]
Dask: TypeAlias = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Match on the Dask cluster of this scheduler, such as tcp://host:8786."),
]


@dataclass(frozen=True)
class Method:
    """How pairs are integrated: everything a result depends on beside the scans."""

    parameters: Parameters
    heuristic: str
    mode: str


def method_of(mode: str, heuristic: str | None, preset_name: str | None, settings: list[str] | None) -> Method:
    """The method that options describe; heuristic and preset are the mode's own unless others are asked for.

    Raises:
        ParameterError: there is no such mode, heuristic, preset or parameter, or a value is impossible.
    """
    chosen = chosen_heuristic(mode, heuristic)
    return Method(parameters_of(preset_name or DEFAULT_PRESET[mode], settings), chosen, mode)


def prior_of(mean: str | None, deviations: str | None) -> PosePrior | None:
    """The prior of ``--prior`` and ``--prior-std``; None without them.

    Raises:
        ParameterError: one of them is missing, or is not three numbers that make sense.
    """
    if mean is None and deviations is None:
        return None
    if mean is None or deviations is None:
        raise ParameterError("--prior and --prior-std go together: where a scan is expected, and how surely.")
    x, y, degrees = _three("--prior", mean)
    return PosePrior.with_deviations(Pose2(x, y, math.radians(degrees)), *_deviations(deviations))


def _deviations(text: str) -> tuple[float, float, float]:
    x, y, degrees = _three("--prior-std", text)
    return x, y, math.radians(degrees)


def _three(option: str, text: str) -> tuple[float, float, float]:
    try:
        x, y, degrees = (float(part) for part in text.split(","))
    except ValueError:
        raise ParameterError(f"{option} {text[:80]} is not three numbers: write {option} X,Y,DEGREES.") from None
    return x, y, degrees


def parameters_of(preset_name: str | None, settings: list[str] | None) -> Parameters:
    """A preset with the changes of ``--set``.

    Raises:
        ParameterError: a change is not NAME=VALUE, or cannot be made.
    """
    changes = [_assignment(text) for text in settings or []]
    return preset(preset_name or PLAIN_PRESET).with_text(dict(changes))


def _assignment(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise ParameterError(f"--set {text} has no value: write --set NAME=VALUE.")
    return name.strip(), value.strip()


def read(path: Path) -> LaserLog:
    """A log; what could not be read of it is said on standard error."""
    return _told(open_log(path))


def read_all(path: Path) -> list[LaserLog]:
    """All logs of a file, one for each laser topic of a bag, unless the path names a topic."""
    if topic_of(path)[1] is not None:
        return [read(path)]
    return [_told(log) for log in read_logs(path, limits=ANY_SIZE)]


def segment_maps(path: Path, parameters: Parameters) -> tuple[str, Callable[[int], SegmentMap]]:
    """The name of a log or of a file of segment maps, and its maps by index: of scans, or as the file holds them."""
    if holds_maps(topic_of(path)[0]):
        maps = read_maps(path)
        for problem in maps.problems:
            typer.echo(f"segmap: {maps.name}: {problem}", err=True)
        return maps.name, lambda index: maps.part(index).map
    log = read(path)
    return log.name, lambda index: extract(log.scan(index), parameters, index=index)


def open_log(path: Path) -> LaserLog:
    """A log of any size, as it is; ``FILE#TOPIC`` is that topic of a bag."""
    file, topic = topic_of(path)
    return read_log(file, limits=ANY_SIZE, topic=topic)


def topic_of(path: Path) -> tuple[Path, str | None]:
    """The file and the topic that ``FILE#TOPIC`` names; a path that exists names no topic, a folder the bag in it.

    >>> topic_of(Path("run.bag#/front/scan"))[1]
    '/front/scan'
    """
    file, mark, topic = path.as_posix().partition("#")
    return (bag_in(path), None) if not mark or path.exists() else (bag_in(Path(file)), topic)


def _told(log: LaserLog) -> LaserLog:
    for problem in log.problems:
        typer.echo(f"segmap: {log.name}: {problem}", err=True)
    return log
