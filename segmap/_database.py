"""The SQLite side of a project file: what is ours, which version, safe settings, errors in one sentence."""

from __future__ import annotations

import os
import sqlite3
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from segmap.errors import ProjectError

__all__ = [
    "MIGRATIONS",
    "create_database",
    "explained",
    "insert_event",
    "open_database",
    "reserved",
    "select_events",
    "transaction",
]

APPLICATION_ID = int.from_bytes(b"SGMP", "big")
MAGIC = b"SQLite format 3\0"


def _to_version_1(connection: sqlite3.Connection) -> None:
    """Events and logs that only grow, and results that may go at any time."""
    for statement in (
        "CREATE TABLE events (seq INTEGER PRIMARY KEY, body TEXT NOT NULL, crc INTEGER NOT NULL)",
        """CREATE TABLE chunks (
            event INTEGER NOT NULL REFERENCES events (seq) DEFERRABLE INITIALLY DEFERRED,
            position INTEGER NOT NULL,
            data BLOB NOT NULL,
            PRIMARY KEY (event, position))""",
        "CREATE TABLE results (number INTEGER PRIMARY KEY, key TEXT NOT NULL UNIQUE, value BLOB NOT NULL)",
        """CREATE TRIGGER events_in_order BEFORE INSERT ON events
            WHEN NEW.seq IS NOT (SELECT coalesce(max(seq), 0) + 1 FROM events)
            BEGIN SELECT raise(ABORT, 'events are numbered without a gap'); END""",
    ):
        connection.execute(statement)
    for table in ("events", "chunks"):
        for verb in ("UPDATE", "DELETE"):
            connection.execute(
                f"CREATE TRIGGER no_{verb}_of_{table} BEFORE {verb} ON {table}"
                f" BEGIN SELECT raise(ABORT, '{table} are only added'); END"
            )


def _to_version_2(connection: sqlite3.Connection) -> None:
    """Events may propose pairs and hold covariances: the tables stay, but older programs cannot replay such a file."""


def _to_version_3(connection: sqlite3.Connection) -> None:
    """Decisions hold their grounds, and proposals what was laid by hand: the tables stay, as in version 2."""


MIGRATIONS: tuple[Callable[[sqlite3.Connection], None], ...] = (_to_version_1, _to_version_2, _to_version_3)
"""The function at place k takes a file of version k to version k + 1, inside a transaction."""


@contextmanager
def explained(path: Path) -> Iterator[None]:
    """Turn what SQLite says about a file into what a person can act on.

    Raises:
        ProjectError: something went wrong.
    """
    try:
        yield
    except sqlite3.Error as error:
        raise ProjectError(_sentence(path, error)) from error
    except UnicodeDecodeError as error:  # in the names of its tables, or in SQLite's own message about them
        raise ProjectError(_DAMAGED.format(path=path, error="text that is no text")) from error
    except OSError as error:
        raise ProjectError(f"{path} cannot be used: {error.strerror or error}.") from error


_BUSY = "{path} is being written by another program: wait until it has finished or close it, then try again."
_DAMAGED = "{path} is damaged or cut off ({error}): open a backup of it, or fetch it again."
_UNFINISHED = "{path} is empty: its making was interrupted. Delete it and make it again."
_READ_ONLY = (
    "{path} cannot be written: it, or its folder, is read-only. Copy it to a folder you may write to and open the copy."
)
_SENTENCES = {
    sqlite3.SQLITE_BUSY: _BUSY,
    sqlite3.SQLITE_LOCKED: _BUSY,
    sqlite3.SQLITE_FULL: "{path} cannot be written: the disk is full. Nothing of this was kept;"
    " free some space and try again.",
    sqlite3.SQLITE_READONLY: _READ_ONLY,
    sqlite3.SQLITE_PERM: _READ_ONLY,
    sqlite3.SQLITE_CANTOPEN: "{path} cannot be opened: check that it, and its folder, may be read and written.",
    sqlite3.SQLITE_CORRUPT: _DAMAGED,
    sqlite3.SQLITE_NOTADB: _DAMAGED,
    sqlite3.SQLITE_IOERR: "{path} cannot be read or written: the disk reports an error ({error}). Check the disk.",
}


def _sentence(path: Path, error: sqlite3.Error) -> str:
    if isinstance(error, sqlite3.ProgrammingError) and "closed" in str(error):
        return f"{path} is closed: open it again."
    code = getattr(error, "sqlite_errorcode", -1) & 0xFF  # the low byte is the kind, the rest its detail
    return _SENTENCES.get(code, "{path} cannot be used as a project: {error}.").format(
        path=path, error=_one_line(error)
    )


def _one_line(text: object) -> str:
    return " ".join(str(text).split())[:200]


@contextmanager
def transaction(connection: sqlite3.Connection) -> Iterator[None]:
    """Everything or nothing; when it ends well, it is on the disk (synchronous=FULL)."""
    connection.execute("BEGIN IMMEDIATE")
    try:
        yield
        connection.execute("COMMIT")
    except BaseException:
        with suppress(sqlite3.Error):
            if connection.in_transaction:
                connection.execute("ROLLBACK")
        raise


def insert_event(connection: sqlite3.Connection, seq: int, body: str) -> None:
    """Write an event with a checksum: SQLite finds damage to its own structure, not to what it holds."""
    connection.execute("INSERT INTO events VALUES (?, ?, ?)", (seq, body, _crc(seq, body.encode())))


def select_events(path: Path, connection: sqlite3.Connection, after: int) -> list[tuple[int, bytes]]:
    """Sequence number and body of every event after one, in order.

    Raises:
        ProjectError: an event is not what was written.
    """
    query = "SELECT seq, CAST(body AS BLOB), crc FROM events WHERE seq > ? ORDER BY seq"
    rows = connection.execute(query, (after,)).fetchall()
    for seq, body, crc in rows:
        if _crc(seq, body) != crc:
            raise ProjectError(_DAMAGED.format(path=path, error=f"event {seq} is not what was written"))
    return [(seq, body) for seq, body, _ in rows]


def _crc(seq: int, body: bytes) -> int:
    return zlib.crc32(b"%d " % seq + body)


@contextmanager
def reserved(path: Path) -> Iterator[None]:
    """An empty file that nobody had, to be filled; it goes again when that fails.

    Raises:
        ProjectError: there is a file already, or none can be made.
    """
    try:
        path.open("xb").close()
    except FileExistsError:
        raise ProjectError(f"{path} exists already: open it, or choose another name.") from None
    except OSError as error:
        raise ProjectError(f"{path} cannot be created: {error.strerror or error}. Choose another folder.") from None
    try:
        yield
    except BaseException:
        path.unlink(missing_ok=True)
        raise
    _sync_folder(path.parent)


def _sync_folder(folder: Path) -> None:
    """A new file survives a power cut only when its folder is written too; not every system can."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def create_database(path: Path, body: str, patience: float) -> sqlite3.Connection:
    """A new project file with its first event.

    Raises:
        ProjectError: there is a file already, or it cannot be written.
    """
    with reserved(path):
        connection = _connect(path, patience)
        with _closed_on_error(connection), explained(path):
            with transaction(connection):
                connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
                _migrate(connection)
                insert_event(connection, 1, body)
            _make_safe(connection)
    return connection


def open_database(path: Path, patience: float) -> sqlite3.Connection:
    """An existing project file, checked, and brought to the present version.

    Raises:
        ProjectError: it is missing, not a project, damaged, of a newer version or cannot be written.
    """
    _check_header(path)
    connection = _connect(path, patience)
    with _closed_on_error(connection), explained(path):
        _check(path, connection)
        _make_safe(connection)
        if _pragma(connection, "user_version") < len(MIGRATIONS):
            with transaction(connection):
                _migrate(connection)
    return connection


@contextmanager
def _closed_on_error(connection: sqlite3.Connection) -> Iterator[None]:
    try:
        yield
    except BaseException:
        connection.close()
        raise


def _connect(path: Path, patience: float) -> sqlite3.Connection:
    """``patience``: seconds to wait for another program that writes."""
    with explained(path):
        connection = sqlite3.connect(path, timeout=patience, isolation_level=None, check_same_thread=False)
    connection.execute("PRAGMA trusted_schema = OFF")  # a file from a stranger calls no functions
    return connection


def _make_safe(connection: sqlite3.Connection) -> None:
    for setting in ("journal_mode = WAL", "synchronous = FULL", "fullfsync = ON", "foreign_keys = ON"):
        connection.execute(f"PRAGMA {setting}")


def _migrate(connection: sqlite3.Connection) -> None:
    for migration in MIGRATIONS[_pragma(connection, "user_version") :]:
        migration(connection)
    connection.execute(f"PRAGMA user_version = {len(MIGRATIONS)}")


def _pragma(connection: sqlite3.Connection, name: str) -> int:
    return int(connection.execute(f"PRAGMA {name}").fetchone()[0])


def _check_header(path: Path) -> None:
    if not path.is_file():
        raise ProjectError(f"There is no project {path}: check the name.")
    with explained(path), path.open("rb") as file:
        start = file.read(len(MAGIC))
    if not start:
        raise ProjectError(_UNFINISHED.format(path=path))
    if start != MAGIC:
        raise ProjectError(f"{path} is not a segmap project: choose a file that segmap has written.")


def _check(path: Path, connection: sqlite3.Connection) -> None:
    """Ours, of a version we know, whole, and with exactly the tables and triggers we make."""
    if not _pragma(connection, "page_count"):
        raise ProjectError(_UNFINISHED.format(path=path))
    version = _pragma(connection, "user_version")
    if _pragma(connection, "application_id") != APPLICATION_ID or version < 1:
        raise ProjectError(f"{path} is an SQLite file but not a segmap project: choose a file that segmap has written.")
    if version > len(MIGRATIONS):
        raise ProjectError(
            f"{path} was written by a newer segmap (version {version} of the project file; this one reads up to"
            f" version {len(MIGRATIONS)}): update segmap and open it again."
        )
    if (damage := connection.execute("PRAGMA quick_check(1)").fetchone()[0]) != "ok":
        raise ProjectError(_DAMAGED.format(path=path, error=_one_line(damage)))
    if _schema(connection) != _expected_schema(version):
        raise ProjectError(f"{path} is not a project as segmap writes them: its tables differ. Open a backup of it.")


def _schema(connection: sqlite3.Connection) -> set[tuple[str, ...]]:
    """All but SQLite's own tables and indices."""
    ours = "SELECT type, name, tbl_name, sql FROM sqlite_master WHERE name NOT LIKE 'sqlite!_%' ESCAPE '!'"
    return set(connection.execute(ours))


def _expected_schema(version: int) -> set[tuple[str, ...]]:
    model = sqlite3.connect(":memory:")
    try:
        for migration in MIGRATIONS[:version]:
            migration(model)
        return _schema(model)
    finally:
        model.close()
