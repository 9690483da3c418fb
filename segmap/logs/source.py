"""Bytes to read: a path, bytes or a stream; gzip taken off; size, ratio, time and line length bounded.

A compressed file that is cut off or damaged ends early: what came before the damage is still
read. One that grows beyond all measure is refused.
"""

from __future__ import annotations

import io
import math
import os
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import IO, Any, TypeAlias

from segmap.errors import LogError

__all__ = ["ANY_SIZE", "Limits", "LogFile", "LogSource", "bag_in", "base_name", "name_of"]

LogSource: TypeAlias = str | os.PathLike[str] | bytes | bytearray | memoryview | IO[bytes]
"""A path, the bytes themselves, or a binary stream (read from where it stands, and not closed)."""

GZIP = b"\x1f\x8b"
HEAD = 1 << 20
"""bytes a format may look at to recognise a file"""
PIECE = 1 << 13
"""compressed bytes taken at a time"""
HARMLESS = 1 << 24
"""decompressed bytes below which the ratio does not matter"""
MEBIBYTE = 1 << 20


@dataclass(frozen=True, slots=True)
class Limits:
    """How much of a file is read at most."""

    size: int = 256 * MEBIBYTE
    """bytes, decompressed"""
    ratio: float = 200.0
    """decompressed bytes for each compressed one; laser logs have 3 to 10"""
    line: int = 2 * MEBIBYTE
    """bytes of one line"""
    lines: int = 10_000_000
    scans: int = 500_000
    seconds: float = 600.0
    """of reading; 256 MiB take less than a minute"""


ANY_SIZE = Limits(size=1 << 50, lines=1 << 40, scans=1 << 40, seconds=math.inf)
"""for files of one's own; what grows beyond measure when decompressed is refused all the same"""


def base_name(name: str) -> str:
    """The last part of a path as one printable line; a name is only ever text, never opened.

    >>> base_name("../../etc/run 1.log")
    'run 1.log'
    """
    last = PurePosixPath(name.replace("\\", "/")).name
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in last)[:200] or "log"


class LogFile:
    """An open log: its first bytes, then its lines. Use as a context manager.

    Raises:
        LogError: the file cannot be opened or read, or it grows beyond a limit.
    """

    def __init__(self, source: LogSource, name: str | None = None, limits: Limits | None = None) -> None:
        self.limits = limits or Limits()
        if isinstance(source, str | os.PathLike) and "\0" not in os.fspath(source):
            source = bag_in(Path(source))
        self.name = base_name(name or name_of(source))
        self._stream, self._ours = _opened(source, self.name)
        self._path = Path(source) if isinstance(source, str | os.PathLike) else None
        self._bytes = _Bounded(self._stream, self.name, self.limits)
        self._buffer = io.BufferedReader(self._bytes, HEAD)

    def __enter__(self) -> LogFile:
        return self

    def __exit__(self, *_: object) -> None:
        if self._ours:
            self._stream.close()

    @property
    def damage(self) -> str | None:
        """What is wrong with the compressed data, known once the end is reached."""
        return self._bytes.damage

    def head(self) -> bytes:
        """The first bytes, at most ``HEAD``, without taking them."""
        return self._buffer.peek(HEAD)

    def lines(self, too_long: Callable[[int, str], None]) -> Iterator[tuple[int, bytes]]:
        """Number, from 1, and bytes of each line; one that is too long is reported and passed over.

        Of a damaged file the last line is left out: it is cut off anywhere, even within a number.
        """
        for number in count(1):
            line = self._buffer.readline(self.limits.line + 1)
            if not line or (self.damage and not line.endswith(b"\n")):
                return
            if number > self.limits.lines:
                raise LogError(f"{self.name} has more than {self.limits.lines} lines: split it and read each part.")
            if len(line) > self.limits.line:
                too_long(number, f"the line is longer than {_mebibytes(self.limits.line)} and was left out")
                self._finish(line)
                continue
            yield number, line.removeprefix(b"\xef\xbb\xbf") if number == 1 else line

    def read(self, size: int) -> bytes:
        """The next bytes; fewer than ``size`` at the end."""
        pieces = []
        while size > 0 and (piece := self._buffer.read(min(size, HEAD))):
            pieces.append(piece)
            size -= len(piece)
        return b"".join(pieces)

    def skip(self, size: int) -> bool:
        """Pass over the next bytes; whether there were as many."""
        while size > 0 and (piece := self._buffer.read(min(size, HEAD))):
            size -= len(piece)
        return size <= 0

    def expanded(self, size: int) -> None:
        """Count bytes that came out of something compressed inside the file.

        Raises:
            LogError: together they are more than the limits allow.
        """
        self._bytes.expanded(size)

    @contextmanager
    def on_disk(self) -> Iterator[Path]:
        """All of the file as a file that other libraries can open; a copy where it is no plain file."""
        if self._path and not self._bytes.compressed:
            self._bytes.elsewhere(self._path.stat().st_size)
            yield self._path
            return
        with TemporaryDirectory(prefix="segmap-") as folder:
            copy = Path(folder) / "log"
            with copy.open("wb") as target:
                while piece := self.read(HEAD):
                    target.write(piece)
            yield copy

    def _finish(self, line: bytes) -> None:
        while line and not line.endswith(b"\n"):
            line = self._buffer.readline(HEAD)


def name_of(source: LogSource) -> str:
    """What a source is called; a stream may have no name."""
    if isinstance(source, str | os.PathLike):
        return os.fspath(source)
    name = getattr(source, "name", None)
    return name if isinstance(name, str) else "log"


def bag_in(path: Path) -> Path:
    """The bag in a folder that ROS 2 made for it; any other path is itself.

    Raises:
        LogError: the folder holds several, parts of one recording or different ones.
    """
    if not path.is_dir():
        return path
    bags = sorted(held for held in path.iterdir() if held.suffix in (".db3", ".mcap"))
    if len(bags) > 1:
        raise LogError(f"{path} holds {len(bags)} bags: give the files one by one, {bags[0].name} and so on.")
    return bags[0] if bags else path


def _opened(source: LogSource, name: str) -> tuple[IO[bytes], bool]:
    """The stream, and whether it is ours to close."""
    if isinstance(source, bytes | bytearray | memoryview):
        return io.BytesIO(source), True
    if not isinstance(source, str | os.PathLike):
        return source, False
    try:
        return Path(source).open("rb"), True
    except FileNotFoundError:
        raise LogError(f"There is no file {os.fspath(source)}: check the path.") from None
    except IsADirectoryError:
        raise LogError(f"{os.fspath(source)} is a folder: give the log file inside it.") from None
    except (OSError, ValueError) as error:
        raise _unreadable(name, error) from None


def _unreadable(name: str, error: Exception) -> LogError:
    reason = getattr(error, "strerror", None) or str(error)
    return LogError(f"{name} cannot be read: {reason.lower()}. Check the file and its permissions.")


def _mebibytes(size: int) -> str:
    return f"{size / MEBIBYTE:g} MiB" if size >= MEBIBYTE else f"{size} bytes"


class _Bounded(io.RawIOBase):
    """The decompressed bytes of a stream, up to the limits."""

    def __init__(self, stream: IO[bytes], name: str, limits: Limits) -> None:
        self._name, self._limits = name, limits
        self._compressed = _Compressed(stream, name)
        start = self._compressed.take(len(GZIP))
        self._inflated = _Inflated(self._compressed, start) if start == GZIP else None
        self._start = b"" if self._inflated else start
        self._size = self._expanded = 0
        self._end = time.monotonic() + limits.seconds

    @property
    def compressed(self) -> bool:
        """Whether the whole of the stream is."""
        return self._inflated is not None

    @property
    def damage(self) -> str | None:
        return self._inflated.damage if self._inflated else None

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        view, filled = memoryview(buffer).cast("B"), 0
        while filled < len(view) and (piece := self._piece(len(view) - filled)):
            view[filled : filled + len(piece)] = piece
            filled += len(piece)
        return filled

    def _piece(self, size: int) -> bytes:
        if self._inflated:
            piece = self._inflated.take(size)
        elif self._start:
            piece, self._start = self._start[:size], self._start[size:]
        else:
            piece = self._compressed.take(size)
        self._check(len(piece))
        return piece

    def elsewhere(self, size: int) -> None:
        """Count the whole of the file, which somebody else reads."""
        self._compressed.taken, self._size = size, 0
        self._check(size)

    def expanded(self, size: int) -> None:
        """Count bytes that came out of something compressed inside."""
        self._expanded += size
        self._check(size)

    def _check(self, more: int) -> None:
        self._size += more
        if time.monotonic() > self._end:
            raise LogError(f"{self._name} takes more than {self._limits.seconds:g} s to read: split it and read each.")
        if self._size > self._limits.size:
            size = _mebibytes(self._limits.size)
            raise LogError(f"{self._name} holds more than {size}: split it into several logs and read each.")
        grows = self._inflated or self._expanded
        ratio = self._size / max(self._compressed.taken, 1) if grows else 0.0
        if self._size > HARMLESS and ratio > self._limits.ratio:
            raise LogError(
                f"{self._name} grows {math.floor(ratio)} times when decompressed, more than any laser log does:"
                " it was not read. Decompress it yourself if you trust it."
            )


class _Compressed:
    """The bytes as they lie in the file, counted."""

    def __init__(self, stream: IO[bytes], name: str) -> None:
        self._stream, self._name = stream, name
        self.taken = 0

    def take(self, size: int) -> bytes:
        """Some of the next bytes, at most ``size``; none at the end."""
        try:
            piece = self._stream.read(size) or b""
        except (OSError, ValueError) as error:
            raise _unreadable(self._name, error) from None
        self.taken += len(piece)
        return piece


class _Inflated:
    """gzip data, of one member or several, decompressed piece by piece."""

    def __init__(self, compressed: _Compressed, start: bytes) -> None:
        self._compressed, self._waiting = compressed, start
        self._inflate = _inflater()
        self.damage: str | None = None

    def take(self, size: int) -> bytes:
        """Some of the next decompressed bytes, at most ``size``; none at the end or at damage."""
        while not self.damage:
            if self._inflate.eof and not self._next_member():
                break
            data = self._waiting or self._compressed.take(PIECE)
            piece = self._decompressed(data, size)
            if piece:
                return piece
            if not data and not self._inflate.eof:
                self.damage = "cut off"
        return b""

    def _decompressed(self, data: bytes, size: int) -> bytes:
        before = self._inflate.copy()
        try:
            piece: bytes = self._inflate.decompress(data, size)
        except zlib.error:
            self.damage = "damaged"
            return _up_to_damage(before, data, size)
        self._waiting = self._inflate.unconsumed_tail
        return piece

    def _next_member(self) -> bool:
        rest = self._inflate.unused_data.lstrip(b"\0")
        while len(rest) < len(GZIP) and (more := self._compressed.take(PIECE)):
            rest = (rest + more).lstrip(b"\0")
        if not rest.startswith(GZIP):
            return False
        self._waiting, self._inflate = rest, _inflater()
        return True


def _inflater() -> Any:
    return zlib.decompressobj(wbits=16 + zlib.MAX_WBITS)


def _up_to_damage(inflate: Any, data: bytes, size: int) -> bytes:
    """What comes out of damaged data before the first byte that makes no sense."""
    saved = b""
    with suppress(zlib.error):
        for byte in data:
            saved += inflate.decompress(bytes((byte,)), max(size - len(saved), 1))
            if len(saved) >= size:
                break
    return saved[:size]
