"""Files that come in -> a project file."""

from __future__ import annotations

import hashlib
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

__all__ = ["Filled", "Read", "Source", "copy_project", "fill", "is_project", "new_project", "put_in", "read_sources"]

SQLITE = b"SQLite format 3\0"
START = 1 << 16
"""bytes to tell what a file is by"""


@dataclass(frozen=True)
class Source:
    """A file as it came: its name, which is only ever shown, and its bytes, to be read from the start."""

    name: str
    file: BinaryIO


@dataclass(frozen=True)
class Read:
    """Logs with the files they came from, and a sentence for each file that could not be read."""

    logs: tuple[tuple[Source, LaserLog], ...]
    failures: tuple[str, ...]


@dataclass
class Filled:
    """What went into a project: the logs as read, and what was left out of them."""

    logs: dict[int, LaserLog] = field(default_factory=dict)
    problems: tuple[str, ...] = ()


def is_project(file: BinaryIO) -> bool:
    """Whether a file is a database, as projects are, and no bag; found by content, not by name."""
    start = file.read(START)
    file.seek(0)
    return start.startswith(SQLITE) and not ROS_2_BAG.recognises(start)


def new_project(path: Path, title: str) -> None:
    """A new project file at ``path``, without logs."""
    _created(path, title).close()


def fill(path: Path, title: str, sources: Sequence[Source], limits: Limits | None = None) -> Filled:
    """A new project file at ``path`` with all logs that can be read; a bag gives a log for each laser topic.

    Raises:
        LogError: none can be.
    """
    read = read_sources(sources, limits)
    if not read.logs:
        raise LogError(" ".join(read.failures))
    with _created(path, title) as store:
        return _put(store, read)


def _created(path: Path, title: str) -> Store:
    return Store.create(path, title, preset(DEFAULT_PRESET[MODE]), DEFAULT_HEURISTIC[MODE], MODE)


def put_in(store: Store, read: Read, who: str = "") -> Filled:
    """Put more logs into a project; those that are in it already are left out.

    Raises:
        LogError: nothing is left.
    """
    held = {(log.sha256, log.topic) for log in store.state.logs}
    new = [(source, log) for source, log in read.logs if (_digest(source), log.topic) not in held]
    names = sorted({log.name for _, log in read.logs} - {log.name for _, log in new})
    failures = (*read.failures, *(f"{name} is in this project already: it was left out." for name in names))
    if not new:
        raise LogError(" ".join(failures))
    return _put(store, Read(tuple(new), failures), who)


def _digest(source: Source) -> str:
    source.file.seek(0)
    return hashlib.file_digest(source.file, "sha256").hexdigest()  # type: ignore[arg-type]  # it is a real file


def _put(store: Store, read: Read, who: str = "") -> Filled:
    filled = Filled(problems=read.failures)
    for source, log in read.logs:
        source.file.seek(0)
        info = store.add_log(log.name, source.file, scans=len(log), format=log.format, topic=log.topic, who=who)
        remember(store, info, facts_of(log))
        filled.logs[info.index] = log
        filled.problems += tuple(f"{log.name}, {problem}" for problem in log.problems)
    return filled


def read_sources(sources: Sequence[Source], limits: Limits | None = None) -> Read:
    """All logs that can be read, and for the others why they cannot."""
    logs: list[tuple[Source, LaserLog]] = []
    failures = []
    for source in sources:
        source.file.seek(0)
        try:
            logs += [(source, log) for log in read_logs(source.file, base_name(source.name), limits)]
        except LogError as error:
            failures.append(str(error))
    return Read(tuple(logs), tuple(failures))


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
