"""The real logs, as their README describes them."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from segmap.logs import read_log

LOGS = {
    "intel/intel-corrected.log.gz": ("CARMEN", 910, 180, 1.0, 81.83),
    "intel/intel-graph.log.gz": ("CARMEN", 2672, 180, 1.0, 81.83),
    "fr079/fr079-graph.log.gz": ("CARMEN", 1464, 360, 0.5, 81.91),
    "aces/aces-corrected.log.gz": ("CARMEN", 440, 180, 1.0, 50.0),
    "csail/csail-corrected.log.gz": ("CARMEN", 406, 361, 0.5, 81.91),
    "fr101/freiburg-101-corrected.log.gz": ("CARMEN", 292, 360, 0.5, 81.91),
    "loop5/loop5.log.gz": ("DP-SLAM", 551, 181, 1.0, 8.191),
}


@pytest.mark.parametrize("path", LOGS)
def test_as_described(datasets, path):
    """Scans, beams, angles and the reading for "nothing seen" are the ones known of each log."""
    format, scans, beams, step, no_return = LOGS[path]
    log = read_log(datasets / path)
    assert (log.format, len(log), log.no_return, log.problems) == (format, scans, no_return, ())
    assert {len(scan) for scan in log} == {beams}
    assert {round(math.degrees(scan.first_angle), 3) for scan in log} == {-90.0}
    assert {round(math.degrees(scan.angle_step), 3) for scan in log} == {step}
    assert all(scan.logged_pose is not None for scan in log)
    assert all(scan.max_range <= no_return for scan in log)


@pytest.mark.parametrize("path", LOGS)
def test_nothing_is_taken_from_a_log_without_no_returns(datasets, path):
    """Once its no returns are taken out, a log has none: no real reading passes for one."""
    log = read_log(datasets / path)
    lines = (f"FLASER {len(scan)} {' '.join(map(str, np.nan_to_num(scan.ranges, nan=-1.0)))}" for scan in log)
    again = read_log("\n".join(lines).encode())
    assert again.no_return is None
    assert all((a.ranges == b.ranges)[~np.isnan(a.ranges)].all() for a, b in zip(log, again, strict=True))


@pytest.mark.parametrize("name", ["intel", "fr079", "aces", "csail", "fr101"])
def test_indices_are_those_of_the_benchmark(datasets, benchmarks, name):
    """The logged poses of a benchmark pair are as far apart as the benchmark says."""
    pairs = json.loads((benchmarks / "pairs" / f"{name}.json").read_text())
    log = read_log(datasets / pairs["log"])
    for pair in (pair for pair in pairs["pairs"] if pair["kind"] != "negative"):
        T_i_j = log[pair["i"]].logged_pose.inverse() @ log[pair["j"]].logged_pose
        distance = math.dist((T_i_j.x, T_i_j.y), (pair["x"], pair["y"]))
        assert distance < 0.01
