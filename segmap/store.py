"""The project file: one SQLite file ``.segmap`` with the original logs and the history of decisions.

The history (:mod:`segmap.events`) and the logs are only ever added to; :attr:`Store.state` is
their replay. Beside them lies a cache of results that can be dropped at any time. What
:meth:`Store.append` returns is on the disk. Several threads may use one store, and several
programs one file: each writes on top of what the others wrote, or is told of the conflict.
While a project is open, ``.segmap-wal`` beside it is part of it: copy with :meth:`Store.backup`.
"""

from __future__ import annotations

import hashlib
import io
import sqlite3
import threading
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from pathlib import Path
from tempfile import SpooledTemporaryFile
from typing import IO, Any, BinaryIO, Self, TypeVar, cast

from segmap._database import (
    create_database,
    explained,
    insert_event,
    open_database,
    reserved,
    select_events,
    transaction,
)
from segmap.errors import ProjectError
from segmap.events import AddLog, Create, Event, LogInfo, Redo, Undo, event_from_json
from segmap.parameters import Parameters
from segmap.project import ProjectState, check_conflict, replay

__all__ = ["Store"]

CHUNK = 1 << 20  # bytes of a log in one row
RESULTS_LIMIT = 256 << 20  # bytes of cached results, compressed
RESULT_LIMIT = 64 << 20  # bytes of one cached result, expanded
IN_MEMORY = 32 << 20  # bytes of a log that are not put into a temporary file
PATIENCE = 5.0  # seconds to wait for another program that writes

_E = TypeVar("_E", bound=Event)


class Store:
    """An open project file; make one with :meth:`create` or :meth:`open`, end with :meth:`close`.

    Every method raises ProjectError, in one sentence, when the file cannot be read or written.
    """

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self.path = path
        self._connection = connection
        self._lock = threading.RLock()
        self._file = _found(path)
        self._results_size: int | None = None
        try:
            self._state = self._replayed(ProjectState())
        except BaseException:
            connection.close()
            raise

    @classmethod
    def create(
        cls,
        path: str | Path,
        name: str,
        parameters: Parameters | None = None,
        heuristic: str = "all",
        mode: str = "paper",
        who: str = "",
        patience: float = PATIENCE,
    ) -> Store:
        """A new project in a new file.

        Raises:
            ProjectError: there is a file already (it is left alone), or none can be made there.
        """
        path = Path(path).absolute()
        event = Create(name=name, parameters=parameters or Parameters(), heuristic=heuristic, mode=mode, who=who)
        body = _stamped(event, 1, 0).model_dump_json()
        return cls(path, create_database(path, body, patience))

    @classmethod
    def open(cls, path: str | Path, patience: float = PATIENCE) -> Store:
        """An existing project; a file of an older version is brought to the present one.

        Raises:
            ProjectError: the file is missing, damaged, not a project or from a newer segmap.
        """
        path = Path(path).absolute()
        return cls(path, open_database(path, patience))

    def close(self) -> None:
        """Write everything into the one file and let it go; closing twice is harmless."""
        with self._lock:
            self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # history

    @property
    def state(self) -> ProjectState:
        """What is in force, as of the last :meth:`append`, :meth:`add_log` or :meth:`refresh` here."""
        return self._state

    def refresh(self) -> ProjectState:
        """The state with what other programs have written meanwhile."""
        with self._lock:
            self._state = self._replayed(self._state)
            return self._state

    def events(self, after: int = 0) -> tuple[Event, ...]:
        """The history, in order; ``after``: only events with a larger sequence number."""
        with self._reading() as connection:
            rows = select_events(self.path, connection, after)
        return tuple(self._event(*row) for row in rows)

    def append(self, event: _E, expected_revision: int | None = None) -> _E:
        """Record an event; what is returned, with its number, time and version, is on the disk.

        ``expected_revision`` is the revision its maker looked at; None: whatever is in force.

        Raises:
            ConflictError: what the event is about was changed after ``expected_revision``.
            ProjectError: the event cannot happen now, or cannot be written; nothing was recorded.
        """
        if isinstance(event, Create | AddLog):
            raise ProjectError("A project is made with Store.create, and logs are put into it with Store.add_log.")
        with self._recording() as state:
            if expected_revision is not None:
                check_conflict(state, event, expected_revision)
            recorded = _stamped(_resolved(event, state), state.revision + 1, expected_revision)
            insert_event(self._connection, recorded.seq, recorded.model_dump_json())
        return recorded

    @contextmanager
    def _recording(self) -> Iterator[ProjectState]:
        """The state with all that is on the disk, and a transaction in which to add to it."""
        with self._lock:
            self._check_place()
            with self._writing():
                before = self._replayed(self._state)
                yield before
                after = replay(self.events(after=before.revision), before)
            self._state = after  # only now is it on the disk

    def _check_place(self) -> None:
        """What goes into a file that was moved, replaced or cut off under the open store would be lost.

        Raises:
            ProjectError: it was.
        """
        now = _found(self.path)
        if now is None or self._file is None or now[:2] != self._file[:2]:
            happened = "moved, replaced or deleted"
        elif now[2] < self._file[2]:
            happened = "cut off"
        else:
            self._file = now
            return
        raise ProjectError(
            f"{self.path} was {happened} while it was open: nothing of this was kept."
            " Put it back, or open it again where it is now, or a backup of it."
        )

    def _replayed(self, state: ProjectState) -> ProjectState:
        events = self.events(after=state.revision)
        try:
            return replay(events, state) if events else state
        except ProjectError as error:
            raise ProjectError(f"The history of {self.path} cannot be replayed. {error}") from error

    def _event(self, seq: int, body: bytes) -> Event:
        try:
            return event_from_json(body)
        except ProjectError as error:
            raise ProjectError(f"Event {seq} of {self.path} cannot be read. {error}") from error

    # logs

    def add_log(
        self, name: str, content: bytes | BinaryIO, *, scans: int, format: str = "", topic: str = "", who: str = ""
    ) -> LogInfo:
        """Put a log into the project, byte for byte; a file is read to its end, chunk by chunk.

        ``scans``, ``format`` and ``topic`` are what reading it found. Either all of the log is kept or nothing.
        """
        file = io.BytesIO(content) if isinstance(content, bytes) else content
        with self._recording() as state:
            seq = state.revision + 1
            sha256, size = self._insert_chunks(seq, _pieces(name, file))
            info = LogInfo(name=name, sha256=sha256, size=size, scans=scans, format=format, topic=topic)
            insert_event(self._connection, seq, _stamped(AddLog(log=info, who=who), seq, None).model_dump_json())
        return self._state.logs[len(state.logs)]

    def _insert_chunks(self, seq: int, chunks: Iterable[bytes]) -> tuple[str, int]:
        digest, size = hashlib.sha256(), 0
        for position, chunk in enumerate(chunks):
            self._connection.execute("INSERT INTO chunks VALUES (?, ?, ?)", (seq, position, chunk))
            digest.update(chunk)
            size += len(chunk)
        return digest.hexdigest(), size

    def log_chunks(self, index: int) -> Iterator[bytes]:
        """The bytes of a log in pieces, for any size; the end is reached only if they are the original ones.

        Raises:
            ProjectError: there is no such log, or (after the last piece) it is not what was put in.
        """
        info = self._log(index)
        digest, position = hashlib.sha256(), 0
        while chunk := self._chunk(info.event, position):
            digest.update(chunk)
            position += 1
            yield chunk
        if digest.hexdigest() != info.sha256:
            raise ProjectError(f"The log {info.name} inside {self.path} is damaged: open a backup of the project.")

    def log_bytes(self, index: int) -> bytes:
        """All bytes of a log; raises as :meth:`log_chunks` does."""
        return b"".join(self.log_chunks(index))

    def open_log(self, index: int) -> IO[bytes]:
        """A copy of a log as a file to read and seek in, in memory only when it is small; close it."""
        file = SpooledTemporaryFile(max_size=IN_MEMORY)  # noqa: SIM115 - it is the caller's to close
        try:
            file.writelines(self.log_chunks(index))
            file.seek(0)
        except BaseException:
            file.close()
            raise
        return file

    def _log(self, index: int) -> LogInfo:
        logs = self._state.logs
        if not 0 <= index < len(logs):
            raise ProjectError(f"{self.path} has no log {index}: it holds {len(logs)}, counted from 0.")
        return logs[index]

    def _chunk(self, event: int, position: int) -> bytes | None:
        with self._reading() as connection:
            query = "SELECT data FROM chunks WHERE event = ? AND position = ?"
            row = connection.execute(query, (event, position)).fetchone()
        return row[0] if row and isinstance(row[0], bytes) else None

    # results: a cache, never truth

    def put_result(self, key: str, text: str) -> None:
        """Keep a result for :meth:`get_result`, as long as there is room."""
        self.put_results({key: text})

    def put_results(self, texts: Mapping[str, str]) -> None:
        """Keep several results in one go; the oldest ones make room for them."""
        values = {_cache_key(key): zlib.compress(text.encode("utf-8", "replace")) for key, text in texts.items()}
        with self._writing() as connection:
            connection.executemany("INSERT OR REPLACE INTO results (key, value) VALUES (?, ?)", values.items())
            self._make_room(sum(map(len, values.values())))

    def get_result(self, key: str) -> str | None:
        """A result that is kept; None: compute it again."""
        return self.results((key,)).get(key)

    def results(self, keys: Iterable[str]) -> dict[str, str]:
        """Those of the results that are kept, by key."""
        wanted = {_cache_key(key): key for key in keys}
        found: dict[str, str] = {}
        for batch in _batches(list(wanted), 500):
            query = f"SELECT key, value FROM results WHERE key IN ({','.join('?' * len(batch))})"
            with self._reading() as connection:
                rows = connection.execute(query, batch).fetchall()
            found.update({wanted[key]: text for key, value in rows if (text := _expanded(value)) is not None})
        return found

    def result_keys(self, prefix: str) -> list[str]:
        """The keys of all results that are kept and begin so, the oldest first."""
        start, own = _cache_key(prefix), len(_cache_key(""))
        query = "SELECT key FROM results WHERE substr(key, 1, ?) = ? ORDER BY number"
        with self._reading() as connection:
            rows = connection.execute(query, (len(start), start)).fetchall()
        return [key[own:] for (key,) in rows]

    def drop_results(self) -> None:
        """Forget all results."""
        with self._writing() as connection:
            connection.execute("DELETE FROM results")
            self._results_size = 0

    def _make_room(self, added: int) -> None:
        """Over the limit, the oldest results go until three quarters of it are left."""
        known = self._results_size
        self._results_size = self._measured_results() if known is None else known + added
        if self._results_size > RESULTS_LIMIT:
            self._connection.execute(_DROP_OLDEST, (RESULTS_LIMIT * 3 // 4,))
            self._results_size = self._measured_results()

    def _measured_results(self) -> int:
        return int(self._connection.execute("SELECT coalesce(sum(length(value)), 0) FROM results").fetchone()[0])

    # the file

    def backup(self, path: str | Path) -> None:
        """Write all of the project, as it is now, into one new file; work on it goes on meanwhile.

        Raises:
            ProjectError: there is a file already (it is left alone), or none can be made there.
        """
        target = Path(path).absolute()
        self.refresh()  # fails where the store is closed
        with reserved(target), explained(target), closing(sqlite3.connect(target)) as copy:
            with closing(sqlite3.connect(self.path)) as source:
                source.backup(copy)
            copy.execute("PRAGMA journal_mode = DELETE")  # one file, nothing beside it

    @contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        with self._lock, explained(self.path):
            yield self._connection

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """One writer at a time, of all threads and programs; everything or nothing is written."""
        with self._lock, explained(self.path), transaction(self._connection):
            yield self._connection


_DROP_OLDEST = """DELETE FROM results WHERE number <= (SELECT coalesce(max(number), 0) FROM
    (SELECT number, sum(length(value)) OVER (ORDER BY number DESC) AS total FROM results) WHERE total > ?)"""


def _found(path: Path) -> tuple[int, int, int] | None:
    """Which file lies there, by what the system calls it, and its bytes, which never become fewer; None: none."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino, status.st_size


def _pieces(name: str, file: BinaryIO) -> Iterator[bytes]:
    try:
        while piece := file.read(CHUNK):
            yield piece
    except OSError as error:
        raise ProjectError(
            f"{name} cannot be read to its end: {error.strerror or error}. Nothing of it was kept."
        ) from error


def _stamped(event: _E, seq: int, revision: int | None) -> _E:
    """The event as it is recorded: number, time, version, and the revision it was made on."""
    seen = seq - 1 if revision is None else revision
    return cast("_E", event.model_copy(update={"seq": seq, "revision": seen, "at": _now(), "version": _version()}))


def _resolved(event: _E, state: ProjectState) -> _E:
    """An undo or redo of whichever step is last, with the number of that step."""
    if isinstance(event, Undo) and event.undoes is None and state.done:
        return event.model_copy(update={"undoes": state.done[-1].seq})
    if isinstance(event, Redo) and event.redoes is None and state.undone:
        return event.model_copy(update={"redoes": state.undone[-1].seq})
    return event


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


@cache
def _version() -> str:
    return metadata.version("segmap")


def _cache_key(key: str) -> str:
    """Another version may compute another result."""
    return f"{_version()} {key}"


def _expanded(value: Any) -> str | None:
    """The text of a cached result; None where a stranger's file holds something else."""
    try:
        decompressor = zlib.decompressobj()
        text = decompressor.decompress(value, RESULT_LIMIT)
        return text.decode() if decompressor.eof else None
    except (zlib.error, TypeError, UnicodeDecodeError):
        return None


def _batches(items: list[str], size: int) -> Iterator[list[str]]:
    for start in range(0, len(items), size):
        yield items[start : start + size]
