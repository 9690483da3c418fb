"""Whatever the bytes, a log or one of segmap's own errors comes out."""

from __future__ import annotations

import gzip

import numpy as np
import pytest
from fuzzing import changed, readers
from fuzzing import outcome as result_of
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from segmap.errors import SegmapError
from segmap.logs import Limits, read_log
from segmap.scans import LaserLog

KEYWORDS = [
    b"FLASER",
    b"RLASER",
    b"ROBOTLASER1",
    b"RAWLASER1",
    b"Laser",
    b"Odometry",
    b"PARAM",
    b"ODOM",
    b"#",
    b"VERTEX2",
]
NUMBERS = [b"-1", b"0", b"1", b"2", b"3", b"180", b"1e999", b"1e-9", b"9" * 20, b"81.83", b"nan", b"inf", b"-inf"]
WORDS = st.sampled_from([*KEYWORDS, *NUMBERS, b"0x10", b"1_0", b"\0", b"\xff", b"<b>", b"host"])
LINES = st.lists(WORDS, max_size=20).map(b" ".join)
TEXTS = st.lists(LINES, max_size=12).map(b"\n".join)


def outcome(content: bytes) -> LaserLog | SegmapError:
    """The log, or the error that refuses it; nothing else is allowed."""
    try:
        log = read_log(content, "../a<b>.log", Limits(size=1 << 22))
    except SegmapError as error:
        refused = error
    else:
        return checked(log)
    assert str(refused).isprintable()
    return refused


def checked(log: LaserLog) -> LaserLog:
    assert log.name == "a<b>.log"
    for scan in log:
        assert (np.isnan(scan.ranges) | (scan.ranges > 0.0)).all()
        scan.returns()
    assert all(str(problem).isprintable() for problem in log.problems)
    return log


@given(TEXTS)
def test_words_of_logs_in_any_order(text):
    """Lines of words that occur in logs."""
    outcome(text)
    outcome(gzip.compress(text))


@given(
    st.binary(max_size=300),
    st.sampled_from([b"", b"\x1f\x8b\x08\x00", b"FLASER 3 ", b"# CARMEN Logfile\n", b"Laser 1 "]),
)
def test_any_bytes(content, start):
    """Any bytes, with or without a start that some format recognises."""
    outcome(start + content)


@given(st.data())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_cut_and_changed_logs(small_log, data):
    """A log cut anywhere and changed in some places, plain and compressed."""
    content = small_log if data.draw(st.booleans()) else gzip.compress(small_log)
    content = bytearray(content[: data.draw(st.integers(0, len(content)))])
    for _ in range(data.draw(st.integers(0, 8)) if content else 0):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    outcome(bytes(content))


@given(st.data())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_one_changed_byte_costs_one_scan(small_log, data):
    """Whatever happens to one byte within a line, the scans of the other lines are the same."""
    place = data.draw(st.sampled_from([i for i, byte in enumerate(small_log) if byte != ord("\n")]))
    content = bytearray(small_log)
    content[place] = data.draw(st.integers(0, 255).filter(lambda byte: byte not in b"\n"))
    line = small_log.count(b"\n", 0, place) + 1
    whole, log = read_log(small_log), read_log(bytes(content))
    expected = [scan.ranges.tolist() for scan in whole if scan.line != line]
    assert [scan.ranges.tolist() for scan in log if scan.line != line] == expected


READERS = readers()


@pytest.mark.parametrize("name", READERS)
@given(st.randoms(use_true_random=False), st.sampled_from(sorted(READERS)))
@settings(max_examples=60, suppress_health_check=[HealthCheck.differing_executors])
def test_files_of_every_kind_after_accidents(name, chance, other):
    """A file changed at random in some places is read or refused in a sentence; benchmarks/fuzz_readers.py goes on."""
    read, good = READERS[name]
    assert result_of(read, changed(good, chance, READERS[other][1])) in ("read", "refused")


@pytest.mark.parametrize("name", READERS)
def test_the_files_that_are_changed_are_good(name):
    """Without an accident every reader reads its file."""
    assert result_of(*READERS[name]) == "read"
