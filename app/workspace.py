"""The folder of projects. Their ids are made here and looked up here; no id, and no name of a file, is ever a path."""

from __future__ import annotations

import hashlib
import re
import secrets
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path

from platformdirs import user_data_path

from app.creation import Source, copy_project, fill, is_project, new_project
from app.errors import RequestError, UnknownError
from app.jobs import WarmUp
from app.samples import Samples
from app.session import PICTURE, Session
from app.trash import Trash
from segmap.errors import ProjectError, SegmapError
from segmap.events import Rename
from segmap.logs import ANY_SIZE, Limits, bag_in, base_name
from segmap.project import ProjectState
from segmap.scans import LaserLog
from segmap.store import Store

__all__ = ["Created", "Summary", "Workspace", "default_folder"]

SUFFIX = ".segmap"
IDLE_SECONDS = 300.0
"""after which a project that nobody looks at is closed; it is opened again when somebody does"""
ID = re.compile(r"[a-z0-9][a-z0-9-]{0,63}")


def default_folder() -> Path:
    """Where projects are kept unless another folder is given."""
    return user_data_path("segmap") / "projects"


@dataclass(frozen=True)
class Created:
    """A new project, and what was left out of its logs."""

    id: str
    name: str
    problems: tuple[str, ...] = ()


@dataclass(frozen=True)
class Summary:
    """A project in the list: its state, or why it cannot be read."""

    id: str
    path: Path
    state: ProjectState | None
    problem: str = ""
    picture: str = ""
    """a small SVG of the merged map; empty where there is none"""


class Workspace:
    """All projects of a folder, and those opened where they lie; sessions are opened when first needed."""

    def __init__(
        self,
        folder: Path | None = None,
        *,
        samples: Samples | None = None,
        warm_up: WarmUp | None = None,
        open_session: Callable[..., Session] = Session,
    ) -> None:
        self._folder = (folder or default_folder()).absolute()
        self.samples = samples or Samples()
        self._warm_up, self._new_session = warm_up, open_session
        self._lock = threading.RLock()
        self._sessions: dict[str, Session] = {}
        self._used: dict[str, float] = {}
        self._elsewhere: dict[str, Path] = {}
        self._closed: dict[str, Path] = {}
        self._trash = Trash(self._folder, SUFFIX)
        self._read: dict[Path, tuple[tuple[int, ...], Summary]] = {}
        self._known_logs: dict[str, dict[int, LaserLog]] = {}

    @property
    def folder(self) -> Path:
        """Where new projects are put."""
        return self._folder

    # --- looking ----------------------------------------------------------------------------------

    def summaries(self) -> list[Summary]:
        """All projects, the one changed last first; nothing is opened for it."""
        found = [self.summary(id) for id in self._ids()]
        return sorted(found, key=lambda s: s.state.modified if s.state else "", reverse=True)

    def summary(self, id: str) -> Summary:
        """A project in short. Raises UnknownError where there is none."""
        path = self.check(id)
        session = self._sessions.get(id)
        if session is not None:
            return Summary(id, path, session.state, picture=session.picture)
        stamp = _stamp(path)
        held = self._read.get(path)
        if held is None or held[0] != stamp:
            held = self._read[path] = stamp, _summary(id, path)
        return held[1]

    def check(self, id: str) -> Path:
        """The file of a project.

        Raises:
            UnknownError: there is no such project.
        """
        path = self._elsewhere.get(id) or self._folder / f"{id}{SUFFIX}"
        if not ID.fullmatch(id) or not path.is_file():
            raise UnknownError(f"There is no project {id[:80]!r} here: it may have been moved or deleted.")
        return path

    def _ids(self) -> list[str]:
        inside = (path.stem for path in self._folder.glob(f"*{SUFFIX}") if ID.fullmatch(path.stem))
        return sorted({*inside, *(id for id, path in self._elsewhere.items() if path.is_file())})

    # --- sessions ---------------------------------------------------------------------------------

    def session(self, id: str) -> Session:
        """The open session of a project; it is opened now if need be.

        Raises:
            UnknownError: there is no such project.
            ProjectError: its file cannot be read.
        """
        self._used[id] = time.monotonic()
        session = self._sessions.get(id)
        if session is not None:
            return session
        with self._lock:
            if id not in self._sessions:
                store = Store.open(self.check(id))
                try:
                    known = self._known_logs.pop(id, {})
                    self._sessions[id] = self._new_session(id, store, known_logs=known, warm_up=self._warm_up)
                except BaseException:
                    store.close()
                    raise
            return self._sessions[id]

    def open_session(self, id: str) -> Session | None:
        """The session of a project where it is open."""
        return self._sessions.get(id)

    def tend(self, idle_seconds: float = IDLE_SECONDS) -> None:
        """Take over what other programs wrote into open projects; close those nobody has looked at for a while."""
        for id, session in list(self._sessions.items()):
            with suppress(SegmapError):
                session.catch_up()
            if time.monotonic() - self._used[id] > idle_seconds and session.idle:
                with self._lock:
                    self._sessions.pop(id, None)
                session.close()

    def backup(self, id: str, target: Path) -> ProjectState:
        """Write a project into one new file, as it is now; work on it goes on. Returns the state written."""
        with Store.open(self.check(id)) as store:
            store.backup(target)
            return store.state

    def close(self) -> None:
        """Close all sessions."""
        with self._lock:
            while self._sessions:
                self._sessions.popitem()[1].close()

    # --- making -----------------------------------------------------------------------------------

    def create(self, sources: Sequence[Source], limits: Limits | None = None) -> Created:
        """A project of some logs, or of one project file, which is checked and copied.

        A file that cannot be read is left out and told of, as long as one can be read.

        Raises:
            SegmapError: nothing can be made of the files; the message says why.
        """
        if not sources:
            raise RequestError("No file came with the request: choose at least one log.")
        projects = [source for source in sources if is_project(source.file)]
        if projects and len(sources) > 1:
            raise RequestError(f"{base_name(projects[0].name)} is a project: open it alone, without other files.")
        return self._take_in(projects[0]) if projects else self._make(_title(sources), sources, limits)

    def create_sample(self, name: str) -> Created:
        """A project of a sample. Raises UnknownError where there is no such sample."""
        sample = self.samples.get(name)
        with self.samples.opened(sample) as sources:
            return self._make(sample.title, sources)

    def create_empty(self, name: str) -> Created:
        """A project without logs, to be filled later."""
        with self._new_file(name) as (id, path):
            new_project(path, name)
        return Created(id, name)

    def open_files(self, paths: Iterable[Path]) -> str:
        """The id of the project of some files given on the command line.

        A project is opened where it lies; logs that have been opened before reopen their project.

        Raises:
            SegmapError: a file cannot be read.
        """
        paths = [bag_in(Path(path)) for path in paths]
        if len(paths) == 1 and paths[0].is_file() and _is_project(paths[0]):
            return self._adopt(paths[0])
        found = self._made_of([_digest(path) for path in paths])
        if found is not None:
            return found
        with _opened(paths) as sources:
            return self.create(sources, ANY_SIZE).id

    def _adopt(self, path: Path) -> str:
        path = path.resolve()
        Store.open(path).close()  # says now what is wrong with it
        if path.parent == self._folder and ID.fullmatch(path.stem):
            return path.stem
        id = f"{_slug(path.stem)}-{hashlib.sha256(bytes(path)).hexdigest()[:6]}"
        self._elsewhere[id] = path
        return id

    def _made_of(self, digests: list[str]) -> str | None:
        """The project changed last that has exactly these logs."""
        for summary in self.summaries():
            if summary.state is not None and _files(summary.state) == digests:
                return summary.id
        return None

    def _make(self, title: str, sources: Sequence[Source], limits: Limits | None = None) -> Created:
        with self._new_file(title) as (id, path):
            filled = fill(path, title, sources, limits)
        self._known_logs = {id: filled.logs}  # of the last one only: it is the one opened next
        return Created(id, title, filled.problems)

    def _take_in(self, source: Source) -> Created:
        name = base_name(source.name).removesuffix(SUFFIX)
        with self._new_file(name) as (id, path):
            state = copy_project(source.file, path)
        return Created(id, state.name)

    # --- keeping ----------------------------------------------------------------------------------

    def rename(self, id: str, name: str, who: str = "") -> None:
        """Give a project another name; a step that can be undone in it. Raises UnknownError where there is none."""
        path = self.check(id)
        with self._lock:
            session = self._sessions.get(id)
            if session is not None:
                session.rename(name, who=who)
                return
            with Store.open(path) as store:
                if store.state.name != name:
                    store.append(Rename(name=name, who=who))

    def duplicate(self, id: str, name: str = "", who: str = "") -> Created:
        """A copy of a project, as it is now, under another name.

        Raises:
            UnknownError: there is no such project.
            ProjectError: its file cannot be read.
        """
        held = self.summary(id)
        if held.state is None:
            raise ProjectError(held.problem)
        title = name or f"{held.state.name} (copy)"
        with self._new_file(title) as (new, path):
            self.backup(id, path)
            with Store.open(path) as store:
                store.append(Rename(name=title, who=who))
        return Created(new, title)

    def delete(self, id: str) -> None:
        """Close a project and set it aside; one that lies elsewhere stays there and leaves the list.

        Raises:
            UnknownError: there is no such project.
        """
        with self._lock:
            self.check(id)
            session = self._sessions.pop(id, None)
            if session is not None:
                session.leave()
                session.close()
            if id in self._elsewhere:
                self._closed[id] = self._elsewhere.pop(id)
            else:
                self._trash.put(id)

    def deleted(self) -> list[Summary]:
        """The projects that were deleted and can be had back."""
        held = {**{id: self._trash.path(id) for id in self._trash.ids}, **self._closed}
        return [_summary(id, path) for id, path in sorted(held.items())]

    def restore(self, id: str) -> None:
        """Undo a deletion. Raises UnknownError where there was none."""
        with self._lock:
            if id in self._closed:
                self._elsewhere[id] = self._closed.pop(id)
            else:
                self._trash.take_back(id)

    def remove(self, id: str) -> None:
        """Remove a deleted project for good; a file that lies elsewhere stays. Raises UnknownError where it was not."""
        with self._lock:
            if self._closed.pop(id, None) is None:
                self._trash.remove(id)

    @contextmanager
    def _new_file(self, title: str) -> Iterator[tuple[str, Path]]:
        """An id, and where to write its file; the project is there once that has gone well, or not at all."""
        _make_folder(self._folder)
        id = f"{_slug(title)}-{secrets.token_hex(3)}"
        path = self._folder / f".{id}.new"
        try:
            yield id, path
            path.rename(self._folder / f"{id}{SUFFIX}")
        finally:
            for leftover in (path, *(path.with_name(path.name + end) for end in ("-wal", "-shm", "-journal"))):
                leftover.unlink(missing_ok=True)


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RequestError(
            f"Projects cannot be kept in {folder}: {error.strerror}. Choose another workspace."
        ) from None


def _summary(id: str, path: Path) -> Summary:
    try:
        with Store.open(path) as store:
            return Summary(id, path, store.state, picture=store.get_result(PICTURE) or "")
    except SegmapError as error:
        return Summary(id, path, None, str(error))


def _stamp(path: Path) -> tuple[int, ...]:
    """Changes when the file, or the log SQLite keeps beside it, does."""
    stamp: list[int] = []
    for each in (path, path.with_name(path.name + "-wal")):
        with suppress(OSError):
            status = each.stat()
            stamp += (status.st_mtime_ns, status.st_size)
    return tuple(stamp)


def _title(sources: Sequence[Source]) -> str:
    names = [re.sub(r"(\.gz)?$", "", base_name(source.name), flags=re.IGNORECASE) for source in sources]
    stems = [name.rpartition(".")[0] or name for name in names]
    return stems[0] if len(stems) == 1 else f"{stems[0]} and {len(stems) - 1} more"


def _files(state: ProjectState) -> list[str]:
    """The files the logs of a project came from, by digest; a bag of several topics is one file."""
    return list(dict.fromkeys(log.sha256 for log in state.logs))


def _slug(title: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", title.lower())[:40].strip("-") or "project"


def _is_project(path: Path) -> bool:
    with path.open("rb") as file:
        return is_project(file)


@contextmanager
def _opened(paths: Sequence[Path]) -> Iterator[list[Source]]:
    """The files, open."""
    with ExitStack() as stack:
        yield [Source(path.name, stack.enter_context(_open(path))) for path in paths]


def _open(path: Path) -> BufferedReader:
    try:
        return path.open("rb")
    except OSError as error:
        raise RequestError(f"{path} cannot be opened: {(error.strerror or str(error)).lower()}.") from None


def _digest(path: Path) -> str:
    with _open(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
