"""Accepted on arbitrary pairs: which pairs are drawn, what is called wrong, and counts that add up."""

import importlib
import math
from pathlib import Path

import pytest

from segmap.logs import read_log
from segmap.pose import Pose2

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def script():
    """The scripts by name, with their folder on the path as when they are run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "benchmarks"))
        yield importlib.import_module


@pytest.fixture(scope="module")
def hall(script):
    """A sample log, named as a log with a wrong pose."""
    return script("common").LogPairs("csail", read_log(ROOT / "sample_logs" / "hall.log"), ())


def test_pairs_are_near_different_and_the_same_every_time(script, hall):
    """No pair twice, none of a scan with itself, none beyond reach, in both orders; fewer where there are fewer."""
    draw = script("false_accepts").draw
    pairs = list(draw(hall, 200, seed=1))
    assert len({frozenset(pair) for pair in pairs}) == len(pairs) == 200
    assert all(i != j for i, j in pairs)
    assert all(math.hypot(*list(script("false_accepts").logged(hall.log, i, j))[:2]) < 15.0 for i, j in pairs)
    assert 0 < sum(i < j for i, j in pairs) < 200
    assert pairs == list(draw(hall, 200, seed=1)) != list(draw(hall, 200, seed=2))
    everything = list(draw(hall, 10**6, seed=1))
    assert len(everything) < 10**6


def test_a_scan_whose_pose_is_wrong_is_not_drawn(script, hall):
    """Scan 42 of csail; of another log, scan 42 is like any."""
    draw, common = script("false_accepts").draw, script("common")
    assert all(42 not in pair for pair in draw(hall, 10**6, seed=1))
    other = common.LogPairs("other", hall.log, ())
    assert any(42 in pair for pair in draw(other, 10**6, seed=1))


@pytest.mark.parametrize(
    ("accepted", "off", "wrong"),
    [
        (True, (0.49, 0.1), False),
        (True, (0.51, 0.0), True),
        (True, (0.0, 0.18), True),
        (True, (math.inf, math.inf), True),
        (False, (9.0, 3.0), False),
    ],
)
def test_wrong_is_accepted_and_far_off(script, accepted, off, wrong):
    """Beyond half a metre or ten degrees; what was not accepted does no harm."""
    assert script("false_accepts").Trial("a", 0, 1, 1.0, accepted, 0.9, off).wrong is wrong


def test_counts_by_distance_add_up_to_all(script):
    """By log and over all logs, and the list has the surest first."""
    scripts = script("false_accepts")
    made = [
        scripts.Trial(log, 0, k, float(k), True, 0.9 + 0.01 * k, (9.0, 0.0) if k % 2 else (0.0, 0.0))
        for log in ("a", "b")
        for k in range(6)
    ]
    rows = [line.strip("| ").split(" | ") for line in scripts.table(made).splitlines()[2:]]
    counts = {(row[0], row[1]): row[2:] for row in rows}
    assert counts["a", "0 to 3"] == ["3", "3", "1", "33.3"]
    assert counts["a", "6 to 9"] == ["0", "0", "0", "-"]
    assert counts["all", "any"] == ["12", "12", "6", "50.0"]
    lines = scripts.listed(made)
    assert len(lines) == 6
    assert "confidence 0.950" in lines[0]


def test_a_sample_log_is_measured(script, hall):
    """Neighbouring and distant scans of a hall: each drawn pair has its verdict and its error."""
    found = script("false_accepts").trials(hall, 12, seed=3)
    assert len(found) == 12
    assert any(trial.accepted and not trial.wrong for trial in found)
    still = script("false_accepts").logged(hall.log, 3, 3)
    assert max(still.distance(Pose2.identity())) < 1e-12
