"""A JSON text of any length, value by value: of what was read no more than one value is held."""

from __future__ import annotations

import codecs
import json
from collections.abc import Iterator
from typing import Any

from segmap.logs.source import LogFile
from segmap.logs.text import MalformedError, printable

__all__ = ["JsonStream", "malformed"]

PIECE = 1 << 20
"""bytes that are read at once, more where a value is longer"""
SPACE = " \t\r\n"


def malformed(error: ValueError | RecursionError, before: tuple[int, int] = (0, 0)) -> MalformedError:
    """Why a text is no JSON, for people; ``before`` what was tried are so many lines, and columns in its first."""
    if isinstance(error, json.JSONDecodeError):
        line, column = before[0] + error.lineno, error.colno + (before[1] if error.lineno == 1 else 0)
        return MalformedError(f"it is no valid JSON: {error.msg.lower()}, line {line}, {column}")
    if isinstance(error, UnicodeDecodeError):
        return MalformedError("it is no valid JSON: it is not written in UTF-8")
    return MalformedError(f"it is no JSON that can be read: {printable(str(error)).lower()}")


class JsonStream:
    """The values of a JSON text, one after the other.

    Raises:
        MalformedError: the text is no JSON, or one value has more than ``most`` characters.
    """

    def __init__(self, file: LogFile, start: bytes, most: int) -> None:
        self._file, self._most = file, most
        self._decoder = codecs.getincrementaldecoder("utf-8-sig")()
        self._json = json.JSONDecoder()
        self._held, self._at, self._before = self._decoded(start), 0, (0, 0)

    def next(self) -> str:
        """The next character that is no space, without taking it; empty at the end."""
        while True:
            while self._at < len(self._held) and self._held[self._at] in SPACE:
                self._at += 1
            if self._at < len(self._held) or not self._more():
                return self._held[self._at : self._at + 1]

    def take(self, wanted: str) -> str:
        """The next character that is no space, one of these."""
        found = self.next()
        if not found or found not in wanted:
            raise self._wrong(f"Expecting {' or '.join(map(repr, wanted))}")
        self._at += 1
        return found

    def value(self) -> Any:
        """The next value."""
        self.next()
        while True:
            before = self._before
            try:
                value, end = self._json.raw_decode(self._held, self._at)
            except (ValueError, RecursionError) as error:
                if isinstance(error, RecursionError) or not self._more():
                    raise malformed(error, before) from None
            else:
                if end < len(self._held) or not self._more():  # a number may go on
                    self._at = end
                    return value

    def members(self) -> Iterator[str]:
        """The names of an object's members; take each value before the next name."""
        self.take("{")
        if self.next() == "}":
            self._at += 1
            return
        while True:
            if self.next() != '"':
                raise self._wrong("Expecting property name enclosed in double quotes")
            yield str(self.value())
            if self.take(",}") == "}":
                return

    def member(self) -> None:
        """Go from a member's name to its value."""
        self.take(":")

    def elements(self) -> Iterator[Any]:
        """The values of an array."""
        self.take("[")
        if self.next() == "]":
            self._at += 1
            return
        while True:
            yield self.value()
            if self.take(",]") == "]":
                return

    def end(self) -> None:
        """Nothing may follow."""
        if self.next():
            raise self._wrong("Extra data")

    def _wrong(self, what: str) -> MalformedError:
        return malformed(json.JSONDecodeError(what, self._held, self._at), self._before)

    def _more(self) -> bool:
        """Read on; whether there was more. What was taken is let go."""
        self._before = self._place()
        self._held, self._at = self._held[self._at :], 0
        if len(self._held) > self._most:
            raise MalformedError(f"it holds one value of more than {self._most >> 20} MiB")
        piece = self._file.read(max(PIECE, len(self._held)))
        self._held += self._decoded(piece)
        return bool(piece)

    def _place(self) -> tuple[int, int]:
        """Lines before the next character, and columns in its own."""
        lines, columns = self._before
        new = self._held.count("\n", 0, self._at)
        columns = self._at - self._held.rfind("\n", 0, self._at) - 1 if new else columns + self._at
        return lines + new, columns

    def _decoded(self, piece: bytes) -> str:
        try:
            return self._decoder.decode(piece, final=not piece)
        except UnicodeDecodeError as error:
            raise malformed(error) from None
