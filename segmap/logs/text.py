"""Logs that are lines of words: the first word of a line says what the rest is."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TypeAlias

import numpy as np

from segmap.logs.records import Problems, Record, too_many
from segmap.logs.source import LogFile
from segmap.pose import FloatArray, Pose2

__all__ = [
    "MalformedError",
    "Parser",
    "a_pose",
    "count_of",
    "first_words",
    "number",
    "numbers",
    "printable",
    "records_of",
    "shown",
]

Parser: TypeAlias = Callable[[Sequence[bytes], int], Record | None]
"""Takes the words of a line and its number; a line that is no scan gives None."""

READINGS = "readings"
UNKNOWN_WORDS = 1000
"""different unknown first words that are told apart"""


class MalformedError(ValueError):
    """A line does not hold what its first word promises; the text says why."""


def records_of(
    file: LogFile, problems: Problems, parsers: Mapping[bytes, Parser], known: re.Pattern[bytes]
) -> Iterator[Record]:
    """The records of a file, line by line.

    A line whose first word has no parser is passed over; where that word is not a ``known`` one
    either, that is a problem, told once for each word.
    """
    unknown: set[bytes] = set()
    for line, text in file.lines(problems.add):
        words = text.split()
        if not words:
            continue
        if parser := parsers.get(words[0]):
            record = _parsed(parser, words, line, problems)
            if record is not None:
                yield record
        elif not known.fullmatch(words[0]) and words[0] not in unknown:
            problems.add(line, f"{shown(words[0])} starts no record of this format; such lines were left out")
            unknown |= {words[0]} if len(unknown) < UNKNOWN_WORDS else set()


def _parsed(parser: Parser, words: Sequence[bytes], line: int, problems: Problems) -> Record | None:
    try:
        return parser(words, line)
    except MalformedError as error:
        problems.add(line, f"{error}; the line was left out")
        return None


def first_words(head: bytes) -> Iterator[list[bytes]]:
    """The first words of each line in the first bytes of a file, at most three, to recognise it by."""
    for line in head.removeprefix(b"\xef\xbb\xbf").splitlines():
        if words := line[:200].split(maxsplit=3):
            yield words[:3]


def count_of(words: Sequence[bytes], place: int, what: str) -> int:
    """A number of things that follow, checked against what the line holds."""
    if place >= len(words):
        raise MalformedError(f"{shown(words[0])} ends before the number of {what}")
    if not re.fullmatch(rb"\+?[0-9]{1,9}", words[place]):
        raise MalformedError(f"the number of {what} is {shown(words[place])}, not a whole number")
    count, held = int(words[place]), len(words) - place - 1
    if what == READINGS and (wrong := too_many(count)):
        raise MalformedError(wrong)
    if count > held:
        raise MalformedError(f"{shown(words[0])} announces {count} {what} and holds {held}")
    return count


def numbers(words: Sequence[bytes], what: str) -> FloatArray:
    """Words as numbers, shape (words,); ``nan`` and ``inf`` are numbers here."""
    try:
        if not any(b"_" in word for word in words):
            return np.fromiter(map(float, words), np.float64, len(words))
    except ValueError:
        pass
    place = next(i for i, word in enumerate(words) if not _is_number(word))
    raise MalformedError(f"{what} {place} is {shown(words[place])}, not a number")


def number(word: bytes, what: str) -> float:
    """A word as a finite number."""
    value = float(word) if _is_number(word) else math.nan
    if not math.isfinite(value):
        raise MalformedError(f"the {what} is {shown(word)}, not a number")
    return value


def a_pose(words: Sequence[bytes]) -> Pose2 | None:
    """x, y (metres) and theta (radians) as a pose; none where one of them is not finite."""
    x, y, theta = numbers(words[:3], "coordinate").tolist()
    return Pose2(x, y, theta) if math.isfinite(x + y + theta) else None


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return b"_" not in word


def printable(text: str) -> str:
    """A text of a file as one printable line of reasonable length."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text[:200])


def shown(word: bytes) -> str:
    """A word of a file in a message: quoted, printable, short."""
    text = word[:24].decode("utf-8", "replace")
    return repr(text + "\N{HORIZONTAL ELLIPSIS}" if len(word) > 24 else text)
