"""Which reading stands for "nothing seen"."""

from __future__ import annotations

import numpy as np
import pytest

from segmap.logs import read_log
from segmap.logs.no_return import no_return


def real_ranges(scans: int = 40, beams: int = 180, resolution: float = 0.01) -> list[np.ndarray]:
    """What a laser measures in a room of some metres: continuous ranges, rounded."""
    random = np.random.default_rng(7)
    distances = random.gamma(3.0, 1.5, (scans, beams)) + 0.4
    return list(np.round(np.round(distances / resolution) * resolution, 3))


def with_code(ranges: list[np.ndarray], code: float, every: int = 17) -> list[np.ndarray]:
    """The same with every so-many-th reading replaced."""
    flat = np.concatenate(ranges)
    flat[::every] = code
    return np.split(flat, len(ranges))


@pytest.mark.parametrize("code", [81.83, 81.91, 51.15, 50.0, 30.0, 655.35])
def test_found_beyond_all_ranges(code):
    """A reading that recurs beyond all others is found, and nothing there is a return."""
    found = no_return(with_code(real_ranges(), code))
    assert (found.reading, found.limit) == (code, code)


@pytest.mark.parametrize("reach", [4.0, 8.191, 12.0])
def test_found_at_the_end_of_the_scale(reach):
    """It is found where real ranges come up to it."""
    found = no_return([np.minimum(row, reach) for row in real_ranges()])
    assert found.reading == reach
    assert found.limit >= 0.999 * reach


def test_codes_of_one_sensor():
    """A SICK's several codes at the end of its scale are all no returns, a range just below is one."""
    rows = with_code(with_code(with_code(real_ranges(), 8.183), 8.187, 100), 8.191, 300)
    rows[0][:3] = 8.17, 8.175, 8.178
    found = no_return([np.where(row > 8.2, 3.0, row) for row in rows])
    assert (found.reading, found.limit) == (8.191, 8.183)


@pytest.mark.parametrize("resolution", [0.001, 0.01, 0.05, 0.25])
def test_nothing_in_a_log_without(resolution):
    """Where every beam returns, no reading is taken for a no return."""
    found = no_return(real_ranges(resolution=resolution))
    assert (found.reading, found.limit) == (None, np.inf)


def test_nothing_where_the_robot_stands():
    """A robot that stands, and measures the same again and again, sees what it sees."""
    assert no_return(real_ranges(scans=1) * 500).reading is None
    assert no_return([np.full(180, 2.0)] * 10).reading is None


def test_garbage_above():
    """A few absurd readings do not hide it."""
    rows = with_code(real_ranges(), 81.83)
    rows[3][5], rows[4][6] = 700.0, 1e300
    found = no_return(rows)
    assert (found.reading, found.limit) == (81.83, 81.83)


def test_known_code_once():
    """In a single scan, one reading is enough where it is a sensor's well-known code."""
    (row,) = real_ranges(scans=1)
    row[90] = 81.91
    assert no_return([row]).reading == 81.91
    row[90] = 60.0
    assert no_return([row]).reading is None


def test_zero():
    """Zeros, where nothing else does, stand for nothing seen."""
    found = no_return(with_code(real_ranges(), 0.0))
    assert (found.reading, found.limit) == (0.0, np.inf)


def test_nothing_to_look_at():
    """No readings, or none that is a number, are no reason to fail."""
    assert no_return([]).reading is None
    assert no_return([np.empty(0), np.array([np.nan, np.inf, -1.0])]).reading is None


def test_declared_range():
    """A declared maximum range is believed where the data agree, and not where they do not."""
    assert no_return(real_ranges(), declared=50.0).limit == 50.0
    assert no_return(with_code(real_ranges(), 81.83), declared=50.0).limit == 50.0
    assert no_return(with_code(real_ranges(), 81.83), declared=2.0).limit == 81.83
    assert no_return(real_ranges(), declared=2.0).limit == np.inf


def test_each_laser_of_a_log(flaser):
    """Two lasers of one log may write different things where they see nothing."""
    front, rear = with_code(real_ranges(), 81.83), with_code(real_ranges(30), 30.0)
    lines = [flaser(*row) for row in front] + [flaser(*row, word="RLASER") for row in rear]
    log = read_log("\n".join(lines).encode())
    assert log.no_return == 81.83
    assert [scan.max_range for scan in (log[0], log[-1])] == [81.83, 30.0]
    assert not any((scan.ranges >= scan.max_range).any() for scan in log)
