"""Files that come in -> a project file."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from app.inputs import facts_of, remember
from app.modes import NEW_PROJECTS as MODE
from segmap.errors import LogError
from segmap.integration import DEFAULT_HEURISTIC, DEFAULT_PRESET, chosen_heuristic
from segmap.logs import ROS_2_BAG, Limits, base_name, read_logs
from segmap.parameters import preset
from segmap.project import ProjectState
from segmap.scans import LaserLog
from segmap.store import Store

__all__ = ["Filled", "Source", "copy_project", "fill", "is_project"]

SQLITE = b"SQLite format 3\0"
START = 1 << 16
"""bytes to tell what a file is by"""


@dataclass(frozen=True)
class Source:
    """A file as it came: its name, which is only ever shown, and its bytes, to be read from the start."""

    name: str
    file: BinaryIO


@dataclass
class Filled:
    """What went into a new project: the logs as read, and what was left out of them."""

    logs: dict[int, LaserLog] = field(default_factory=dict)
    problems: tuple[str, ...] = ()


def is_project(file: BinaryIO) -> bool:
    """Whether a file is a database, as projects are, and no bag; found by content, not by name."""
    start = file.read(START)
    file.seek(0)
    return start.startswith(SQLITE) and not ROS_2_BAG.recognises(start)


def fill(path: Path, title: str, sources: Sequence[Source], limits: Limits | None = None) -> Filled:
    """A new project file at ``path`` with all logs that can be read; a bag gives a log for each laser topic.

    Raises:
        LogError: none can be.
    """
    logs, failures = _read(sources, limits)
    if not logs:
        raise LogError(" ".join(failures))
    filled = Filled(problems=tuple(failures))
    with Store.create(path, title, preset(DEFAULT_PRESET[MODE]), DEFAULT_HEURISTIC[MODE], MODE) as store:
        for source, log in logs:
            source.file.seek(0)
            info = store.add_log(log.name, source.file, scans=len(log), format=log.format, topic=log.topic)
            remember(store, info, facts_of(log))
            filled.logs[info.index] = log
            filled.problems += tuple(f"{log.name}, {problem}" for problem in log.problems)
    return filled


def _read(sources: Sequence[Source], limits: Limits | None) -> tuple[list[tuple[Source, LaserLog]], list[str]]:
    logs: list[tuple[Source, LaserLog]] = []
    failures = []
    for source in sources:
        source.file.seek(0)
        try:
            logs += [(source, log) for log in read_logs(source.file, base_name(source.name), limits)]
        except LogError as error:
            failures.append(str(error))
    return logs, failures


def copy_project(file: BinaryIO, path: Path) -> ProjectState:
    """A project file that came in, checked, as a new file at ``path``.

    Raises:
        ProjectError: it is not a project, is damaged, or is from a newer version.
        ParameterError: it is in a mode that does not exist, or by a heuristic the mode does not have.
    """
    with path.open("xb") as target:
        shutil.copyfileobj(file, target)
    with Store.open(path) as store:
        chosen_heuristic(store.state.mode, store.state.heuristic)
        return store.state
