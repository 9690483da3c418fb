"""Readings of a large log: in a temporary file that the system pages in and out, as a gigabyte needs no gigabyte."""

from __future__ import annotations

import mmap
from collections.abc import Iterable, Iterator
from dataclasses import replace
from tempfile import TemporaryFile

import numpy as np

from segmap.logs.records import Record
from segmap.pose import FloatArray

__all__ = ["IN_MEMORY", "Shelf"]

IN_MEMORY = 64 << 20
"""bytes of readings that simply stay in memory"""
BOARD = 16 << 20
"""bytes mapped in one piece; more than the largest scan has"""
REST = 2000
"""records between two times that memory is let go"""


class Shelf:
    """Takes readings in; what it gives back can be written to. The file goes when nothing of it is used any more."""

    def __init__(self, in_memory: int = IN_MEMORY) -> None:
        self._room, self._boards, self._used = in_memory, list[mmap.mmap](), BOARD

    def put(self, record: Record) -> Record:
        """The record, with its readings where there is room for them."""
        self._room -= record.ranges.nbytes
        return record if self._room >= 0 else replace(record, ranges=self._laid(record.ranges))

    def passing(self, records: Iterable[Record]) -> Iterator[Record]:
        """The records, one by one, without those passed staying in memory."""
        for number, record in enumerate(records):
            yield record
            if number % REST == REST - 1:
                self.rest()

    def rest(self) -> None:
        """Leave it to the system to keep what was touched."""
        for board in self._boards:
            if hasattr(mmap, "MADV_DONTNEED"):
                board.madvise(mmap.MADV_DONTNEED)

    def _laid(self, ranges: FloatArray) -> FloatArray:
        if self._used + ranges.nbytes > BOARD:
            self._add_board()
        place: FloatArray = np.frombuffer(self._boards[-1], np.float64, len(ranges), self._used)
        place[:] = ranges
        self._used += ranges.nbytes
        return place

    def _add_board(self) -> None:
        self.rest()
        with TemporaryFile(prefix="segmap-") as file:
            file.truncate(BOARD)
            self._boards.append(mmap.mmap(file.fileno(), BOARD))
        self._used = 0
