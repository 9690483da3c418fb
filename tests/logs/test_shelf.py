"""Large logs: their readings lie in a file that goes with them, and are the same readings."""

from __future__ import annotations

import numpy as np
import pytest

from segmap import logs
from segmap.logs import read_log
from segmap.logs.records import Record
from segmap.logs.shelf import BOARD, REST, Shelf


def test_readings_are_the_same_wherever_they_lie(small_log: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    """In memory or on the shelf: the same scans, which nobody can write to."""
    plain = read_log(small_log, "a.log")
    monkeypatch.setattr(logs, "Shelf", lambda: Shelf(in_memory=0))
    shelved = read_log(small_log, "a.log")
    assert len(plain) == len(shelved) > 0
    for one, other in zip(plain, shelved, strict=True):
        assert np.array_equal(one.ranges, other.ranges, equal_nan=True)
        assert (one.max_range, one.time, one.logged_pose) == (other.max_range, other.time, other.logged_pose)
        assert not one.ranges.flags.writeable
        assert not other.ranges.flags.writeable
    assert (plain.no_return, plain.problems) == (shelved.no_return, shelved.problems)


def test_a_shelf_has_boards_without_end() -> None:
    """Many records on several boards, looked at and let go in between, keep what was written to them."""
    shelf, beams = Shelf(in_memory=0), BOARD // 8 // 1000
    held = [shelf.put(Record("", k, np.full(beams, float(k)), 0.0, 0.1)) for k in range(2500)]
    assert len({record.ranges.base is None for record in held}) == 1
    for record in shelf.passing(held[: REST + 10]):
        record.ranges[0] = -1.0
    shelf.rest()
    assert all(record.ranges[1] == k for k, record in enumerate(held))
    assert [record.ranges[0] for record in held[: REST + 12]] == [-1.0] * (REST + 10) + [REST + 10.0, REST + 11.0]
