"""Where bytes come from, and how many of them are read."""

from __future__ import annotations

import gzip
import io
import tempfile

import numpy as np
import pytest

from segmap.errors import LogError
from segmap.logs import Limits, base_name, read_log


def test_every_source(small_log, tmp_path):
    """A path, bytes and streams, plain or gzipped, whatever their names, give the same scans."""
    for content in (small_log, gzip.compress(small_log)):
        path = tmp_path / "photo.png"
        path.write_bytes(content)
        with tempfile.SpooledTemporaryFile() as spooled, path.open("rb") as stream:
            spooled.write(content)
            spooled.seek(0)
            sources = (path, str(path), content, bytearray(content), memoryview(content), io.BytesIO(content), spooled)
            assert {len(read_log(source)) for source in (*sources, stream)} == {6}
            assert not stream.closed
            assert not spooled.closed


def test_names(small_log, tmp_path):
    """A log is called by the last part of its name, whatever that holds; it is only ever text."""
    path = tmp_path / "run.log"
    path.write_bytes(small_log)
    assert read_log(path).name == "run.log"
    assert read_log(small_log).name == "log"
    assert read_log(small_log, "../../etc/<img src=x onerror=alert(1)>.log").name == "<img src=x onerror=alert(1)>.log"
    assert base_name("C:\\logs\\a.log") == "a.log"
    assert base_name("a\nb\x1b[31m.log") == "a\N{REPLACEMENT CHARACTER}b\N{REPLACEMENT CHARACTER}[31m.log"
    assert base_name("..") == ".."
    assert base_name("/") == "log"


def test_line_ends(small_log):
    """Windows line ends and a byte order mark change nothing."""
    windows = b"\xef\xbb\xbf" + small_log.split(b"\n", 3)[3].replace(b"\n", b"\r\n")
    assert len(read_log(windows)) == 6
    assert read_log(windows).problems == ()


def test_paths_that_are_no_files(tmp_path):
    """What cannot be opened is one sentence with the remedy."""
    with pytest.raises(LogError, match=r"There is no file .*missing\.log: check the path"):
        read_log(tmp_path / "missing.log")
    with pytest.raises(LogError, match="is a folder: give the log file inside it"):
        read_log(tmp_path)
    with pytest.raises(LogError, match="cannot be read"):
        read_log("a\0b.log")


def test_failing_stream():
    """A stream that fails while it is read is one sentence too."""

    class Failing(io.RawIOBase):
        def read(self, _: int = -1) -> bytes:
            raise OSError(5, "Input/output error")

    with pytest.raises(LogError, match=r"disk\.log cannot be read: input/output error"):
        read_log(Failing(), "disk.log")


def test_several_members(small_log):
    """Files that were compressed apart and put one behind the other are one log, padding or not."""
    half = small_log.index(b"ODOM 3")
    both = (
        gzip.compress(small_log[:half]) + gzip.compress(b"") + b"\0" * 9 + gzip.compress(small_log[half:]) + b"\0" * 40
    )
    log = read_log(both)
    assert (len(log), log.problems) == (6, ())


def test_cut_off_gzip(robotlaser):
    """Of a compressed log that is cut off, what came before the cut is kept, and the cut is told."""
    lines = [robotlaser(*row) for row in np.random.default_rng(3).uniform(1.0, 9.0, (100, 180))]
    packed = gzip.compress("\n".join(lines).encode())
    whole = read_log(packed)
    log = read_log(packed[: len(packed) // 2], "cut.log.gz")
    assert 10 < len(log) < 100
    assert all((a.ranges == b.ranges).all() for a, b in zip(log, whole, strict=False))
    (problem,) = log.problems
    assert problem.line == len(log)
    assert "cut off after this line" in problem.reason


def test_damaged_gzip(small_log):
    """Of a compressed log whose end is damaged, what came before is kept."""
    packed = gzip.compress(small_log)
    log = read_log(packed[:-8] + b"\0" * 8)
    assert len(log) == 6
    assert "damaged after this line" in str(log.problems[0])


def test_gzip_cut_at_once():
    """A compressed log that ends before its first byte cannot be read, and says why."""
    with pytest.raises(LogError, match=r"a\.gz is cut off from its beginning: fetch the file again"):
        read_log(b"\x1f\x8b", "a.gz")
    with pytest.raises(LogError, match="damaged"):
        read_log(b"\x1f\x8b" + bytes(100))


def test_bombs():
    """A file that grows beyond all measure is refused, by its ratio or by its size."""
    bomb = gzip.compress(b"# CARMEN Logfile\n" + bytes(64 << 20))
    with pytest.raises(LogError, match=r"bomb\.gz grows \d+ times when decompressed"):
        read_log(bomb, "bomb.gz")
    with pytest.raises(LogError, match=r"holds more than 32 MiB: split it"):
        read_log(bomb, limits=Limits(size=32 << 20, ratio=1e9))


def test_size_limit_of_a_plain_file(small_log):
    """The limit of size holds without compression too."""
    assert len(read_log(small_log, limits=Limits(size=len(small_log)))) == 6
    with pytest.raises(LogError, match="holds more than 100 bytes"):
        read_log(small_log, limits=Limits(size=100))


def test_time_limit(small_log):
    """A file that takes for ever is given up, and told of."""
    with pytest.raises(LogError, match=r"a\.log takes more than 0 s to read: split it"):
        read_log(small_log, "a.log", Limits(seconds=0.0))


def test_long_lines(small_log):
    """A line that is too long is passed over and told of; the others are read."""
    first, rest = small_log.split(b"\n", 1)
    content = first + b"\nFLASER 3 " + b"1 " * 5000 + b"\n" + rest
    log = read_log(content, limits=Limits(line=500))
    assert len(log) == 6
    assert [str(problem) for problem in log.problems] == ["line 2: the line is longer than 500 bytes and was left out"]
    assert [scan.line for scan in log] == [scan.line + 1 for scan in read_log(small_log)]


def test_too_many_scans(small_log):
    """A file of more scans or lines than anybody can use is refused before it fills the memory or the day."""
    with pytest.raises(LogError, match="has more than 10 lines: split it"):
        read_log(small_log, limits=Limits(lines=10))
    with pytest.raises(LogError, match="holds more than 5 scans"):
        read_log(small_log, limits=Limits(scans=5))


@pytest.mark.parametrize("content", [b"", b"\n \n", gzip.compress(b"", mtime=0)])
def test_empty(content):
    """An empty file is a log of no scans that says so."""
    log = read_log(content, "a.log")
    assert len(log) == 0
    assert [str(problem) for problem in log.problems] == ["line 1: a.log is empty: choose a log that holds laser scans"]


def test_packed(small_log):
    """An archive of another kind is named, with what to do."""
    with pytest.raises(LogError, match="is compressed twice: unpack it"):
        read_log(gzip.compress(gzip.compress(small_log)))
    with pytest.raises(LogError, match=r"a\.zip is a zip archive: unpack it and give the log inside"):
        read_log(b"PK\x03\x04" + bytes(100), "a.zip")
