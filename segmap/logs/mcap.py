"""MCAP files, as ROS 2 (and some of ROS 1) record them, from front to back: summary and index are not needed.

::

    magic, records, magic         record: operation (1 byte), length (8 bytes), content; little end first
    operation: 3 schema (id, name)   4 channel (id, schema, topic, encoding)   5 message   6 chunk   15 end of the data
"""

from __future__ import annotations

import struct
from collections.abc import Iterator

from segmap.logs.bags import MESSAGE as LARGEST_MESSAGE
from segmap.logs.bags import CutError, Messages, Pieces
from segmap.logs.laser_messages import ROS_1, ROS_2
from segmap.logs.packing import LARGEST
from segmap.logs.records import Format, Problems, Record
from segmap.logs.source import LogFile

__all__ = ["MCAP"]

MAGIC = b"\x89MCAP0\r\n"
SCHEMA, CHANNEL, MESSAGE, CHUNK, DATA_END = 3, 4, 5, 6, 15
START = struct.Struct("<BQ")
MESSAGE_HEADER = struct.Struct("<HIQQ")
CHUNK_HEADER = struct.Struct("<QQQI")
DESCRIPTION = 1 << 24
"""bytes of the largest schema or channel read"""
NANOSECONDS = 1e9


def _records(file: LogFile, problems: Problems) -> Iterator[Record]:
    file.skip(len(MAGIC))
    reader = _Reader(Messages(file, problems))
    with reader.messages.until_cut():
        yield from reader.read(file)


class _Reader:
    def __init__(self, messages: Messages) -> None:
        self.messages = messages
        self._schemas: dict[int, str] = {}

    def read(self, stream: LogFile | Pieces) -> Iterator[Record]:
        """The scans of the records of a file, or of a chunk."""
        while start := stream.read(START.size):
            self.messages.step()
            if start.startswith(MAGIC):
                return
            operation, size = _unpacked(START, start)
            if operation == DATA_END:
                return
            if operation == MESSAGE:
                yield from self._message(stream, size)
            elif operation == CHUNK and isinstance(stream, LogFile):
                yield from self._chunk(stream, size)
            elif operation in (SCHEMA, CHANNEL) and size <= DESCRIPTION:
                self._describe(operation, _taken(stream, size))
            elif not stream.skip(size):
                raise CutError("cut off")

    def _message(self, stream: LogFile | Pieces, size: int) -> Iterator[Record]:
        channel, _, logged, _ = _unpacked(MESSAGE_HEADER, stream.read(min(size, MESSAGE_HEADER.size)))
        size -= MESSAGE_HEADER.size
        if self.messages.wants(channel) and size <= LARGEST_MESSAGE:
            yield from self.messages.record(channel, _taken(stream, size), logged / NANOSECONDS)
        elif not stream.skip(size):
            raise CutError("cut off")

    def _chunk(self, stream: LogFile, size: int) -> Iterator[Record]:
        if size > LARGEST:
            self.messages.problem(f"a part of the bag of {size >> 20} MiB was left out")
            if not stream.skip(size):
                raise CutError("cut off")
            return
        content = stream.read(size)
        compression, place = _text(content, CHUNK_HEADER.size)
        packed = content[place + 8 :]  # after the length of the records
        yield from self.messages.part(compression, packed, len(content) == size, self.read)

    def _describe(self, operation: int, content: bytes) -> None:
        if operation == SCHEMA:
            self._schemas[_short(content, 0)] = _text(content, 2)[0]
            return
        channel, schema = _short(content, 0), _short(content, 2)
        topic, place = _text(content, 4)
        encoding, _ = _text(content, place)
        if encoding in (ROS_1, ROS_2):
            self.messages.topic(channel, topic, self._schemas.get(schema, ""), encoding)


def _taken(stream: LogFile | Pieces, size: int) -> bytes:
    content = stream.read(size)
    if len(content) < size:
        raise CutError("cut off")
    return content


def _unpacked(form: struct.Struct, content: bytes) -> tuple[int, ...]:
    if len(content) < form.size:
        raise CutError("cut off")
    return form.unpack(content[: form.size])


def _short(content: bytes, place: int) -> int:
    return _unpacked(struct.Struct("<H"), content[place:])[0]


def _text(content: bytes, place: int) -> tuple[str, int]:
    """A text, and the place after it."""
    (size,) = _unpacked(struct.Struct("<I"), content[place : place + 4])
    end = place + 4 + size
    if end > len(content):
        raise CutError("damaged")
    return content[place + 4 : end].decode("utf-8", "replace"), end


MCAP = Format(
    name="MCAP",
    expects="an MCAP file",
    recognises=lambda head: head.startswith(MAGIC),
    records=_records,
    unit="message",
    topics=True,
)
