"""ROS 1 bags, version 2.0, from front to back: no index is needed, so a bag of a robot that lost power is read.

::

    #ROSBAG V2.0
    record: header length, header (fields: length, name=value), data length, data
            lengths: 4 bytes, little end first
    op of a record: 7 connection (topic, type)   2 message   5 chunk (compressed records)   others: indexes
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from typing import TypeAlias

from segmap.errors import LogError
from segmap.logs.bags import MESSAGE, CutError, Messages, Pieces
from segmap.logs.laser_messages import ROS_1
from segmap.logs.packing import LARGEST
from segmap.logs.records import Format, Problems, Record
from segmap.logs.source import LogFile

__all__ = ["ROS_1_BAG"]

MAGIC = b"#ROSBAG V"
VERSION = b"#ROSBAG V2.0\n"
MESSAGE_DATA, CHUNK, CONNECTION = b"\x02", b"\x05", b"\x07"
HEADER = 1 << 20
"""bytes of the largest header read"""
NUMBER = struct.Struct("<I")

Fields: TypeAlias = Mapping[bytes, bytes]


def _records(file: LogFile, problems: Problems) -> Iterator[Record]:
    version = file.read(len(VERSION))
    if version != VERSION:
        found = version[len(MAGIC) :].split(b"\n")[0].decode("ascii", "replace")
        raise LogError(f"{file.name} is a bag of version {found!r}: bring it to 2.0 with rosbag fix.")
    messages = Messages(file, problems)
    with messages.until_cut():
        yield from _from(file, messages)


def _from(stream: LogFile | Pieces, messages: Messages) -> Iterator[Record]:
    """The scans of the records of a bag, or of a chunk."""
    while (fields := _header(stream)) is not None:
        messages.step()
        size, op = _number(stream.read(NUMBER.size)), fields.get(b"op")
        if op == CHUNK and isinstance(stream, LogFile):
            yield from _chunk(fields, stream, size, messages)
        elif op == MESSAGE_DATA and messages.wants(_field(fields, b"conn")):
            if (message := _taken(stream, size, MESSAGE, messages)) is not None:
                yield from messages.record(_field(fields, b"conn"), message, _time(fields))
        elif op == CONNECTION:
            _connect(fields, _taken(stream, size, HEADER, messages) or b"", messages)
        elif not stream.skip(size):
            raise CutError("cut off")


def _chunk(fields: Fields, stream: LogFile, size: int, messages: Messages) -> Iterator[Record]:
    if size > LARGEST:
        messages.problem(f"a part of the bag of {size >> 20} MiB was left out")
        _skipped(stream, size)
        return
    packed, compression = stream.read(size), _text(fields.get(b"compression", b"none"))
    yield from messages.part(compression, packed, len(packed) == size, lambda part: _from(part, messages))


def _connect(fields: Fields, data: bytes, messages: Messages) -> None:
    told = _fields(data)
    topic = told.get(b"topic", fields.get(b"topic", b""))
    messages.topic(_field(fields, b"conn"), _text(topic), _text(told.get(b"type", b"")), ROS_1)


def _header(stream: LogFile | Pieces) -> Fields | None:
    """The header of the next record; None at the end."""
    start = stream.read(NUMBER.size)
    if not start:
        return None
    size = _number(start)
    if size > HEADER:
        raise CutError("damaged")
    header = stream.read(size)
    if len(header) < size:
        raise CutError("cut off")
    return _fields(header)


def _fields(header: bytes) -> Fields:
    found, place = {}, 0
    while place < len(header):
        size = _number(header[place : place + NUMBER.size])
        place += NUMBER.size
        name, equals, value = header[place : place + size].partition(b"=")
        if not equals or place + size > len(header):
            raise CutError("damaged")
        found[name] = value
        place += size
    return found


def _taken(stream: LogFile | Pieces, size: int, most: int, messages: Messages) -> bytes | None:
    """The next bytes; None where they are more than ``most``."""
    if size > most:
        messages.problem(f"a message of {size >> 20} MiB was left out")
        _skipped(stream, size)
        return None
    data = stream.read(size)
    if len(data) < size:
        raise CutError("cut off")
    return data


def _skipped(stream: LogFile | Pieces, size: int) -> None:
    if not stream.skip(size):
        raise CutError("cut off")


def _number(data: bytes) -> int:
    if len(data) != NUMBER.size:
        raise CutError("cut off")
    return int(NUMBER.unpack(data)[0])


def _field(fields: Fields, name: bytes) -> int:
    """A field that is a number; -1 where there is none."""
    value = fields.get(name, b"")
    return int(NUMBER.unpack(value)[0]) if len(value) == NUMBER.size else -1


def _time(fields: Fields) -> float | None:
    value = fields.get(b"time", b"")
    if len(value) != 2 * NUMBER.size:
        return None
    seconds, nanoseconds = struct.unpack("<II", value)
    return float(seconds + nanoseconds * 1e-9)


def _text(value: bytes) -> str:
    return value.decode("utf-8", "replace")


ROS_1_BAG = Format(
    name="ROS 1 bag",
    expects="a ROS 1 bag",
    recognises=lambda head: head.startswith(MAGIC),
    records=_records,
    unit="message",
    topics=True,
)
