"""What the readers of bags share: topics, messages that are laser scans, and how they say what is wrong."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from typing import TypeAlias

from segmap.errors import LogError
from segmap.logs.laser_messages import LASER_TYPES, laser_record
from segmap.logs.packing import expand
from segmap.logs.records import Problems, Record
from segmap.logs.source import LogFile
from segmap.logs.text import MalformedError, printable

__all__ = ["MESSAGE", "CutError", "Messages", "Pieces"]

MESSAGE = 1 << 26
"""bytes of the largest message read; a laser scan has some thousand"""
TOPICS = 10_000
ZSTD = b"\x28\xb5\x2f\xfd"


Reader: TypeAlias = Callable[["Pieces"], Iterator[Record]]
"""Gives the scans of a part of a bag."""


class CutError(Exception):
    """The bytes end within something."""


class Pieces:
    """Bytes in memory, read like a file."""

    def __init__(self, content: bytes) -> None:
        self._content, self._place = content, 0

    def read(self, size: int) -> bytes:
        """The next bytes; fewer than ``size`` at the end."""
        found = self._content[self._place : self._place + size]
        self._place += len(found)
        return found

    def skip(self, size: int) -> bool:
        """Pass over the next bytes; whether there were as many."""
        self._place += size
        return self._place <= len(self._content)


class Messages:
    """The laser messages of a bag, in file order, numbered from 1; what cannot be read goes to the problems."""

    def __init__(self, file: LogFile, problems: Problems) -> None:
        self._file, self._problems = file, problems
        self._topics: dict[int, tuple[str, str, str]] = {}
        self._count = self._steps = 0

    def topic(self, number: int, name: str, type: str, written: str) -> None:
        """Learn of a topic; those without laser scans are passed over.

        Raises:
            LogError: there are more topics than any bag has.
        """
        if len(self._topics) >= TOPICS:
            raise LogError(f"{self._file.name} has more than {TOPICS} laser topics: it is no recording of a robot.")
        if kind := LASER_TYPES.get(type):
            self._topics[number] = (printable(name) or "/", kind, written)

    @property
    def topics(self) -> Collection[int]:
        """The numbers of those whose messages are laser scans."""
        return self._topics.keys()

    def wants(self, number: int) -> bool:
        """Whether the messages of a topic are laser scans."""
        return number in self._topics

    def step(self) -> None:
        """Count something read.

        Raises:
            LogError: there is more in the file than anybody can wait for.
        """
        self._steps += 1
        if self._steps > self._file.limits.lines:
            raise LogError(
                f"{self._file.name} has more than {self._file.limits.lines} records: split it and read each part."
            )

    def record(self, number: int, message: bytes, received: float | None) -> Iterator[Record]:
        """The scan of a message of a topic that is wanted, if it holds one."""
        self._count += 1
        topic, kind, written = self._topics[number]
        try:
            yield laser_record(kind, written, message, topic, self._count, received)
        except MalformedError as error:
            self.problem(f"{error}; the scan of {topic} was left out")

    def problem(self, reason: str) -> None:
        """Note what was left out after the last message."""
        self._problems.add(max(self._count, 1), printable(reason))

    @contextmanager
    def until_cut(self) -> Iterator[None]:
        """What was read before the end of a bag that is cut off or damaged is kept."""
        try:
            yield
        except CutError as error:
            if not self._file.damage:
                self.problem(f"the bag is {error} after this one; what came before was read")

    def part(self, kind: str, packed: bytes, whole: bool, read: Reader) -> Iterator[Record]:
        """The scans of a part of the bag that is compressed for itself; ``whole``: nothing of it is cut off.

        Raises:
            LogError: the bag grows beyond all measure.
            CutError: it ends here.
        """
        try:
            yield from read(self._expanded(kind, packed))
        except CutError as error:
            if not whole:
                raise
            self.problem(f"a part of the bag is {error} after this one, and the rest of that part was left out")
        if not whole:
            raise CutError("cut off")

    def _expanded(self, kind: str, packed: bytes) -> Pieces:
        try:
            content = expand(kind, packed)
        except MalformedError as error:
            self.problem(f"a part of the bag was left out: {error}")
            return Pieces(b"")
        if kind not in ("none", ""):
            self._file.expanded(len(content))
        return Pieces(content)

    def plain(self, message: bytes) -> bytes:
        """A message that may be compressed for itself, as it was before; empty where that is damaged.

        Raises:
            LogError: the bag grows beyond all measure.
        """
        if not message.startswith(ZSTD):
            return message
        try:
            content = expand("zstd", message, MESSAGE)
        except MalformedError as error:
            self.problem(f"a message is damaged: {error}")
            return b""
        self._file.expanded(len(content))
        return content
