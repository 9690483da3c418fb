"""ROS 2 bags in SQLite (``.db3``): tables ``topics`` (id, name, type) and ``messages`` (topic_id, timestamp, data).

A message may be compressed for itself, with zstd. The database may come from anybody: it is opened
to be read only, with bounds on what it may make SQLite do.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from segmap.errors import LogError
from segmap.logs.bags import MESSAGE, Messages
from segmap.logs.laser_messages import ROS_2
from segmap.logs.records import Format, Problems, Record
from segmap.logs.source import LogFile

__all__ = ["ROS_2_BAG"]

SQLITE = b"SQLite format 3\0"
HEADER = 100
FIRST_PAGE = 1 << 16
NANOSECONDS = 1e9
STEPS = 100_000
"""instructions of SQLite between two looks at how many it needed"""
FREE_STEPS, STEPS_A_BYTE = 10_000_000, 4
"""instructions that are allowed for any file, and for each of its bytes"""
COLUMNS = {"topics": {"id", "name", "type"}, "messages": {"topic_id", "timestamp", "data"}}


def _records(file: LogFile, problems: Problems) -> Iterator[Record]:
    messages = Messages(file, problems)
    with file.on_disk() as path, _opened(path) as database:
        _refuse_cut(path, file.name)
        try:
            _check(database, file.name)
            _learn_topics(database, messages)
            for topic, timestamp, data in _messages(database, messages.topics):
                messages.step()
                yield from _record(topic, timestamp, data, messages)
        except (sqlite3.Error, UnicodeDecodeError) as error:  # names and messages of SQLite may be any bytes
            messages.problem(f"the bag cannot be read after this one ({error}); what came before was read")


def _refuse_cut(path: Path, name: str) -> None:
    """SQLite takes what is missing at the end of a database for zeros, and its tables lie anywhere."""
    with path.open("rb") as file:
        header = file.read(HEADER)
    size = int.from_bytes(header[16:18], "big")
    announced = int.from_bytes(header[28:32], "big") * (1 << 16 if size == 1 else size)
    held = path.stat().st_size
    if held < announced:
        raise LogError(f"{name} is cut off: {held} of {announced} bytes are there. Fetch the file again.")


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)) as database:
        database.text_factory = lambda text: text.decode("utf-8", "replace")
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MESSAGE + HEADER)
        allowed = FREE_STEPS + STEPS_A_BYTE * path.stat().st_size
        steps = iter(range(STEPS, allowed, STEPS))
        database.set_progress_handler(lambda: next(steps, None) is None, STEPS)
        database.execute("PRAGMA trusted_schema = OFF")
        yield database


def _check(database: sqlite3.Connection, name: str) -> None:
    """Real tables with the columns of a bag; no views, which could be anything."""
    tables = dict(database.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table'"))
    for table, columns in COLUMNS.items():
        virtual = "VIRTUAL" in str(tables.get(table, "VIRTUAL")).upper()
        if virtual or not columns <= {row[1] for row in database.execute(f"PRAGMA table_info({table})")}:
            raise LogError(f"{name} is a database, but no ROS 2 bag: its table {table!r} is not that of a bag.")


def _learn_topics(database: sqlite3.Connection, messages: Messages) -> None:
    for number, name, type in database.execute("SELECT id, name, type FROM topics"):
        if isinstance(number, int):
            messages.topic(number, str(name), str(type), ROS_2)


def _messages(database: sqlite3.Connection, topics: Collection[int]) -> sqlite3.Cursor:
    """The messages of some topics in the order they were written; no data where they are too large."""
    query = (
        f"SELECT topic_id, timestamp, CASE WHEN length(data) <= {MESSAGE} THEN data END"
        f" FROM messages NOT INDEXED WHERE topic_id IN ({', '.join(map(str, topics))})"
    )
    return database.execute(query)


def _record(topic: int, timestamp: object, data: object, messages: Messages) -> Iterator[Record]:
    received = timestamp / NANOSECONDS if isinstance(timestamp, int) else None
    message = messages.plain(data) if isinstance(data, bytes) else b""
    yield from messages.record(topic, message, received)


def _recognises(head: bytes) -> bool:
    start = head[:FIRST_PAGE]
    return start.startswith(SQLITE) and b"topics" in start and b"messages" in start


ROS_2_BAG = Format(
    name="ROS 2 bag",
    expects="a ROS 2 bag (SQLite)",
    recognises=_recognises,
    records=_records,
    unit="message",
    topics=True,
)
