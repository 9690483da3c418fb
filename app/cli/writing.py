"""What the commands leave on disk: maps, trajectories, projects."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from io import BufferedReader
from pathlib import Path

import typer

from app.cli.options import Method
from app.inputs import facts_of, remember
from app.posegraph import edge
from app.resources import program_version
from segmap.errors import LogError
from segmap.events import Choice, Covariance, Decide, IntegrationId, fingerprint
from segmap.export import Content, by_suffix, write_files
from segmap.export.files import check_place
from segmap.export.tum import left_out
from segmap.graph import Edge
from segmap.integration import Match
from segmap.links import covariance_of
from segmap.parameters import Parameters
from segmap.scans import LaserLog, ScanId
from segmap.store import Store

__all__ = ["check_places", "described", "edges_between", "listed", "new_project", "times_of", "write_trajectory"]

COMMAND = "segmap merge"
"""who decided, in the history of a project"""


def check_places(out: Sequence[Path], *others: Path | None) -> None:
    """Say before the work what could not be written after it: maps, whose suffix says the format, and other files.

    Raises:
        ExportError: a suffix says no format, or a file cannot be where it should.
    """
    for path in out:
        by_suffix(path)
    for place in (*out, *others):
        if place is not None:
            check_place(place)


def described(title: str, hash: str) -> dict[str, str]:
    """What a map's file says of itself."""
    return {"title": title, "version": program_version(), "map_hash": hash}


def listed(scans: Iterable[ScanId]) -> str:
    """Scans, for people."""
    return ", ".join(map(str, scans))


def write_trajectory(path: Path, content: Content) -> None:
    """The poses of the largest component; the scans of the others have other frames, and are listed."""
    for remark in left_out(content.components):
        typer.echo(f"segmap: {path.name}: {remark}", err=True)
    write_files(content, path, "tum")


def times_of(logs: Sequence[LaserLog]) -> dict[ScanId, float | None]:
    """When each scan of some logs was taken, seconds."""
    return {ScanId(number, i): scan.time for number, log in enumerate(logs) for i, scan in enumerate(log)}


def edges_between(accepted: Mapping[IntegrationId, Match]) -> list[Edge]:
    """Accepted integrations as edges of a pose graph."""
    return [edge(str(pair), match.T_1_2, _covariance(match)) for pair, match in accepted.items() if match.T_1_2]


def _covariance(match: Match) -> Covariance | None:
    known = match.best is not None and match.best.uncertainty is not None
    return covariance_of(match.best) if known and match.best is not None else None


def new_project(
    path: Path,
    name: str,
    logs: Sequence[tuple[Path, LaserLog]],
    by: Method,
    accepted: Mapping[IntegrationId, Match],
) -> None:
    """A project of some logs in which these integrations are accepted, and everything else is for a person."""
    with Store.create(path, name, by.parameters, by.heuristic, by.mode, who=COMMAND) as store:
        for path, log in logs:
            with _opened(path) as file:
                info = store.add_log(log.name, file, scans=len(log), format=log.format, topic=log.topic, who=COMMAND)
            remember(store, info, facts_of(log))
        choices = tuple(_choice(integration, match, by.parameters) for integration, match in accepted.items())
        if choices:
            store.append(Decide(choices=choices, who=COMMAND, reason="accepted without asking"))


def _opened(path: Path) -> BufferedReader:
    try:
        return path.open("rb")
    except OSError as error:
        raise LogError(f"{path} cannot be read: {(error.strerror or str(error)).lower()}.") from None


def _choice(integration: IntegrationId, match: Match, parameters: Parameters) -> Choice:
    return Choice(
        integration=str(integration),
        verdict="accepted",
        parameters=fingerprint(parameters),
        T_1_2=match.T_1_2,
        value=match.value,
        heuristic=match.heuristic,
        mode=match.mode,
        candidate=0,
        covariance=_covariance(match),
    )
